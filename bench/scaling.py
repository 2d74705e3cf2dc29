#!/usr/bin/env python3
"""How time and memory grow with the work: triangles, instances, distance functions, lights, pixels.

usage: bench/scaling.py [--axes NAME,…] [--max-triangles N] [--max-pixels-edge N] [--repeats 3] [--out DIR] [--bin DIR]

Along each axis one number grows tenfold from row to row (pixels fourfold), and nothing else changes:

triangles   of one mesh, a bumpy ball, 10⁴ to 10⁷; the shape and its part of the picture are the same
instances   of such a mesh of 10⁴ triangles, 1 to 1000, the smaller the more they are: they cover the same area
sdf         primitives, 1 to 1000 balls and boxes in one union, likewise
lights      shining triangles, 1 to 10⁴, of the same area and power together, that hang over a floor and look down
pixels      256² to 8192² with two samples each, the ball of 10⁴ triangles

Of --repeats runs, by turns along the axis, seconds are the median, memory is the most and relMSE, which karst reports,
the mean. Loading and building is the whole process without rendering and writing the picture. Memory is the peak of the
process: of the whole run, until the picture was rendered but not yet written, and, of one run more, with a picture of
16² pixels: that of the scene. The latter (for pixels that of the whole run) above the first row, divided by what there
is more of, is what each triangle (instance, …) takes.

Exponents are slopes of least squares of logarithms, over all rows: of seconds over the work, of relMSE over the work,
and of that memory above the first row over work above the first row. `at the end` is the slope between the last two
rows: what is paid once for every scene flattens the first ones. Nothing is denoised. Writes DATE-COMMIT-scaling.json,
.md and .svg into bench/results/, or --out, anew after every axis. Needs numpy for the meshes.
"""
import argparse
import concurrent.futures
import json
import math
import multiprocessing
import os
import shutil
import statistics
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from shared import ROOT, about, finish, publish, run, title, without_folders
from sweep import COLORS

BALL = 10_000
# What a picture of 8192² pixels has to get along with.
MEMORY_LIMIT = 4 << 30
LIMIT_EDGE = 8192
# Runs a command; prints its seconds and its most memory in KiB. The kernel counts for a child what its parent held when it
# started it, so the parent has to be smaller than what is measured: an interpreter without anything.
LAUNCHER = """
import os, sys, time
quiet = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
begin = time.monotonic()
_, status, usage = os.wait4(os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=quiet), 0)
print(time.monotonic() - begin, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status) and f"ended with {os.waitstatus_to_exitcode(status)}")
"""
# Smaller differences of memory are those of the allocator.
MEMORY_NOISE = 1 << 19
FLOOR = {"mesh": "square", "material": "stone", "transform": {"scale": 12}}


# ---- scenes -----------------------------------------------------------------------------------------------


def chance(index, salt):
    """A number from 0 to 1 that only depends on its two arguments (splitmix64)."""
    value = (index * 0x9E3779B97F4A7C15 + salt * 0xD1B54A32D192ED03 + 1) % 2**64
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        value = (value ^ value >> shift) * factor % 2**64
    return (value ^ value >> 31) / 2**64


def spots(count, disc=2.0):
    """Places x, z spread evenly over a disc, and a length that shrinks with their number: neighbours are 1.6 of it apart."""
    gap = disc / math.sqrt(count)
    for index in range(count):
        # Vogel's sunflower; one thing alone stands in the middle.
        radius, angle = (gap * math.sqrt(index + 0.5), index * math.pi * (3 - math.sqrt(5))) if count > 1 else (0.0, 0.0)
        yield index, radius * math.cos(angle), radius * math.sin(angle), gap


def scene(edge, **things):
    """A document: a floor seen from above, under a sky and a sun, and things on it."""
    document = {
        "version": 1,
        "camera": {"type": "perspective", "vfov": 39, "transform": {"look_at": {"eye": [0, 5, 6], "target": [0, 0.7, 0]}}},
        "film": {"width": edge, "height": edge},
        "integrator": {"max_depth": 8},
        "materials": {
            "stone": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]},
            "clay": {"type": "diffuse", "reflectance": [0.7, 0.45, 0.3]},
        },
        "meshes": {"square": {"file": "square.obj"}},
        "instances": {"floor": FLOOR},
        "lights": {
            "sky": {"type": "environment", "radiance": [0.4, 0.45, 0.5]},
            "sun": {"type": "sun", "direction": [-2, -3, -1], "irradiance": [2, 1.9, 1.7], "angular_size": 2},
        },
    }
    for table, entries in things.items():
        document[table] = {**document.get(table, {}), **entries}
    return document


