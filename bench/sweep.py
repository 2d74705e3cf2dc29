#!/usr/bin/env python3
"""Speed against error of karst itself: scenes at several sample counts and error targets.

usage: bench/sweep.py [--spp 4 16 64] [--targets 0.1] [--pixels 40000] [--scenes DIR] [--out DIR] [--bin DIR] [NAME…]

Scenes are those of scenes/ that stand for a kind of work each, and with --scenes DIR those of a folder with one folder a
scene: scene.xml, reference.exr and reference.json. Each is rendered twice, with other seeds, at a size of about --pixels
pixels (those with a reference at its size), by --threads threads. The error is the root of the relMSE,
mean((a-b)² / (b²+0.01)), by three ways: what karst reports, what its two pictures differ by (over √2), and what one
differs from the reference by, without the error of that one. Without a reference errors are relative to a third picture, of
the most samples. Efficiency is 1 / (relMSE · seconds) by the two pictures. Seconds are of rendering alone, the
mean of both. Writes DATE-COMMIT.json, .md and .svg into bench/results/, or --out.
"""
import argparse
import datetime
import json
import math
import os
import platform
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
OWN = [
    "cornell.json", "demo/demo.json", "cave/cave.json", "sdf/smooth_union.json", "sdf/fbm_noise.json",
    "sdf/mandelbulb_valley.json",
]
HEAD = """| scene | asked | spp | seconds | Msamples/s | Mrays/s | error reported | of two | to reference | efficiency | MiB |
|---|---|---|---|---|---|---|---|---|---|---|"""
COLORS = ["#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb", "#000000"]


def run(*command):
    """What a command prints; its error text is an exception."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout


class Scene:
    """A document, its size in pixels, and its reference with that one's own error, if there is one."""

    def __init__(self, name, document, pixels, reference=None, reference_error=0.0):
        self.name, self.document, self.reference, self.reference_error = name, document, reference, reference_error
        with open(document, encoding="utf-8") as file:
            film = json.load(file)["film"]
        width, height = film["width"], film["height"]
        scale = 1.0 if reference else min(1.0, math.sqrt(pixels / (width * height)))
        # What errors are relative to where there is no reference: a picture of the most samples.
        self.weight = reference
        self.size = f"{max(1, round(width * scale))}x{max(1, round(height * scale))}"


def own_scenes(options):
    """Scenes of this project."""
    for path in OWN:
        name = os.path.splitext(os.path.basename(path))[0]
        if not options.names or name in options.names:
            yield Scene(name, os.path.join(ROOT, "scenes", path), options.pixels)


def others_scenes(options, work):
    """Scenes of others, converted as they are."""
    for name in sorted(os.listdir(options.scenes)) if options.scenes else []:
        folder = os.path.join(options.scenes, name)
        source, picture = os.path.join(folder, "scene.xml"), os.path.join(folder, "reference.exr")
        if not os.path.exists(source) or (options.names and name not in options.names):
            continue
        document = os.path.join(work, name, "scene.json")
        os.makedirs(os.path.dirname(document))
        run(options.karst, "convert", source, "-o", document, "--strict")
        error, about = 0.0, os.path.join(folder, "reference.json")
        if os.path.exists(about):
            with open(about, encoding="utf-8") as file:
                error = math.sqrt(max(0.0, json.load(file).get("relmse_of_reference") or 0.0))
        yield Scene(name, document, options.pixels, picture if os.path.exists(picture) else None, error)


def render(scene, asked, seed, work, options):
    """One picture: its file and its report."""
    out, report = os.path.join(work, f"{seed}.exr"), os.path.join(work, f"{seed}.json")
    run(options.karst, "render", scene.document, *asked, "--seed", seed, "--threads", options.threads, "--size", scene.size,
        "-o", out, "--report", report)
    with open(report, encoding="utf-8") as file:
        found = json.load(file)
    return out, found[0] if isinstance(found, list) else found


def compare(picture, reference, options, *more):
    """What `karst compare` says."""
    return json.loads(run(options.karst, "compare", picture, reference, "--json", *more))


