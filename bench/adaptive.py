#!/usr/bin/env python3
"""Adaptive rounds beside the same number of samples everywhere: seconds to the same error.

usage: bench/adaptive.py [--spp 64] [--pairs 10] [--pixels 40000] [--scenes DIR] [--bin DIR] [--json OUT] [NAME…]

Renders each scene of bench/sweep.py by pairs, one picture with --spp samples in all pixels and one with the target error that
the first of those reports, in turn and with a seed for each pair. The error is the variance between seeds, relative to the
mean of all pictures at the exposure of the film. The ratio is that of error times seconds, everywhere over adaptive: above 1
adaptive rounds are the faster way to the same error. Printed are its median with the 95 % interval of the median (errors of all
pairs, seconds of each), what both cost and err by, the spp of adaptive pictures, and by how much their mean differs with its
standard error. Needs numpy and OpenEXR.
"""
import argparse
import json
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import sweep
from race import np, picture

HEAD = ("| scene | seconds | adaptive | error | adaptive | spp | bias | everywhere / adaptive |\n"
        "|---|---|---|---|---|---|---|---|")


def draw(scene, asked, seed, work, options):
    """A picture and its report."""
    out, report = sweep.render(scene, asked, seed, work, options)
    pixels = picture(out)
    os.remove(out)
    return pixels, report


def measure(scene, work, options):
    """The row of a scene."""
    everywhere = ["--spp", str(options.spp)]
    target = draw(scene, everywhere, 1, work, options)[1]["rel_mse"] ** 0.5
    adaptive = ["--target-error", str(target), "--min-spp", str(options.min_spp), "--max-spp", str(options.spp * 64)]
    pairs = [[draw(scene, way, seed + 1, work, options) for way in (everywhere, adaptive)] for seed in range(options.pairs)]
    with open(scene.document, encoding="utf-8") as file:
        scale = 2.0 ** json.load(file)["film"].get("exposure", 0.0)
    pictures = [np.asarray([pair[way][0] for pair in pairs]) * scale for way in (0, 1)]
    weight = 1 / (np.mean(pictures, axis=(0, 1)) ** 2 + 1e-2)
    errors = [float((np.var(of, axis=0, ddof=1) * weight).mean()) for of in pictures]
    seconds = np.asarray([[report["render_seconds"] for _, report in pair] for pair in pairs])
    ratios = np.sort(seconds[:, 0] / seconds[:, 1]) * errors[0] / errors[1]
    means = [of.mean(axis=(1, 2, 3)) for of in pictures]
    difference = (means[1] - means[0]) / means[0].mean()
    # The order statistics that hold the median in 95 of 100 cases, by the normal approximation of the binomial.
    beyond = max(0, int(len(ratios) / 2 - 0.98 * len(ratios) ** 0.5))
    return {
        "scene": scene.name, "size": scene.size, "target": target, "seconds": seconds.tolist(), "rel_mse": errors,
        "spp": float(np.mean([pair[1][1]["spp_mean"] for pair in pairs])), "bias": float(difference.mean()),
        "bias_error": float(difference.std(ddof=1) / len(pairs) ** 0.5), "ratio": float(np.median(ratios)),
        "interval": [float(ratios[beyond]), float(ratios[-1 - beyond])],
    }


def line(row):
    """A row of the table."""
    seconds = np.median(row["seconds"], axis=0)
    errors = [100 * error**0.5 for error in row["rel_mse"]]
    return (f"| {row['scene']} | {seconds[0]:.2f} | {seconds[1]:.2f} | {errors[0]:.2f} % | {errors[1]:.2f} % | {row['spp']:.0f} "
            f"| {100 * row['bias']:+.2f} ± {100 * row['bias_error']:.2f} % "
            f"| **{row['ratio']:.2f}** ({row['interval'][0]:.2f}–{row['interval'][1]:.2f}) |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=64, metavar="N", help="samples per pixel everywhere (64)")
    parser.add_argument("--min-spp", type=int, default=16, metavar="N", help="fewest of adaptive pictures (16)")
    parser.add_argument("--pairs", type=int, default=10, metavar="N", help="pairs of each scene (10)")
    parser.add_argument("--pixels", type=int, default=40000, metavar="N", help="about how many pixels without a reference (40000)")
    parser.add_argument("--json", metavar="OUT", help="write all figures here")
    sweep.each_scene(HEAD, measure, line, sweep.parse(parser))


if __name__ == "__main__":
    main()
