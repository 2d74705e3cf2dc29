#!/usr/bin/env python3
"""Speed against error, scene by scene, beside other renderers.

usage: bench/race.py --scenes DIR [--spp 64] [--seeds 4] [--json OUT] [--bin DIR]
                     [--peers PROGRAM [--peers-python PYTHON] [--peer NAME[:SAMPLER]]…] [NAME…]

DIR has one folder a scene: scene.xml, which karst converts as it is, and reference.exr. Every program renders every scene
with several seeds on two threads. The error is the variance between seeds, relative to the picture:
relvar = mean(var / (d² + 0.01)) over pixels and channels, d the denoised reference; efficiency = 1 / (relvar · seconds),
also without the 0.1 % of pixels that vary most. Seconds are the median of rendering alone: loading and compiling are left
out for all. Runs of karst lie between those of the others, so that drift of the machine hits all alike. Bias is looked at
apart: the difference of pooled means to the reference, with its standard error from tiles of the picture.

PROGRAM is called as `PYTHON PROGRAM FOLDER --peers NAME --sampler SAMPLER --spp N --seeds N --json FILE`, writes for each
peer `results` with `seconds` there, and its pictures as arrays SPP_SEED into
$BASELINE_RAW/baseline_raw/SCENE/NAME_SAMPLER.npz. Needs numpy and OpenEXR; with pyoidn the reference is denoised.
"""
import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile

try:
    import numpy as np
    import OpenEXR
except ImportError as missing:
    sys.exit(f"error: {missing}\nhint: pip install numpy OpenEXR pyoidn")

PEERS = ["mitsuba-scalar:independent", "mitsuba-scalar:multijitter", "mitsuba-llvm:independent", "mitsuba-llvm:multijitter"]
HEAD = """| scene | program | seconds | Msamples/s | relvar | without 0.1 % | efficiency | without 0.1 % |
|---|---|---|---|---|---|---|---|"""


def run(*command, **settings):
    """What a command prints; its error text is an exception."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, **settings)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout


def picture(path):
    """The colours of an EXR."""
    with OpenEXR.File(path) as file:
        channels = file.channels()
        for name in ("RGB", "RGBA"):
            if name in channels:
                return channels[name].pixels[..., :3].astype(np.float64)
        return np.stack([channels[name].pixels for name in "RGB"], axis=2).astype(np.float64)


def weights(reference):
    """What squared errors are multiplied with."""
    try:
        import pyoidn
        reference = pyoidn.denoise(np.ascontiguousarray(reference, dtype=np.float32), hdr=True).astype(np.float64)
    except ImportError:
        pass
    return 1 / (reference**2 + 1e-2)


class Runs:
    """Pictures and seconds of one program on one scene."""

    def __init__(self, program):
        self.program, self.pictures, self.seconds = program, [], []

    def result(self, weight, spp):
        """The figures of a row."""
        variance = (np.var(self.pictures, axis=0, ddof=1) * weight).mean(axis=2).ravel()
        kept = np.sort(variance)[: int(0.999 * len(variance))]
        seconds = statistics.median(self.seconds)
        found = {"relvar": float(variance.mean()), "relvar_trimmed": float(kept.mean()), "seconds": seconds}
        return {
            "program": self.program, **found, "seconds_all": self.seconds, "msamples": len(variance) * spp / seconds * 1e-6,
            "efficiency": 1 / (found["relvar"] * seconds), "efficiency_trimmed": 1 / (found["relvar_trimmed"] * seconds),
        }

    def bias(self, reference):
        """Difference of the pooled mean to the reference, in parts of it, and its standard error from 64 tiles."""
        difference = np.mean(self.pictures, axis=0) - reference
        rows = np.array_split(np.arange(difference.shape[0]), 8)
        columns = np.array_split(np.arange(difference.shape[1]), 8)
        tiles = [difference[np.ix_(row, column)].mean() for row in rows for column in columns]
        return float(np.mean(tiles) / reference.mean()), float(np.std(tiles, ddof=1) / 8 / reference.mean())


def rendering(report):
    """Seconds of rendering in a report: of the one frame."""
    return (report[0] if isinstance(report, list) else report)["render_seconds"]


def render(runs, document, work, options):
    """One more picture by karst."""
    seed = len(runs.seconds)
    out, report = os.path.join(work, f"{seed}.exr"), os.path.join(work, "report.json")
    run(os.path.join(options.bin, "karst"), "render", document, "--spp", options.spp, "--seed", 100 + seed, "--threads", 2,
        "-o", out, "--report", report)
    with open(report, encoding="utf-8") as file:
        runs.seconds.append(rendering(json.load(file)))
    runs.pictures.append(picture(out))


def ask(peer, folder, work, options):
    """All pictures of another renderer."""
    name, _, sampler = peer.partition(":")
    sampler = sampler or "independent"
    out = os.path.join(work, f"{name}-{sampler}.json")
    run(options.peers_python, options.peers, folder, "--peers", name, "--sampler", sampler, "--spp", options.spp,
        "--seeds", options.seeds, "--json", out, env={**os.environ, "BASELINE_RAW": work})
    with open(out, encoding="utf-8") as file:
        found = json.load(file)[0]
    if "error" in found:
        raise RuntimeError(f"{peer}: {found['error']}")
    runs = Runs(peer)
    runs.seconds = found["results"][0]["seconds_all"]
    raw = os.path.join(work, "baseline_raw", os.path.basename(os.path.abspath(folder)), f"{name}_{sampler}.npz")
    with np.load(raw) as arrays:
        runs.pictures = [arrays[key].astype(np.float64) for key in arrays.files if key != "meta"]
    return runs


def race(name, folder, work, options):
    """All programs on one scene; karst's runs between those of the others."""
    os.makedirs(work, exist_ok=True)
    document = os.path.join(work, "scene.json")
    run(os.path.join(options.bin, "karst"), "convert", os.path.join(folder, "scene.xml"), "-o", document, "--strict")
    own, others, missing = Runs("karst"), [], []
    for peer in options.peer if options.peers else []:
        if len(own.seconds) < options.seeds:
            render(own, document, work, options)
        try:
            others.append(ask(peer, folder, work, options))
        except RuntimeError as error:
            missing.append(str(error))
    while len(own.seconds) < options.seeds:
        render(own, document, work, options)
    reference = picture(os.path.join(folder, "reference.exr"))
    weight = weights(reference)
    difference, error = own.bias(reference)
    rows = [runs.result(weight, options.spp) for runs in [own, *others]]
    return {"scene": name, "spp": options.spp, "rows": rows, "bias": difference, "bias_error": error, "missing": missing}


