"""Bars of ratios on a logarithmic axis, from 1 to the right or to the left, as SVG."""
import collections
import math

Bar = collections.namedtuple("Bar", ["value", "color"])
WIDTH, LEFT, TOP, THICK, GAP = 620, 150, 62, 14, 10


def limits(values):
    """The ends of the axis: 1, 2 or 5 times a power of ten, beyond all values and 1."""
    steps = [factor * 10.0**power for power in range(-6, 7) for factor in (1, 2, 5)]
    low = max((step for step in steps if step < min(1.0, *values) / 1.2), default=steps[0])
    high = min((step for step in steps if step > max(1.0, *values) * 1.25), default=steps[-1])
    return low, high, [step for step in steps if low <= step <= high]


def axis(place, ticks, asked, height):
    """Lines of the ticks, of 1 and of what is asked."""
    for tick in ticks:
        x = place(tick)
        yield (f"<path d='M{x:.1f} {TOP}v{height}' stroke='{'#000' if tick == 1 else '#ddd'}'/>"
               f"<text x='{x:.1f}' y='{TOP + height + 18}' text-anchor='middle'>{tick:g}</text>")
    for mark in asked:
        if ticks[0] <= mark <= ticks[-1]:
            x = place(mark)
            yield (f"<path d='M{x:.1f} {TOP}v{height}' stroke='#cc3311' stroke-dasharray='4 3'/>"
                   f"<text x='{x:.1f}' y='{TOP - 3}' text-anchor='middle' font-size='10' fill='#cc3311'>{mark:g}</text>")


def group(label, shown, top, place):
    """The bars of a name, and the name."""
    height = THICK * len(shown)
    yield f"<text x='{LEFT - 10}' y='{top + height / 2 + 4}' text-anchor='end'>{label}</text>"
    for number, bar in enumerate(shown):
        y, ends = top + THICK * number, sorted((place(1.0), place(bar.value)))
        x, anchor = (ends[0] - 5, "end") if bar.value < 1 else (ends[1] + 5, "start")
        yield (f"<rect x='{ends[0]:.1f}' y='{y}' width='{max(1.0, ends[1] - ends[0]):.1f}' height='{THICK - 2}' "
               f"fill='{bar.color}'/><text x='{x:.1f}' y='{y + 10}' text-anchor='{anchor}' font-size='11'>{bar.value:.2f}</text>")


def bars(groups, title, legend, asked):
    """Groups of bars, each with a name; the red lines are what is asked."""
    if not groups:
        return "<svg xmlns='http://www.w3.org/2000/svg'/>\n"
    low, high, ticks = limits([bar.value for _, shown in groups for bar in shown])
    place = lambda value: LEFT + WIDTH * math.log(value / low) / math.log(high / low)
    height = sum(THICK * len(shown) + GAP for _, shown in groups) + GAP
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{LEFT + WIDTH + 50}' height='{TOP + height + 30}' "
        "font-family='sans-serif' font-size='12'>", "<rect width='100%' height='100%' fill='white'/>",
        f"<text x='10' y='20' font-size='13'>{title}</text>", *axis(place, ticks, asked, height),
    ]
    for number, (text, color) in enumerate([*legend, ("asked", "#cc3311")]):
        x = 10 + 240 * number
        parts.append(f"<rect x='{x}' y='36' width='12' height='12' fill='{color}'/><text x='{x + 17}' y='46'>{text}</text>")
    top = TOP + GAP
    for label, shown in groups:
        parts.extend(group(label, shown, top, place))
        top += THICK * len(shown) + GAP
    return "\n".join([*parts, "</svg>\n"])