def balls(mesh, count, edge):
    """So many of a mesh, side by side."""
    placed = {
        f"ball{index}": {"mesh": "ball", "material": "clay", "transform": {
            "translate": [x, 0.75 * gap, z], "rotate": [0, 360 * chance(index, 1), 0], "scale": 0.7 * gap}}
        for index, x, z, gap in spots(count)
    }
    return scene(edge, meshes={"square": {"file": "square.obj"}, "ball": {"file": mesh}},
                 instances={"floor": FLOOR, **placed})


def solids(count, edge):
    """So many balls and boxes of various sizes in one union."""
    children = {}
    for index, x, z, gap in spots(count):
        size = gap * (0.45 + 0.3 * chance(index, 1))
        solid = {"type": "sphere", "radius": size} if index % 2 == 0 else {"type": "box", "size": [1.3 * size] * 3}
        children[f"part{index}"] = {"type": "transform", "translate": [x, size * (0.6 + 0.6 * chance(index, 2)), z],
                                    "rotate": [90 * chance(index, 3), 360 * chance(index, 4), 0], "child": solid}
    return scene(edge, sdf_objects={"parts": {"material": "clay", "tree": {"type": "union", "children": children}}})


def lamps(count, edge):
    """So many shining triangles of the same area together, over the floor and some balls."""
    shining = {
        f"lamp{index}": {"mesh": "lamp", "material": "black", "emission": [50, 45, 35], "transform": {
            "translate": [x, 0.4 + 0.8 * chance(index, 1), z], "rotate": [0, 360 * chance(index, 2), 0],
            "scale": 0.1 * gap}}
        for index, x, z, gap in spots(count, 3.0)
    }
    obstacles = {
        f"ball{index}": {"center": [x, 0.3 * gap, z], "radius": 0.3 * gap, "material": "clay"}
        for index, x, z, gap in spots(20, 2.6)
    }
    found = scene(edge, meshes={"square": {"file": "square.obj"}, "lamp": {"file": "lamp.obj"}},
                  instances={"floor": FLOOR, **shining}, spheres=obstacles)
    found["materials"]["black"] = {"type": "diffuse", "reflectance": [0, 0, 0]}
    found["lights"] = {}
    return found


def bumps(u, v):
    """Points and normals of a ball with bumps, over longitude u and latitude v."""
    from sdf_mesh import ball, np
    ray, pitch, height = ball(u, v), 9.0, 0.08
    sine, cosine = np.sin(pitch * ray), np.cos(pitch * ray)
    radius = 1 + height * sine.prod(axis=-1, keepdims=True)
    slope = height * pitch * cosine * np.roll(sine, 1, axis=-1) * np.roll(sine, 2, axis=-1)
    normal = radius * ray - (slope - (slope * ray).sum(axis=-1, keepdims=True) * ray)
    return radius * ray, normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def bumpy_mesh(path, triangles):
    """Writes the bumpy ball; the number of its triangles."""
    from sdf_mesh import write_mesh
    return write_mesh(path, bumps, triangles)


def mesh(folder, triangles):
    """Name of the mesh of about so many triangles, and how many it has."""
    name = f"ball{triangles}.ply"
    # In a process of its own: what this one holds would count as memory of those that it starts.
    fork = multiprocessing.get_context("fork")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=fork) as pool:
        return name, pool.submit(bumpy_mesh, os.path.join(folder, name), triangles).result()


# ---- axes -------------------------------------------------------------------------------------------------


class Case:
    """A row to be measured: how much work, what it is called, the document for it, and the samples per pixel."""

    def __init__(self, work, label, document, spp):
        self.work, self.label, self.document, self.spp = work, label, document, spp
        self.reports, self.scene_bytes = [], None


def powers(limit, base=10, first=1):
    """first, first · base, … up to the limit."""
    while first <= limit:
        yield first
        first *= base


def triangles(folder, options):
    """One mesh, finer and finer."""
    for count in powers(options.max_triangles, first=BALL):
        name, made = mesh(folder, count)
        yield Case(made, f"{made:,}", balls(name, 1, options.edge), options.spp)


