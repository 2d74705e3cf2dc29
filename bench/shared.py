"""What the benches share: options, scenes of others, what was measured on what machine, and where figures go."""
import datetime
import json
import os
import platform
import re
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def run(*command):
    """What a command prints; its error text is an exception."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout


def common_options(parser):
    """What every bench that renders can be told."""
    parser.add_argument("--threads", type=int, default=os.cpu_count(), metavar="N", help="threads (all)")
    parser.add_argument("--bin", default=os.path.join(ROOT, "target", "release"), metavar="DIR", help="where karst is")


def finish(parser):
    """The options as they were given, with the program that they lead to."""
    options = parser.parse_args()
    options.karst = os.path.join(options.bin, "karst")
    return options


def parse(parser):
    """The options of a program that renders scenes, with those that all of them have."""
    common_options(parser)
    parser.add_argument("--scenes", default=os.environ.get("KARST_SCENES"), metavar="DIR", help="scenes of others ($KARST_SCENES)")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (all)")
    return finish(parser)


def folders(options):
    """Name and folder of each scene of others that is asked for."""
    if options.scenes and not os.path.isdir(options.scenes):
        sys.exit(f"error: no folder {options.scenes}\nhint: --scenes DIR, or KARST_SCENES, says where scenes are")
    for name in sorted(os.listdir(options.scenes)) if options.scenes else []:
        folder = os.path.join(options.scenes, name)
        if os.path.exists(os.path.join(folder, "scene.xml")) and (not options.names or name in options.names):
            yield name, folder


def need_folders(options):
    """Those scenes as a list; ends the program where there is none, or none of a name."""
    if not options.scenes:
        sys.exit("error: nothing says where scenes are\nhint: --scenes DIR, or KARST_SCENES in the environment")
    found = list(folders(options))
    unknown = sorted(set(options.names) - {name for name, _ in found})
    if unknown or not found:
        sys.exit(f"error: no scene {', '.join(unknown) or 'at all'} in {options.scenes}\n"
                 "hint: a scene is a folder with scene.xml")
    return found


def converted(folder, work, options):
    """The document that karst makes of a scene, in whole."""
    document = os.path.join(work, "scene.json")
    os.makedirs(work, exist_ok=True)
    run(options.karst, "convert", os.path.join(folder, "scene.xml"), "-o", document, "--strict")
    return document


def reference_error(folder):
    """The relMSE that a reference says of itself, if it does."""
    path = os.path.join(folder, "reference.json")
    if not os.path.exists(path):
        return None
    with open(path, encoding="utf-8") as file:
        told = json.load(file)
    return told.get("relmse_of_reference", told.get("ref_relmse"))


def without_folders(text):
    """A text whose absolute paths have lost their folders, which mean nothing elsewhere."""
    return re.sub(r"(?<![\w./…])/(?:[^\s/:,'\"]+/)+([^\s/:,'\"]*)", r"…/\1", text)


def about(options):
    """What was measured, on what."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        models = [text.split(":", 1)[1].strip() for text in file if text.startswith("model name")]
    commit = subprocess.run(["git", "-C", ROOT, "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    command = [f'"{part}"' if " " in part else part for part in sys.argv[1:]]
    return {
        "date": datetime.date.today().isoformat(), "commit": commit.stdout.strip() or "unknown",
        "processor": models[0] if models else platform.processor(), "cores": os.cpu_count(), "threads": options.threads,
        "command": without_folders(" ".join([os.path.join("bench", os.path.basename(sys.argv[0])), *command])),
    }


def title(told):
    """One line that says what was measured, on what."""
    threads = "1 thread" if told["threads"] == 1 else f"{told['threads']} threads"
    return f"karst {told['commit']}, {threads}, {told['processor']}"


def keep(results, path):
    """Writes all figures, if they are wanted."""
    if path:
        with open(path, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)
            file.write("\n")


def publish(base, results, text, plot):
    """All figures as JSON, as a page of Markdown that ends with the plot of a name, and that plot."""
    what, drawing = plot
    keep(results, f"{base}.json")
    with open(f"{base}.md", "w", encoding="utf-8") as file:
        file.write(f"{text.rstrip()}\n\n![{what}]({os.path.basename(base)}.svg)\n")
    with open(f"{base}.svg", "w", encoding="utf-8") as file:
        file.write(drawing)
