#!/usr/bin/env python3
"""Holds karst's pictures against references that other renderers made.

usage: bench/references.py --scenes DIR [--spp 256] [--seed 0] [--bin DIR] [--keep DIR] [NAME…]

DIR has one folder a scene: scene.xml, reference.exr and reference.json with the reference's own relMSE. Each is
converted as it is and rendered twice, with two seeds; a row of a Markdown table says how far the pooled means lie apart
(in per cent, with the standard error of both pictures together, and their ratio), the relMSE to the reference beside the
sum of the noise of both pictures (that of karst's from the second rendering, the reference's as it is given), and the
mean FLIP. Scenes that are not converted in whole are listed with the reason.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time

HEAD = """| scene | spp | seconds | mean difference | standard errors | relMSE | noise of both | ratio | FLIP |
|---|---|---|---|---|---|---|---|---|"""


def run(*command):
    """What a command prints; its error text is an exception."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout


def own_error(folder):
    """The relMSE that a reference says of itself."""
    with open(os.path.join(folder, "reference.json"), encoding="utf-8") as file:
        about = json.load(file)
    return about.get("relmse_of_reference", about.get("ref_relmse"))


def row(name, folder, work, options):
    """The row of a scene."""
    karst = os.path.join(options.bin, "karst")
    document, picture, repeat = (os.path.join(work, f"{name}{end}") for end in ("/scene.json", ".exr", "-repeat.exr"))
    os.makedirs(os.path.dirname(document), exist_ok=True)
    run(karst, "convert", os.path.join(folder, "scene.xml"), "-o", document, "--strict")
    begin = time.monotonic()
    run(karst, "render", document, "--spp", options.spp, "--seed", options.seed, "-o", picture)
    seconds = time.monotonic() - begin
    run(karst, "render", document, "--spp", options.spp, "--seed", options.seed + 1, "-o", repeat)
    reference = own_error(folder)
    found = json.loads(
        run(karst, "compare", picture, os.path.join(folder, "reference.exr"), "--json",
            "--repeat", repeat, "--reference-error", math.sqrt(reference))
    )
    difference, error = found["mean_rel_diff"], found["mean_rel_diff_stderr"]
    noise = found["rel_mse_expected"] - reference
    return (
        f"| {name} | {options.spp} | {seconds:.0f} | {100 * difference:+.3f} ± {100 * error:.3f} % "
        f"| {abs(difference) / error:.1f} | {found['rel_mse']:.3e} | {noise:.2e} + {reference:.2e} "
        f"| {found['rel_mse_ratio']:.2f} | {found['flip_mean']:.4f} |"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--scenes", required=True, metavar="DIR", help="folder of the scenes")
    parser.add_argument("--spp", type=int, default=256, help="samples per pixel (256)")
    parser.add_argument("--seed", type=int, default=0, help="seed (0)")
    parser.add_argument("--bin", default=os.path.join(root, "target", "release"), metavar="DIR", help="where karst is")
    parser.add_argument("--keep", metavar="DIR", help="keep documents and pictures here")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (all)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = options.keep or scratch
        print(HEAD, flush=True)
        missing = []
        for name in sorted(options.names or os.listdir(options.scenes)):
            folder = os.path.join(options.scenes, name)
            if not os.path.exists(os.path.join(folder, "scene.xml")):
                continue
            try:
                print(row(name, folder, work, options), flush=True)
            except RuntimeError as error:
                missing.append(f"{name}: {error}")
    for reason in missing:
        print(f"\nnot compared: {reason}")


if __name__ == "__main__":
    sys.exit(main())
