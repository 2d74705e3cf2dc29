"""What a race comes to: rows and tables in Markdown, ratios beside the marks that they are held against, and a plot."""
import math

from bars import Bar, bars
from shared import title

HEAD = ("| scene | program | spp | seconds | Msamples/s | relVar | without 0.1 % | efficiency | without 0.1 % | bias "
        "| karst over it |\n|---|---|---|---|---|---|---|---|---|---|---|")
RATIOS_HEAD = """| scene | kind | over the best of Mitsuba | without 0.1 % | which | over Cycles | without 0.1 % |
|---|---|---|---|---|---|---|"""
MARKS_HEAD = """| karst over | of | scenes | ratio | without 0.1 % | asked | met |
|---|---|---|---|---|---|---|"""

# What is asked of the efficiency.
MEAN_ASKED, LEAST_ASKED, CYCLES_ASKED = 2.0, 1.1, 3.0
COLORS = {"surfaces": "#4477aa", "fog": "#228833", "cycles": "#ccbb44"}

LEGEND = """Efficiency is 1 / (relVar × seconds), relVar the variance between {seeds} seeds relative to the {denoised}reference, \
mean(var / (d² + 0.01)). Seconds are the median of rendering alone, until the picture is in memory: no loading, no building of \
trees, no compiling, no writing. Programs took turns, a seed after the other. Bias is the pooled mean against the reference, in \
standard errors (SE).
"""
CYCLES_LEGEND = """
† Cycles renders its own version of the scene: its error is the variance between its own seeds relative to the denoised mean of \
its own pictures, and how far its mean lies from the reference is no bias. Its seconds are those of a picture less those of \
one at 1 sample per pixel. Fixed samples, no clamping, no denoising, no adaptive sampling, no guiding.
"""


def ratios(rows):
    """karst over the best row of Mitsuba, and over Cycles, where they are."""
    mitsuba = [row for row in rows if row["program"].startswith("mitsuba")]
    cycles = next((row for row in rows if row["program"] == "cycles"), None)
    found = {"over_mitsuba": None, "over_cycles": None}
    if mitsuba:
        best = min(mitsuba, key=lambda row: row["karst_over"])
        # Each against what is best by its own measure.
        trimmed = min(row["karst_over_trimmed"] for row in mitsuba)
        found["over_mitsuba"] = {"ratio": best["karst_over"], "trimmed": trimmed, "which": best["program"]}
    if cycles:
        found["over_cycles"] = {"ratio": cycles["karst_over"], "trimmed": cycles["karst_over_trimmed"], "which": "cycles"}
    return found


def bias(row):
    """How far the mean lies from the reference."""
    if row["own_version"]:
        return f"{100 * row['bias']:+.2f} % †"
    spread = row["bias_error"]
    errors = f"{row['bias'] / spread:+.1f} SE" if spread > 0 else "0 SE"
    return f"{100 * row['bias']:+.2f} ± {100 * spread:.2f} % ({errors})"


def lines(found):
    """The rows of a scene."""
    for row in found["rows"]:
        over = "" if row["program"] == "karst" else f"{row['karst_over']:.2f}"
        mark = " †" if row["own_version"] else ""
        yield (
            f"| {found['scene']} | {row['program']}{mark} | {row['spp']:.4g} | {row['seconds']:.2f} "
            f"| {row['msamples_per_second']:.3f} | {row['relvar']:.3e} | {row['relvar_trimmed']:.3e} "
            f"| {row['efficiency']:.3g} | {row['efficiency_trimmed']:.3g} | {bias(row)} | {over} |"
        )


def ratio_line(found):
    """The ratios of a scene."""
    mitsuba, cycles = found["over_mitsuba"], found["over_cycles"]
    figures = lambda of: f"**{of['ratio']:.2f}** | {of['trimmed']:.2f}" if of else "– | –"
    return (f"| {found['scene']} | {found['kind']} | {figures(mitsuba)} | {mitsuba['which'] if mitsuba else '–'} "
            f"| {figures(cycles)} |")


def mean(values):
    """The geometric mean."""
    return math.exp(sum(map(math.log, values)) / len(values))


