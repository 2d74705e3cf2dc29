#!/usr/bin/env python3
"""What features cost a scene that uses none of them: karst beside a build of it that knows no others.

usage: bench/plain.py [--spp 256] [--size 192x144] [--pairs 12] [--json OUT] [--threads N] [--bin DIR]

Builds karst a second time with `--cfg karst_plain`, in which media, holes, distance functions and the two kinds of lights side
by side are not there (`PLAIN` in core/src/scene), into target/plain; that takes some minutes. Renders scenes/cornell.json
without its distance functions with both in turn: the pictures must be the same bytes. Printed is the median of karst's seconds over the plain build's, with the 95 %
interval of the median; 1.00 is what a scene should pay for what it does not use.
"""
import argparse
import filecmp
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from shared import ROOT, about, common_options, finish, keep, run, title


def build():
    """The program that knows plain scenes only."""
    with open(os.path.join(ROOT, ".cargo", "config.toml"), "rb") as file:
        flags = tomllib.load(file)["build"]["rustflags"]
    target = os.path.join(ROOT, "target", "plain")
    command = ["cargo", "build", "--release", "--locked", "--package", "karst-client", "--target-dir", target]
    environment = {**os.environ, "RUSTFLAGS": " ".join([*flags, "--cfg", "karst_plain"])}
    if subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode != 0:
        sys.exit("error: the plain build failed")
    return os.path.join(target, "release", "karst")


def plain_scene(work):
    """The Cornell box without what is not plain."""
    with open(os.path.join(ROOT, "scenes", "cornell.json"), encoding="utf-8") as file:
        document = json.load(file)
    document.pop("sdf_objects")
    shutil.copytree(os.path.join(ROOT, "scenes", "meshes"), os.path.join(work, "meshes"))
    path = os.path.join(work, "plain.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(document, file)
    return path


def seconds(program, scene, picture, options):
    """Seconds that a program renders for."""
    report = f"{picture}.json"
    run(program, "render", scene, "--spp", options.spp, "--size", options.size,
        "--threads", options.threads, "--output", picture, "--report", report)
    with open(report, encoding="utf-8") as file:
        return json.load(file)["render_seconds"]


def compare(programs, options):
    """Seconds of both programs, pair by pair; the first to render changes from pair to pair."""
    pairs = []
    with tempfile.TemporaryDirectory() as work:
        scene = plain_scene(work)
        pictures = [os.path.join(work, f"{number}.exr") for number in (0, 1)]
        for pair in range(options.pairs):
            order = (0, 1) if pair % 2 == 0 else (1, 0)
            took = {number: seconds(programs[number], scene, pictures[number], options) for number in order}
            pairs.append([took[0], took[1]])
            print(f"pair {pair + 1} of {options.pairs}: {took[0]:.3f} s, plain {took[1]:.3f} s", file=sys.stderr)
        if not filecmp.cmp(*pictures, shallow=False):
            sys.exit("error: the plain build renders another picture")
    return pairs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=256, metavar="N", help="samples per pixel (256)")
    parser.add_argument("--size", default="192x144", metavar="WxH", help="size of the picture (192x144)")
    parser.add_argument("--pairs", type=int, default=12, metavar="N", help="pairs of pictures (12)")
    parser.add_argument("--json", metavar="OUT", help="write all figures here")
    common_options(parser)
    options = finish(parser)
    pairs = compare([options.karst, build()], options)
    ratios = sorted(whole / plain for whole, plain in pairs)
    # The order statistics that hold the median in 95 of 100 cases, by the normal approximation of the binomial.
    beyond = max(0, int(len(ratios) / 2 - 0.98 * len(ratios) ** 0.5))
    middle = (ratios[(len(ratios) - 1) // 2] + ratios[len(ratios) // 2]) / 2
    told = about(options)
    print(f"{title(told)}: {middle:.3f} ({ratios[beyond]:.3f} to {ratios[-1 - beyond]:.3f}) times the plain build's seconds")
    keep({"about": told, "seconds": pairs, "ratio": middle, "interval": [ratios[beyond], ratios[-1 - beyond]]}, options.json)


if __name__ == "__main__":
    main()
