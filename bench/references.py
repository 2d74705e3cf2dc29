#!/usr/bin/env python3
"""Holds karst's pictures against references that other renderers made.

usage: bench/references.py --scenes DIR [--spp 256] [--seed 0] [--threads N] [--bin DIR] [--keep DIR] [NAME…]

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
import sys
import tempfile
import time

from shared import converted, need_folders, parse, reference_error, run

HEAD = """| scene | spp | seconds | mean difference | standard errors | relMSE | noise of both | ratio | FLIP |
|---|---|---|---|---|---|---|---|---|"""


def row(name, folder, work, options):
    """The row of a scene."""
    reference = reference_error(folder)
    if reference is None:
        raise RuntimeError("reference.json does not say the reference's own relMSE")
    document = converted(folder, os.path.join(work, name), options)
    picture, repeat = (os.path.join(work, f"{name}{end}") for end in (".exr", "-repeat.exr"))
    asked = [document, "--spp", options.spp, "--threads", options.threads]
    begin = time.monotonic()
    run(options.karst, "render", *asked, "--seed", options.seed, "-o", picture)
    seconds = time.monotonic() - begin
    run(options.karst, "render", *asked, "--seed", options.seed + 1, "-o", repeat)
    found = json.loads(
        run(options.karst, "compare", picture, os.path.join(folder, "reference.exr"), "--json",
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
    parser.add_argument("--spp", type=int, default=256, metavar="N", help="samples per pixel (256)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed (0)")
    parser.add_argument("--keep", metavar="DIR", help="keep documents and pictures here")
    options = parse(parser)
    folders, missing = need_folders(options), []
    with tempfile.TemporaryDirectory() as scratch:
        print(HEAD, flush=True)
        for name, folder in folders:
            try:
                print(row(name, folder, options.keep or scratch, options), flush=True)
            except RuntimeError as error:
                missing.append(f"{name}: {error}")
    for reason in missing:
        print(f"\nnot compared: {reason}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
