#!/usr/bin/env python3
"""Speed against error of karst itself: scenes at several sample counts and error targets.

usage: bench/sweep.py [--spp 4 16 64] [--targets 0.1] [--pixels 40000] [--scenes DIR] [--out DIR] [--bin DIR] [NAME…]
                      [--peers [--peer NAME[:SAMPLER][@SPP]]… [--peers-folder DIR] [--peers-python PYTHON]
                      [--cycles-python PYTHON] [--race-spp 64] [--seeds 4]]

Scenes are those of scenes/ that stand for a kind of work each, and with --scenes DIR those of a folder with one folder a
scene: scene.xml, reference.exr and reference.json. Each is rendered twice, with other seeds, at a size of about --pixels
pixels (those with a reference at its size), by --threads threads. The error is the root of the relMSE,
mean((a-b)² / (b²+0.01)), by three ways: what karst reports, what its two pictures differ by (over √2), and what one
differs from the reference by, without the error of that one. Without a reference errors are relative to a third picture, of
the most samples. Efficiency is 1 / (relMSE · seconds) by the two pictures. Seconds are of rendering alone, the
mean of both. Writes DATE-COMMIT.json, .md and .svg into bench/results/, or --out.

With --peers the scenes of DIR are then raced against other renderers: bench/race.py, run by the Python of --peers-python, whose
results go to the same place.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

import peers
from shared import ROOT, about, converted, folders, keep, parse, publish, reference_error, run, title

OWN = [
    "cornell.json", "demo/demo.json", "cave/cave.json", "sdf/smooth_union.json", "sdf/fbm_noise.json",
    "sdf/mandelbulb_valley.json",
]
HEAD = """| scene | asked | spp | seconds | Msamples/s | Mrays/s | error reported | of two | to reference | efficiency | MiB |
|---|---|---|---|---|---|---|---|---|---|---|"""
COLORS = ["#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb", "#000000"]


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
    for name, folder in folders(options):
        document, picture = converted(folder, os.path.join(work, name), options), os.path.join(folder, "reference.exr")
        error = math.sqrt(max(0.0, reference_error(folder) or 0.0))
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


def plot(rows, heading):
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
        f"<text x='{left}' y='22' font-size='14'>{heading}</text>",
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
    text = [f"# {title(told)}", "", f"{told['date']}, {told['cores']} cores: `{told['command']}`", "", HEAD, *map(line, rows)]
    base = os.path.join(options.out, f"{told['date']}-{told['commit']}")
    publish(base, results, "\n".join(text), ("error over seconds", plot(rows, title(told))))
    return base


def sweep(options):
    """All rows of all scenes."""
    results, base = {"about": about(options), "rows": []}, None
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as work:
        for scene in [*own_scenes(options), *others_scenes(options, work)]:
            ways = [["--spp", str(spp)] for spp in options.spp] + [["--target-error", str(e)] for e in options.targets]
            scene.weight = scene.weight or render(scene, ["--spp", str(max(options.spp))], 3, work, options)[0]
            for asked in ways:
                results["rows"].append(measure(scene, asked, work, options))
                print(line(results["rows"][-1]), flush=True)
                base = write(results, options)
    if base is None:
        sys.exit(f"error: no scene of these names: {' '.join(options.names)}")
    print(f"\n{base}.json, .md, .svg", file=sys.stderr)


def race(options):
    """The scenes of others, raced by race.py in a Python that has what it needs; its status."""
    names = [name for name, _ in folders(options)]
    if not names:
        print("no race: only scenes of --scenes can be raced", file=sys.stderr)
        return 0
    program = os.path.join(ROOT, "bench", "race.py")
    command = [options.peers_python, program, "--scenes", options.scenes, "--spp", options.race_spp, "--seeds", options.seeds,
               "--threads", options.threads, "--bin", options.bin, "--out", options.out, "--patience", options.patience,
               "--peers-folder", options.peers_folder, "--peers-python", options.peers_python]
    if options.cycles_python:
        command += ["--cycles-python", options.cycles_python]
    for peer in options.peer:
        command += ["--peer", peer]
    print(flush=True)
    return subprocess.run([str(part) for part in [*command, *(names if options.names else [])]], check=False).returncode


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 16, 64], metavar="N", help="samples per pixel (4 16 64)")
    parser.add_argument("--targets", type=float, nargs="*", default=[0.1], metavar="E", help="error targets (0.1)")
    parser.add_argument("--pixels", type=int, default=40000, metavar="N", help="about how many pixels (40000)")
    parser.add_argument("--out", default=os.path.join(ROOT, "bench", "results"), metavar="DIR", help="where results go")
    parser.add_argument("--peers", action="store_true", help="then race scenes of --scenes against other renderers")
    parser.add_argument("--race-spp", type=int, default=64, metavar="N", help="samples per pixel of the race (64)")
    parser.add_argument("--seeds", type=int, default=4, metavar="N", help="pictures of each program in the race (4)")
    peers.add_options(parser)
    options = parse(parser)
    os.makedirs(options.out, exist_ok=True)
    if options.peers:
        if not options.scenes:
            parser.error("--peers: needs scenes that others can render\nhint: --scenes DIR, or KARST_SCENES in the environment")
        # Now rather than after the sweep.
        peers.check(peers.resolve(options, options.race_spp), options)
    sweep(options)
    return race(options) if options.peers else 0


if __name__ == "__main__":
    sys.exit(main())