def instances(folder, options):
    """One mesh, more and more often."""
    name, made = mesh(folder, BALL)
    for count in powers(options.max_triangles // BALL):
        yield Case(count, f"{count:,} ({count * made:,} triangles)", balls(name, count, options.edge), options.spp)


def sdf(_folder, options):
    """More and more primitives in one union."""
    for count in powers(options.max_primitives):
        yield Case(count, f"{count:,}", solids(count, options.edge), options.spp)


def lights(_folder, options):
    """The same light from more and more lamps."""
    for count in powers(options.max_lights):
        yield Case(count, f"{count:,}", lamps(count, options.edge), options.spp)


def pixels(folder, options):
    """The same picture, larger and larger."""
    name, _ = mesh(folder, BALL)
    for edge in powers(options.max_pixels_edge, base=2, first=min(256, options.max_pixels_edge)):
        yield Case(edge * edge, f"{edge}²", balls(name, 1, edge), 2)


AXES = {"triangles": triangles, "instances": instances, "sdf": sdf, "lights": lights, "pixels": pixels}
EACH = {"triangles": "triangle", "instances": "instance", "sdf": "primitive", "lights": "light", "pixels": "pixel"}


# ---- runs -------------------------------------------------------------------------------------------------


def render(case, folder, seed, options, *asked):
    """Renders once; karst's report with what was measured from outside."""
    document, report = os.path.join(folder, "scene.json"), os.path.join(folder, "report.json")
    with open(document, "w", encoding="utf-8") as file:
        json.dump(case.document, file)
    told = run(sys.executable, "-I", "-S", "-c", LAUNCHER, options.karst, "render", document, "--spp", case.spp,
               "--seed", seed, "--threads", options.threads, "--denoise", "off",
               "-o", os.path.join(folder, "picture.exr"), "--report", report, *asked)
    with open(report, encoding="utf-8") as file:
        found = json.load(file)
    seconds, peak = told.split()
    # The report's own figure ends before the picture is written.
    found["peak_bytes"] = int(peak) * 1024
    found["load_build_seconds"] = float(seconds) - (found["wall_seconds"] - found["stages"]["build"])
    return {key: value for key, value in found.items() if key not in ("objects", "rounds")}


def row(case):
    """The figures of a row."""
    of = lambda key: [report[key] for report in case.reports if report[key] is not None]
    errors, scene_bytes, peak = of("rel_mse"), case.scene_bytes, max(of("peak_bytes"))
    return {
        "work": case.work, "label": case.label, "samples": case.reports[0]["samples"],
        "load_build_seconds": statistics.median(of("load_build_seconds")),
        "build_seconds": statistics.median(stages["build"] for stages in of("stages")),
        "render_seconds": statistics.median(of("render_seconds")),
        "write_seconds": statistics.median(stages["write"] for stages in of("stages")),
        "seconds_per_sample": statistics.median(of("render_seconds")) / case.reports[0]["samples"],
        "rays": statistics.median(of("rays")), "sdf_evaluations": statistics.median(of("sdf_evaluations")),
        "scene_bytes": scene_bytes, "rendered_bytes": max(of("peak_rss_bytes")), "peak_bytes": peak,
        # What is held against the work: a large picture would hide a small scene.
        "grown_bytes": scene_bytes or peak, "rel_mse": statistics.mean(errors) if errors else None, "runs": case.reports,
    }


def measure(axis, folder, options):
    """The rows of an axis, from all runs by turns: a drift of the machine hits all alike. And what went wrong."""
    print(f"{axis}: writing scenes", file=sys.stderr, flush=True)
    cases, missing = list(AXES[axis](folder, options)), []
    turns = [(again, case) for again in range(options.repeats) for case in cases]
    for number, (again, case) in enumerate(turns):
        if case not in cases:
            continue
        begin = time.monotonic()
        try:
            case.reports.append(render(case, folder, 1 + again, options))
            if options.keep:
                shutil.copy(os.path.join(folder, "picture.exr"), os.path.join(options.keep, f"{axis}-{case.work}.exr"))
            if again == 0 and axis != "pixels":
                case.scene_bytes = render(case, folder, 1, options, "--size", "16x16")["peak_bytes"]
        except RuntimeError as error:
            # The others go on: the largest picture may be more than this machine can hold.
            missing.append(f"{axis}, {case.label}: {without_folders(' '.join(str(error).split()))}")
            cases.remove(case)
        print(f"{axis} {case.label}, run {again + 1} of {options.repeats}: {time.monotonic() - begin:.1f} s, "
              f"{len(turns) - number - 1} left of this axis", file=sys.stderr, flush=True)
    return [row(case) for case in cases], missing


# ---- exponents --------------------------------------------------------------------------------------------


def slope(points):
    """Slope of least squares of log y over log x, and between the last two points; None for too few."""
    logs = [(math.log(x), math.log(y)) for x, y in points if x > 0 and y > 0]
    if len(logs) < 2:
        return {"fit": None, "end": None, "points": len(logs)}
    middle = [statistics.mean(values) for values in zip(*logs)]
    over = sum((x - middle[0]) ** 2 for x, _ in logs)
    (x1, y1), (x2, y2) = logs[-2:]
    return {"fit": sum((x - middle[0]) * (y - middle[1]) for x, y in logs) / over, "end": (y2 - y1) / (x2 - x1),
            "points": len(logs)}


def growth(rows):
    """Work and memory above those of the first row, without what is noise."""
    more = [(found["work"] - rows[0]["work"], found["grown_bytes"] - rows[0]["grown_bytes"]) for found in rows[1:]]
    return [point for point in more if point[1] > MEMORY_NOISE]


def exponents(rows):
    """Exponents of an axis."""
    over_work = lambda key: slope([(found["work"], found[key]) for found in rows if found[key]])
    return {
        "load_build": over_work("load_build_seconds"), "render": over_work("render_seconds"),
        "memory": slope(growth(rows)), "rel_mse": over_work("rel_mse"),
    }


# ---- table ------------------------------------------------------------------------------------------------


def line(found, first):
    """A row of a table."""
    mebibytes = lambda value: "" if value is None else f"{value / 2**20:.1f}"
    each = "".join(f"{grown / more:,.0f}" for more, grown in growth([first, found]))
    error = "" if found["rel_mse"] is None else f"{100 * math.sqrt(found['rel_mse']):.2f} %"
    memory = " | ".join(mebibytes(found[key]) for key in ("scene_bytes", "rendered_bytes", "peak_bytes"))
    return (f"| {found['label']} | {found['load_build_seconds']:.3f} | {found['build_seconds']:.3f} "
            f"| {found['render_seconds']:.3f} | {found['write_seconds']:.3f} | {1e6 * found['seconds_per_sample']:.3f} "
            f"| {found['rays'] / found['render_seconds'] * 1e-6:.2f} | {memory} | {each} | {error} |")


def table(axis, rows):
    """The table of an axis."""
    head = (f"| {axis} | load and build s | build s | render s | write s | µs a sample | Mrays/s | scene MiB | rendered MiB "
            f"| peak MiB | bytes per {EACH[axis]} | error |")
    return [head, "|---" * 12 + "|", *(line(found, rows[0]) for found in rows)]


def exponent_line(axis, found):
    """A row of the table of exponents."""
    number = lambda value: "" if value is None else f"{value:.2f}"
    cells = [number(found[key][which]) for key in ("load_build", "render", "memory", "rel_mse") for which in ("fit", "end")]
    return f"| {axis} | {' | '.join(cells)} |"


def against_limit(axes):
    """What the largest picture takes, held against the limit; nothing if pixels were not measured."""
    if not axes.get("pixels"):
        return []
    found = axes["pixels"][-1]
    rendered, peak = found["rendered_bytes"] / 2**30, found["peak_bytes"] / 2**30
    verdict = f"the limit at {LIMIT_EDGE}² is {MEMORY_LIMIT / 2**30:.0f} GiB"
    if found["work"] < LIMIT_EDGE**2:
        verdict += f" (no picture of {LIMIT_EDGE}² was rendered)"
    elif found["peak_bytes"] > MEMORY_LIMIT:
        verdict += ": **exceeded**"
    return [f"A picture of {found['label']} pixels takes {rendered:.2f} GiB while it is rendered and {peak:.2f} GiB while it "
            f"is written; {verdict}.", ""]


def markdown(results, heading, options):
    """Everything as text."""
    told, axes = results["about"], results["axes"]
    parts = [
        f"# {heading}", "", f"{told['date']}, {told['cores']} cores: `{told['command']}`", "",
        f"Pictures have {options.edge}² pixels of {options.spp} samples, those of the axis `pixels` 2 samples; "
        f"seconds are the median of {options.repeats} run{'s' if options.repeats > 1 else ''}, memory is the most.",
        "Memory is the peak of the process: with a picture of 16² pixels (scene), until the picture was rendered, and until "
        "it was written.",
        "Bytes per thing are those of the scene (of the whole process for pixels) above the first row.",
        "The error is the root of the relMSE that karst reports.", "", "## Exponents", "",
        "Slopes of least squares of logarithms over all rows, and between the last two rows (at the end).",
        "Seconds and relMSE are taken over the work; memory (of the scene, of the whole process for pixels) above that of the "
        "first row is taken over the work above that of the first row.",
        "A field is empty where fewer than two rows have half a MiB more than the first one.", "",
        "| axis | load and build | at the end | render | at the end | memory | at the end | relMSE | at the end |",
        "|---" * 9 + "|",
        *(exponent_line(axis, results["exponents"][axis]) for axis in axes), "", *against_limit(axes),
        *(part for text in results["missing"] for part in (f"Not measured: {text}", "")),
    ]
    for axis, rows in axes.items():
        parts += [f"## {axis.capitalize()}", "", *table(axis, rows), ""]
    return parts


# ---- plot -------------------------------------------------------------------------------------------------

PANELS = [
    ("seconds", [("render", "render_seconds", 1.0), ("load and build", "load_build_seconds", 1.0)]),
    ("MiB", [("until written", "peak_bytes", 2.0**-20), ("until rendered", "rendered_bytes", 2.0**-20),
             ("scene", "scene_bytes", 2.0**-20)]),
    ("relMSE", [("", "rel_mse", 1.0)]),
]
WIDTH, HEIGHT = 210, 170


def decades(values):
    """Powers of ten around values, at least one apart; meshes have a little less than 10ⁿ triangles."""
    low, high = math.floor(math.log10(min(values)) + 0.02), math.ceil(math.log10(max(values)) - 1e-9)
    return low, max(high, low + 1)


def grid(x_range, y_range, place):
    """Lines and numbers of a panel."""
    for power in range(x_range[0], x_range[1] + 1):
        x, bottom = place(10.0**power, 10.0 ** y_range[0])
        yield f"<path d='M{x:.1f} {bottom:.1f}v-{HEIGHT}' stroke='#ddd'/>"
        number = f"10{str(power).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
        yield f"<text x='{x:.1f}' y='{bottom + 16:.1f}' text-anchor='middle'>{number}</text>"
    for power in range(y_range[0], y_range[1] + 1):
        left, y = place(10.0 ** x_range[0], 10.0**power)
        yield f"<path d='M{left:.1f} {y:.1f}h{WIDTH}' stroke='#ddd'/>"
        yield f"<text x='{left - 5:.1f}' y='{y + 4:.1f}' text-anchor='end'>{10.0**power:g}</text>"


def panel(series, corner, label):
    """A panel of logarithmic axes at a corner: series are names and points; a dashed line grows with the work."""
    everything = [point for _, points in series for point in points]
    if not everything:
        return []
    (x_range, y_range), (left, top) = [decades(values) for values in zip(*everything)], corner
    place = lambda x, y: (left + (math.log10(x) - x_range[0]) / (x_range[1] - x_range[0]) * WIDTH,
                          top + (y_range[1] - math.log10(y)) / (y_range[1] - y_range[0]) * HEIGHT)
    parts = [*grid(x_range, y_range, place),
             f"<text x='{left + WIDTH}' y='{top - 8}' text-anchor='end'>{label}</text>"]
    x, y = series[0][1][-1]
    back = max(10.0 ** x_range[0], x * 10.0 ** y_range[0] / y)
    ends = [place(x, y), place(back, y * back / x)]
    parts.append("<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}' stroke='#999' stroke-dasharray='4 4'/>".format(*ends[0], *ends[1]))
    for number, (name, points) in enumerate(series):
        color, placed = COLORS[number], [place(*point) for point in points]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)
        parts.append(f"<polyline points='{path}' fill='none' stroke='{color}' stroke-width='2'/>")
        parts.extend(f"<circle cx='{x:.1f}' cy='{y:.1f}' r='3' fill='{color}'/>" for x, y in placed)
        parts.append(f"<text x='{left + 4}' y='{top - 8 - 14 * (len(series) - 1 - number)}' fill='{color}'>{name}</text>")
    return parts