def ratio(found, key):
    """karst over the best of the others."""
    own, others = found["rows"][0], found["rows"][1:]
    return own[key] / max(row[key] for row in others) if others else None


def show(found):
    """Prints the rows of a scene."""
    for row in found["rows"]:
        print(
            f"| {found['scene']} | {row['program']} | {row['seconds']:.2f} | {row['msamples']:.3f} | {row['relvar']:.3e} "
            f"| {row['relvar_trimmed']:.3e} | {row['efficiency']:.3g} | {row['efficiency_trimmed']:.3g} |"
        )
    against = ratio(found, "efficiency")
    if against:
        print(f"| {found['scene']} | **karst over the best** | | | | | **{against:.2f}** "
              f"| **{ratio(found, 'efficiency_trimmed'):.2f}** |")
    sys.stdout.flush()


def about(options):
    """What was measured, on what."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        models = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    commit = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    return {
        "commit": commit.stdout.strip(), "processor": models[0] if models else platform.processor(), "cores": os.cpu_count(),
        "spp": options.spp, "seeds": options.seeds, "threads": 2,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--scenes", required=True, metavar="DIR", help="folder of the scenes")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel (64)")
    parser.add_argument("--seeds", type=int, default=4, help="pictures of each program (4)")
    parser.add_argument("--bin", default=os.path.join(root, "target", "release"), metavar="DIR", help="where karst is")
    parser.add_argument("--json", metavar="OUT", help="write all figures here")
    parser.add_argument("--peers", metavar="PROGRAM", help="program that renders with others")
    parser.add_argument("--peers-python", default=sys.executable, metavar="PYTHON", help="what runs it")
    parser.add_argument("--peer", action="append", metavar="NAME[:SAMPLER]", help="which others")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (all)")
    options = parser.parse_args()
    options.peer = options.peer or PEERS
    results = {"about": about(options), "scenes": []}
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name in sorted(options.names or os.listdir(options.scenes)):
            folder = os.path.join(options.scenes, name)
            if not os.path.exists(os.path.join(folder, "scene.xml")):
                continue
            found = race(name, folder, os.path.join(scratch, name), options)
            show(found)
            results["scenes"].append(found)
            if options.json:
                with open(options.json, "w", encoding="utf-8") as file:
                    json.dump(results, file, indent=1)
    for found in results["scenes"]:
        print(f"\n{found['scene']}: pooled mean {100 * found['bias']:+.3f} ± {100 * found['bias_error']:.3f} % from the reference")
        for reason in found["missing"]:
            print(f"not rendered: {reason}")


if __name__ == "__main__":
    sys.exit(main())