def two_marks(over, of, there, total, asked):
    """The mean and the least of some ratios, beside what is asked of them."""
    if not there:
        return []
    least = min(there, key=lambda pair: pair[1]["ratio"])
    count = f"{len(there)} of {total}"
    found = [
        {"over": over, "of": f"{of}: geometric mean", "scenes": count, "asked": asked[0],
         "ratio": mean([ratio["ratio"] for _, ratio in there]), "trimmed": mean([ratio["trimmed"] for _, ratio in there])},
        {"over": over, "of": f"{of}: least", "scenes": least[0], "asked": asked[1], "ratio": least[1]["ratio"],
         "trimmed": least[1]["trimmed"]},
    ]
    return [{**mark, "met": None if mark["asked"] is None else mark["ratio"] >= mark["asked"]} for mark in found]


def marks(scenes):
    """What is asked, beside what was found: losses count, scenes that no peer has do not."""
    found = []
    for kind, asked in (("surfaces", (MEAN_ASKED, LEAST_ASKED)), ("fog", (None, None))):
        of_kind = [scene for scene in scenes if scene["kind"] == kind]
        there = [(scene["scene"], scene["over_mitsuba"]) for scene in of_kind if scene["over_mitsuba"]]
        found += two_marks("the best of Mitsuba", kind, there, len(of_kind), asked)
    there = [(scene["scene"], scene["over_cycles"]) for scene in scenes if scene["over_cycles"]]
    return found + two_marks("Cycles", "all", there, len(scenes), (None, CYCLES_ASKED))


def mark_line(mark):
    """A row of the marks."""
    asked = "" if mark["asked"] is None else f"≥ {mark['asked']:g}"
    met = {None: "", True: "yes", False: "**no**"}[mark["met"]]
    return (f"| {mark['over']} | {mark['of']} | {mark['scenes']} | **{mark['ratio']:.2f}** | {mark['trimmed']:.2f} "
            f"| {asked} | {met} |")


def reasons(results):
    """Who has no row, and why; one line for peers that share a reason."""
    for found in results["scenes"]:
        grouped = {}
        for label, reason in found["missing"].items():
            grouped.setdefault(reason, []).append(label)
        for reason, labels in grouped.items():
            yield f"- {found['scene']}, {', '.join(labels)}: {reason}"
    for name, reason in results["not_raced"].items():
        yield f"- {name}: {reason}"


def closing(results):
    """The tables of ratios and marks, and who has no row."""
    parts = []
    if results["marks"]:
        parts += [RATIOS_HEAD, *map(ratio_line, results["scenes"]), "", MARKS_HEAD, *map(mark_line, results["marks"])]
    missing = list(reasons(results))
    if missing:
        parts += ["", "Not rendered:", "", *missing]
    return "\n".join(parts)


def page(results):
    """Everything as Markdown."""
    told = results["about"]
    others = ", ".join(sorted(set(told["peers"].values())))
    legend = LEGEND.format(seeds=told["seeds"], denoised="denoised " if told["reference_denoised"] else "")
    if any(row["own_version"] for found in results["scenes"] for row in found["rows"]):
        legend += CYCLES_LEGEND
    rows = [line for found in results["scenes"] for line in lines(found)]
    return "\n".join([
        f"# {title(told)}", "", f"{told['date']}, {told['cores']} cores{', ' + others if others else ''}: `{told['command']}`",
        "", legend, HEAD, *rows, "", closing(results),
    ])


def plot(results):
    """A bar for each ratio, as SVG."""
    groups = []
    for found in sorted(results["scenes"], key=lambda found: found["kind"], reverse=True):
        pairs = ((found["over_mitsuba"], COLORS[found["kind"]]), (found["over_cycles"], COLORS["cycles"]))
        shown = [Bar(of["ratio"], color) for of, color in pairs if of]
        if shown:
            groups.append((found["scene"], shown))
    legend = [("over the best of Mitsuba, surfaces", COLORS["surfaces"]), ("over the best of Mitsuba, fog", COLORS["fog"]),
              ("over Cycles", COLORS["cycles"])]
    return bars(groups, f"karst's efficiency over that of others ({title(results['about'])})", legend,
                [MEAN_ASKED, LEAST_ASKED, CYCLES_ASKED])