def plot(axes, heading):
    """A column of panels for each axis: seconds, memory and error over the work, as SVG."""
    wide, high = WIDTH + 70, HEIGHT + 85
    size = (wide * len(axes) + 10, 50 + high * len(PANELS))
    parts = [f"<svg xmlns='http://www.w3.org/2000/svg' width='{size[0]}' height='{size[1]}' font-family='sans-serif' "
             "font-size='11'>", "<rect width='100%' height='100%' fill='white'/>",
             f"<text x='20' y='24' font-size='14'>{heading} (dashed: proportional to the work)</text>"]
    for column, (axis, rows) in enumerate(axes.items()):
        for number, (label, keys) in enumerate(PANELS):
            series = [(name, [(found["work"], factor * found[key]) for found in rows if found[key]])
                      for name, key, factor in keys]
            parts += panel([one for one in series if one[1]], (55 + column * wide, 90 + number * high), f"{axis}: {label}")
    return "\n".join([*parts, "</svg>\n"])


# ---- program ----------------------------------------------------------------------------------------------


def write(results, options):
    """All figures, the tables and the plot."""
    told = results["about"]
    heading = f"Growing work: {title(told)}"
    base = os.path.join(options.out, f"{told['date']}-{told['commit']}-scaling")
    publish(base, results, "\n".join(markdown(results, heading, options)), ("Time and memory by work", plot(results["axes"], heading)))
    return base