def measure(scene, asked, work, options):
    """One row: a scene at one sample count or target."""
    (first, one), (second, two) = [render(scene, asked, seed, work, options) for seed in (1, 2)]
    noise = compare(first, scene.weight, options, "--repeat", second, "--reference-error", "1e-9")["rel_mse_expected"]
    mean = lambda key: (one[key] + two[key]) / 2
    row = {
        "scene": scene.name, "size": scene.size, "asked": " ".join(asked).lstrip("-"), "spp": mean("spp_mean"),
        "seconds": mean("render_seconds"), "msamples_per_second": mean("samples") / mean("render_seconds") * 1e-6,
        "mrays_per_second": mean("rays") / mean("render_seconds") * 1e-6, "rel_mse_reported": mean("rel_mse"),
        "rel_mse_of_two": noise, "efficiency": 1 / (noise * mean("render_seconds")) if noise > 0 else None,
        "peak_bytes": max(one["peak_rss_bytes"], two["peak_rss_bytes"]), "rel_mse_to_reference": None, "bias": None,
    }
    if scene.reference:
        found = compare(first, scene.reference, options, "--reference-error", str(scene.reference_error))
        row["rel_mse_to_reference"] = max(0.0, found["rel_mse_corrected"])
        row["bias"] = [found["mean_rel_diff"], found["mean_rel_diff_stderr"]]
    return row


def line(row):
    """A row of the table."""
    percent = lambda value: "" if value is None else f"{100 * math.sqrt(value):.2f} %"
    efficiency = "" if row["efficiency"] is None else f"{row['efficiency']:.3g}"
    return (
        f"| {row['scene']} | {row['asked']} | {row['spp']:.1f} | {row['seconds']:.2f} | {row['msamples_per_second']:.3f} "
        f"| {row['mrays_per_second']:.2f} | {percent(row['rel_mse_reported'])} | {percent(row['rel_mse_of_two'])} "
        f"| {percent(row['rel_mse_to_reference'])} | {efficiency} | {row['peak_bytes'] / 2**20:.0f} |"
    )


def plot(rows, title):
    """Error over seconds on logarithmic axes, a line a scene, as SVG."""
    shown = [row for row in rows if row["rel_mse_of_two"] > 0]
    if not shown:
        return "<svg xmlns='http://www.w3.org/2000/svg'/>\n"
    names = list(dict.fromkeys(row["scene"] for row in shown))
    points = {
        name: sorted((row["seconds"], 100 * math.sqrt(row["rel_mse_of_two"])) for row in shown if row["scene"] == name)
        for name in names
    }
    everything = [point for line_of in points.values() for point in line_of]
    ranges = [(math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)) + 1e-9)) for values in zip(*everything)]
    width, height, left, top, legend = 620, 440, 70, 40, 190
    place_x = lambda value: left + (math.log10(value) - ranges[0][0]) / (ranges[0][1] - ranges[0][0]) * width
    place_y = lambda value: top + (ranges[1][1] - math.log10(value)) / (ranges[1][1] - ranges[1][0]) * height
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{left + width + legend}' height='{top + height + 50}' "
        "font-family='sans-serif' font-size='12'>", "<rect width='100%' height='100%' fill='white'/>",
        f"<text x='{left}' y='22' font-size='14'>{title}</text>",
    ]
    for power in range(ranges[0][0], ranges[0][1] + 1):
        x = place_x(10.0**power)
        parts.append(f"<path d='M{x:.1f} {top}v{height}' stroke='#ddd'/>"
                     f"<text x='{x:.1f}' y='{top + height + 18}' text-anchor='middle'>{10.0**power:g}</text>")
    for power in range(ranges[1][0], ranges[1][1] + 1):
        y = place_y(10.0**power)
        parts.append(f"<path d='M{left} {y:.1f}h{width}' stroke='#ddd'/>"
                     f"<text x='{left - 8}' y='{y + 4:.1f}' text-anchor='end'>{10.0**power:g} %</text>")
    parts.append(f"<text x='{left + width / 2}' y='{top + height + 38}' text-anchor='middle'>seconds of rendering</text>")
    for number, (name, line_of) in enumerate(points.items()):
        color = COLORS[number % len(COLORS)]
        dashes = "" if number < len(COLORS) else " stroke-dasharray='5 3'"
        path = " ".join(f"{place_x(x):.1f},{place_y(y):.1f}" for x, y in line_of)
        parts.append(f"<polyline points='{path}' fill='none' stroke='{color}' stroke-width='2'{dashes}/>")
        parts.extend(f"<circle cx='{place_x(x):.1f}' cy='{place_y(y):.1f}' r='3' fill='{color}'/>" for x, y in line_of)
        y = top + 10 + 18 * number
        parts.append(f"<path d='M{left + width + 15} {y}h24' stroke='{color}' stroke-width='2'{dashes}/>"
                     f"<text x='{left + width + 45}' y='{y + 4}'>{name}</text>")
    return "\n".join([*parts, "</svg>\n"])


