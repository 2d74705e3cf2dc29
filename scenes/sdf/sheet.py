#!/usr/bin/env python3
"""Renders the scenes of this folder and puts them on one labelled sheet; prints how long each took.

    python3 sheet.py [--spp 64] [--denoise off|color|full] [--keep DIR] [NAME…]

Needs Pillow (`pip install pillow`) and a built karst. A scene of a node is one cell of the sheet, the close-ups at its
end are two cells wide. Without names all scenes are rendered.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

try:
    from PIL import Image, ImageDraw, ImageFont
except ImportError:
    sys.exit("error: Pillow is missing\nhint: pip install pillow")

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
NODES = """sphere box rounded_box ellipsoid cylinder cone capsule torus plane mandelbulb julia fbm_noise_sphere
    union intersection difference smooth_union smooth_intersection smooth_difference
    transform twist bend repetition repetition_infinite fbm_noise
    solid_checkerboard solid_fbm orbit_trap""".split()
CLOSE = ["mandelbulb_valley", "mandelbulb_power_4", "julia_close"]


def render(name, work, options):
    """Renders a scene; where its picture is, and the report of the run."""
    picture, report = os.path.join(work, f"{name}.png"), os.path.join(work, f"{name}.report.json")
    command = [os.path.join(options.bin, "karst"), "render", os.path.join(HERE, f"{name}.json"), "-o", picture,
               "--report", report, "--spp", str(options.spp), "--denoise", options.denoise]
    if options.size or name in CLOSE:
        edge = options.size or 2 * options.cell
        command += ["--size", f"{edge}x{edge}"]
    if options.threads:
        command += ["--threads", str(options.threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{name}: {done.stderr.strip()}")
    denoised = os.path.join(work, f"{name}-denoised.png")
    with open(report, encoding="utf-8") as file:
        return denoised if options.denoise != "off" else picture, json.load(file)


def sheet(pictures, cell, columns):
    """The pictures in rows, with their names below; those at the end that are close-ups are two cells wide."""
    label, places, x, y, high = 18, [], 0, 0, 0
    for name, picture in pictures:
        edge = 2 * cell if name in CLOSE else cell
        if x + edge > columns * cell or places and edge != high:
            x, y = 0, y + high + label
        places.append((name, picture, x, y, edge))
        x, high = x + edge, edge
    whole = Image.new("RGB", (columns * cell, y + high + label), (24, 24, 26))
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(12)
    for name, picture, x, y, edge in places:
        with Image.open(picture) as image:
            whole.paste(image.convert("RGB").resize((edge, edge), Image.Resampling.LANCZOS), (x, y))
        draw.text((x + edge / 2, y + edge + label / 2), name, (215, 215, 210), font, anchor="mm")
    # 256 colours keep the file small: the best ones for this picture, and what they miss goes to the neighbours.
    colours = whole.quantize(256, Image.Quantize.MEDIANCUT, kmeans=8)
    return whole.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel (64)")
    parser.add_argument("--denoise", choices=["off", "color", "full"], default="off", help="as karst has it (off)")
    parser.add_argument("--size", type=int, metavar="N", help="render N by N pixels (what the scene says)")
    parser.add_argument("--threads", type=int, metavar="N", help="threads (all)")
    parser.add_argument("--cell", type=int, default=192, metavar="N", help="edge of a picture on the sheet (192)")
    parser.add_argument("--columns", type=int, default=6, metavar="N", help="pictures in a row (6)")
    parser.add_argument("--bin", default=os.path.join(ROOT, "target", "release"), metavar="DIR", help="where karst is")
    parser.add_argument("--out", default=os.path.join(ROOT, "docs", "images", "sdf-nodes.png"), metavar="PNG",
                        help="where to write the sheet (docs/images/sdf-nodes.png)")
    parser.add_argument("--keep", metavar="DIR", help="keep the pictures and reports here")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (all)")
    options = parser.parse_args()
    names = options.names or NODES + CLOSE
    missing = {file[:-5] for file in os.listdir(HERE) if file.endswith(".json")} ^ set(NODES + CLOSE)
    if missing:
        sys.exit(f"error: {', '.join(sorted(missing))}: a scene without a place on the sheet, or the other way round")
    pictures, rows = [], []
    with tempfile.TemporaryDirectory() as scratch:
        work = options.keep or scratch
        os.makedirs(work, exist_ok=True)
        for i, name in enumerate(names, 1):
            print(f"[{i}/{len(names)}] {name}", file=sys.stderr, flush=True)
            picture, report = render(name, work, options)
            pictures.append((name, picture))
            rows.append((name, report))
        whole = sheet(pictures, options.cell, options.columns)
    os.makedirs(os.path.dirname(os.path.abspath(options.out)), exist_ok=True)
    whole.save(options.out, optimize=True)
    print("| scene | seconds | million samples/s | rays out of steps | non-finite samples |\n|---|---|---|---|---|")
    for name, report in rows:
        print(f"| {name} | {report['render_seconds']:.2f} | {report['msamples_per_second']:.2f} "
              f"| {report['exhausted_rays']} of {report['rays']} | {report['nonfinite_samples']} |")
    print(f"| all | {sum(report['render_seconds'] for _, report in rows):.1f} | | | |")


if __name__ == "__main__":
    main()