def parse():
    """The options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = ",".join(AXES)
    parser.add_argument("--axes", default=names, metavar="NAME,…", help=f"which axes ({names})")
    parser.add_argument("--max-triangles", type=int, default=10**7, metavar="N", help="of the largest scene (10000000)")
    parser.add_argument("--max-primitives", type=int, default=1000, metavar="N", help="of distance functions (1000)")
    parser.add_argument("--max-lights", type=int, default=10**4, metavar="N", help="lights (10000)")
    parser.add_argument("--max-pixels-edge", type=int, default=LIMIT_EDGE, metavar="N", help="of the largest picture (8192)")
    parser.add_argument("--edge", type=int, default=512, metavar="N", help="width and height of the other pictures (512)")
    parser.add_argument("--spp", type=int, default=16, metavar="N", help="samples per pixel of the other pictures (16)")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="runs of each (3)")
    parser.add_argument("--threads", type=int, default=2, metavar="N", help="threads (2)")
    parser.add_argument("--out", default=os.path.join(ROOT, "bench", "results"), metavar="DIR", help="where results go")
    parser.add_argument("--bin", default=os.path.join(ROOT, "target", "release"), metavar="DIR", help="where karst is")
    parser.add_argument("--keep", metavar="DIR", help="keep the pictures here")
    options = finish(parser)
    options.axes = options.axes.split(",")
    unknown = [name for name in options.axes if name not in AXES]
    if unknown:
        parser.error(f"--axes: found {', '.join(unknown)}, expected {names}")
    for name, least in (("max_triangles", BALL), ("max_primitives", 1), ("max_lights", 1), ("max_pixels_edge", 1),
                        ("edge", 1), ("spp", 1), ("repeats", 1), ("threads", 1)):
        if getattr(options, name) < least:
            parser.error(f"--{name.replace('_', '-')}: found {getattr(options, name)}, expected at least {least}")
    return options


def shared_files(folder):
    """Writes the meshes that all scenes use: the floor, and a lamp of area 2 whose front looks down."""
    shutil.copy(os.path.join(ROOT, "scenes", "meshes", "square.obj"), folder)
    with open(os.path.join(folder, "lamp.obj"), "w", encoding="utf-8") as file:
        file.write("v -1 0 -1\nv 1 0 -1\nv 0 0 1\nf 1 2 3\n")


def main():
    options = parse()
    for folder in filter(None, (options.out, options.keep)):
        os.makedirs(folder, exist_ok=True)
    results = {"about": about(options), "axes": {}, "exponents": {}, "missing": []}
    base = ""
    for number, axis in enumerate(options.axes):
        print(f"axis {number + 1} of {len(options.axes)}", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as folder:
            shared_files(folder)
            rows, missing = measure(axis, folder, options)
        results["missing"] += missing
        if not rows:
            continue
        results["axes"][axis], results["exponents"][axis] = rows, exponents(rows)
        print("\n".join([*table(axis, rows), ""]), flush=True)
        base = write(results, options)
    if not base:
        sys.exit("error: nothing was measured: " + "; ".join(results["missing"]))
    print("\n".join([*results["missing"], f"{base}.json, .md, .svg"]), file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