def about(options):
    """What was measured, on what."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        models = [text.split(":", 1)[1].strip() for text in file if text.startswith("model name")]
    commit = subprocess.run(["git", "-C", ROOT, "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    return {
        "date": datetime.date.today().isoformat(), "commit": commit.stdout.strip() or "unknown",
        "processor": models[0] if models else platform.processor(), "cores": os.cpu_count(), "threads": options.threads,
        "command": " ".join([os.path.join("bench", os.path.basename(sys.argv[0])), *(f'"{part}"' if " " in part else part for part in sys.argv[1:])]),
    }


def parse(parser):
    """The options of a program that renders scenes, with those that all of them have."""
    parser.add_argument("--threads", type=int, default=os.cpu_count(), metavar="N", help="threads (all)")
    parser.add_argument("--scenes", default=os.environ.get("KARST_SCENES"), metavar="DIR", help="scenes of others ($KARST_SCENES)")
    parser.add_argument("--bin", default=os.path.join(ROOT, "target", "release"), metavar="DIR", help="where karst is")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (all)")
    options = parser.parse_args()
    options.karst = os.path.join(options.bin, "karst")
    return options


def keep(results, path):
    """Writes all figures, if they are wanted."""
    if path:
        with open(path, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)
            file.write("\n")


def each_scene(head, measure, line, options):
    """A table with a row for each scene, kept after every one."""
    results = {"about": about(options), "rows": []}
    print(head, flush=True)
    with tempfile.TemporaryDirectory() as work:
        for scene in [*own_scenes(options), *others_scenes(options, work)]:
            results["rows"].append(measure(scene, work, options))
            print(line(results["rows"][-1]), flush=True)
            keep(results, options.json)


def write(results, options):
    """All figures, the table and the plot, anew after every row: who stops it half-way has half of it."""
    told, rows = results["about"], results["rows"]
    base = os.path.join(options.out, f"{told['date']}-{told['commit']}")
    title = f"karst {told['commit']}, {told['threads']} threads, {told['processor']}"
    with open(f"{base}.json", "w", encoding="utf-8") as file:
        json.dump(results, file, indent=1)
    with open(f"{base}.md", "w", encoding="utf-8") as file:
        file.write(f"# {title}\n\n{told['date']}, {told['cores']} cores: `{told['command']}`\n\n{HEAD}\n")
        file.writelines(line(row) + "\n" for row in rows)
        file.write(f"\n![error over seconds]({os.path.basename(base)}.svg)\n")
    with open(f"{base}.svg", "w", encoding="utf-8") as file:
        file.write(plot(rows, title))
    return base


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 16, 64], metavar="N", help="samples per pixel (4 16 64)")
    parser.add_argument("--targets", type=float, nargs="*", default=[0.1], metavar="E", help="error targets (0.1)")
    parser.add_argument("--pixels", type=int, default=40000, metavar="N", help="about how many pixels (40000)")
    parser.add_argument("--out", default=os.path.join(ROOT, "bench", "results"), metavar="DIR", help="where results go")
    options = parse(parser)
    os.makedirs(options.out, exist_ok=True)
    results = {"about": about(options), "rows": []}
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as work:
        for scene in [*own_scenes(options), *others_scenes(options, work)]:
            ways = [["--spp", str(spp)] for spp in options.spp] + [["--target-error", str(e)] for e in options.targets]
            scene.weight = scene.weight or render(scene, ["--spp", str(max(options.spp))], 3, work, options)[0]
            for asked in ways:
                results["rows"].append(measure(scene, asked, work, options))
                print(line(results["rows"][-1]), flush=True)
                base = write(results, options)
    if not results["rows"]:
        sys.exit(f"error: no scene of these names: {' '.join(options.names)}")
    print(f"\n{base}.json, .md, .svg", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
