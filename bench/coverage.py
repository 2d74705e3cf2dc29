#!/usr/bin/env python3
"""How often the 95 % interval of the reported error holds the true one.

usage: bench/coverage.py [--spp 32] [--seeds 64] [--truth 8192] [--pixels 3000] [--scenes DIR] [--bin DIR] [--json OUT] [NAME…]

Renders each scene of bench/sweep.py with many seeds at about --pixels pixels. The true error of a picture is its relMSE,
mean((a-b)² / (b²+0.01)) at the exposure of the film, against the mean b of all other pictures and of one more of --truth samples
per pixel, less what that mean is itself off; an interval of that
picture's report holds it or does not. A good interval holds 90 to 98 % of them. Prints for each scene that share, where the
others lie, the median of reported over true error, and how much of all error the worst of a hundred pixels have: the more,
the less one picture can know of its error. Needs numpy and OpenEXR.
"""
import argparse
import json
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import sweep
from race import np, picture

HEAD = "| scene | held | true is above | true is below | reported / true | worst 1 % of pixels |\n|---|---|---|---|---|---|"


def shrink(scene, pixels):
    """Gives a scene a size of about so many pixels."""
    width, height = (int(part) for part in scene.size.split("x"))
    scale = min(1.0, (pixels / (width * height)) ** 0.5)
    scene.size = f"{max(8, round(width * scale))}x{max(8, round(height * scale))}"


def measure(scene, work, options):
    """The row of a scene."""
    shrink(scene, options.pixels)
    pictures, reports = [], []
    for seed in range(options.seeds + 1):
        asked = ["--spp", str(options.spp if seed < options.seeds else options.truth)]
        out, report = sweep.render(scene, asked, seed + 1, work, options)
        pictures.append(picture(out))
        reports.append(report)
        os.remove(out)
    reports.pop()
    # A dark scene is judged as it will be shown: by what the exposure makes of it.
    with open(scene.document, encoding="utf-8") as file:
        pictures = np.asarray(pictures) * 2.0 ** json.load(file)["film"].get("exposure", 0.0)
    more, count = options.truth / options.spp, options.seeds
    total = np.sum(pictures[:-1], axis=0) + pictures[-1] * more
    variance = np.var(pictures[:-1], axis=0, ddof=1)
    truths, worst = [], []
    for own in pictures[:-1]:
        others = (total - own) / (count - 1 + more)
        squares = ((own - others) ** 2 - variance / (count - 1 + more)) / (others**2 + 1e-2)
        truths.append(float(squares.mean()))
        of_pixels = np.sort(squares.mean(axis=2).ravel())
        worst.append(of_pixels[-max(1, len(of_pixels) // 100):].sum() / of_pixels.sum())
    limits = [report["rel_mse_ci95"] for report in reports]
    above = sum(truth > high for truth, (_, high) in zip(truths, limits))
    below = sum(truth < low for truth, (low, _) in zip(truths, limits))
    ratios = [report["rel_mse"] / truth for report, truth in zip(reports, truths)]
    return {
        "scene": scene.name, "size": scene.size, "spp": options.spp, "seeds": count, "held": 1 - (above + below) / count,
        "above": above / count, "below": below / count, "reported_over_true": float(np.median(ratios)),
        "worst_pixels": float(np.median(worst)), "true": truths, "reported": [report["rel_mse"] for report in reports], "intervals": limits,
    }


def line(row):
    """A row of the table."""
    return (f"| {row['scene']} | {100 * row['held']:.0f} % | {100 * row['above']:.0f} % | {100 * row['below']:.0f} % "
            f"| {row['reported_over_true']:.2f} | {100 * row['worst_pixels']:.0f} % |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=32, metavar="N", help="samples per pixel (32)")
    parser.add_argument("--seeds", type=int, default=64, metavar="N", help="pictures of each scene (64)")
    parser.add_argument("--truth", type=int, default=8192, metavar="N", help="samples per pixel of the truth (8192)")
    parser.add_argument("--pixels", type=int, default=3000, metavar="N", help="about how many pixels (3000)")
    parser.add_argument("--json", metavar="OUT", help="write all figures here")
    sweep.each_scene(HEAD, measure, line, sweep.parse(parser))


if __name__ == "__main__":
    main()
