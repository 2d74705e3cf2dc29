#!/usr/bin/env python3
"""Makes one small scene for every node of distance functions, for every texture in their space, and three close-ups of
fractals, all on one stage.

    python3 make.py            writes NAME.json for every scene, and cove.obj
    python3 make.py --check    writes nothing; fails where a committed file is not what would be written

The files are committed, so this need only run when a scene changes. Standard library only.
"""
import argparse
import json
import math
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
WIDTH = 118


# ---- the stage --------------------------------------------------------------------------------------------

PALETTE = {
    "paper": {"type": "diffuse", "reflectance": [0.55, 0.54, 0.52]},
    "clay": {"type": "principled_bsdf", "base_color": [0.62, 0.25, 0.14], "roughness": 0.6},
    "ochre": {"type": "principled_bsdf", "base_color": [0.72, 0.45, 0.13], "roughness": 0.6},
    "teal": {"type": "principled_bsdf", "base_color": [0.09, 0.36, 0.36], "roughness": 0.45},
    "ink": {"type": "principled_bsdf", "base_color": [0.1, 0.17, 0.42], "roughness": 0.4},
    "bone": {"type": "principled_bsdf", "base_color": [0.72, 0.66, 0.55], "roughness": 0.55},
    "brass": {"type": "principled_bsdf", "base_color": [0.85, 0.62, 0.28], "metallic": 1, "roughness": 0.35},
    "steel": {"type": "principled_bsdf", "base_color": [0.62, 0.64, 0.67], "metallic": 1, "roughness": 0.35},
    "glass": {"type": "dielectric", "ior": 1.5, "specular_transmittance": [0.93, 0.98, 0.97]},
    "blocks": {"type": "principled_bsdf", "roughness": 0.4, "base_color": {
        "type": "solid_checkerboard", "color0": [0.75, 0.68, 0.55], "color1": [0.1, 0.17, 0.42],
        "transform": {"scale": 1.6}}},
    "heights": {"type": "principled_bsdf", "roughness": 0.6, "base_color": {
        "type": "solid_fbm", "color0": [0.16, 0.05, 0.03], "color1": [0.95, 0.78, 0.5],
        "low": -0.15, "high": 0.3, "frequency": 1.6, "octaves": 5, "seed": 3}},
    "orbits": {"type": "principled_bsdf", "roughness": 0.5, "base_color": {
        "type": "orbit_trap", "trap": "axes", "near": 0.02, "far": 0.55,
        "color0": [0.85, 0.42, 0.08], "color1": [0.07, 0.16, 0.3]}},
}
SUN = {"type": "sun", "direction": [1, -1, -0.9], "irradiance": [2.3, 2.1, 1.8], "angular_size": 6}


def scene(objects, eye=(3.1, 2.3, 5.2), target=(0, 0.92, 0), vfov=25, cove=True, sky=(0.22, 0.25, 0.3),
          key=(-3.8, 5.5, 3.5), sun=False, depth=8):
    """A document: `objects` by name on the stage; or without its cove, or with a sun in place of the lamp."""
    used = {*([] if sun else ["paper"]), *(thing["material"] for thing in objects.values())}
    stage = {"meshes": {"cove": {"file": "cove.obj"}}, "instances": {"cove": {"mesh": "cove", "material": "paper"}}}
    return {
        "version": 1,
        "camera": {"type": "perspective", "vfov": vfov,
                   "transform": {"look_at": {"eye": list(eye), "target": list(target)}}},
        "film": {"width": 256, "height": 256, "view": "filmic"},
        "sampling": {"spp": 64},
        "integrator": {"max_depth": depth},
        "materials": {name: material for name, material in PALETTE.items() if name in used},
        **(stage if cove else {}),
        **({} if sun else {"spheres": {"key": {"center": list(key), "radius": 1.8, "material": "paper",
                                               "emission": [15, 13.6, 11.8]}}}),
        "sdf_objects": objects,
        "lights": {"sky": {"type": "environment", "radiance": list(sky)}, **({"sun": SUN} if sun else {})},
    }


def cove_obj():
    """The floor that rises into a wall behind the objects, without an edge between them."""
    radius, back, top, front, wide = 4.0, -9.0, 14.0, 12.0, 24.0
    lines = [(front, 0.0, 0.0)]
    for step in range(17):
        turn = math.pi / 2 * step / 16
        lines.append((back + radius - radius * math.sin(turn), radius - radius * math.cos(turn), turn))
    lines.append((back, top, math.pi / 2))
    text = ["# Floor and wall in one: y up, the wall at z = -9; the front looks up and towards +z."]
    for z, y, _ in lines:
        text += [f"v {x:g} {y:.6g} {z:.6g}" for x in (-wide, wide)]
    text += [f"vn 0 {math.cos(turn):.6g} {math.sin(turn):.6g}" for _, _, turn in lines]
    for i in range(1, len(lines)):
        a, b = 2 * i - 1, 2 * i + 1
        text.append(f"f {a}//{i} {a + 1}//{i} {b + 1}//{i + 1} {b}//{i + 1}")
    return "\n".join(text) + "\n"


# ---- trees ------------------------------------------------------------------------------------------------


def node(kind, **fields):
    """A node of a tree."""
    return {"type": kind, **fields}


def moved(child, translate=None, rotate=None, scale=None):
    """A child placed by a transform node."""
    fields = {"translate": translate, "rotate": rotate, "scale": scale}
    return node("transform", **{key: value for key, value in fields.items() if value is not None}, child=child)


def sphere(radius):
    return node("sphere", radius=radius)


def box(x, y, z):
    return node("box", size=[x, y, z])


def placed(material, tree, translate=None, rotate=None, scale=None, **more):
    """An object of the document."""
    fields = {"translate": translate, "rotate": rotate, "scale": scale}
    transform = {key: value for key, value in fields.items() if value is not None}
    return {"material": material, **({"transform": transform} if transform else {}), **more, "tree": tree}


# ---- scenes -----------------------------------------------------------------------------------------------


def primitives():
    """A scene for every node without children."""
    cone = {"tip": placed("clay", node("cone", radius=0.7, height=1.9), [-0.35, 0.95, -0.3]),
            "frustum": placed("clay", node("cone", radius=0.45, top_radius=0.22, height=0.8), [0.65, 0.4, 0.35])}
    horizon = {"ground": placed("paper", node("plane"), bounds={"min": [-400, -1, -400], "max": [400, 1, 20]}),
               "near": placed("clay", sphere(0.6), [0.5, 0.6, 0.6]),
               "middle": placed("teal", sphere(0.6), [-2.1, 0.6, -2]),
               "far": placed("ink", sphere(0.6), [-3.6, 0.6, -9])}
    return {
        "sphere": scene({"sphere": placed("clay", sphere(1), [0, 1, 0])}),
        "box": scene({"box": placed("teal", box(1.5, 1.5, 1.5), [0, 0.75, 0], [0, 18, 0])}),
        "rounded_box": scene({"rounded_box": placed("glass", node("rounded_box", size=[1.5, 1.5, 1.5], radius=0.25),
                                                    [0, 0.75, 0], [0, 18, 0])}, depth=16),
        "plane": scene(horizon, cove=False, sun=True, sky=(0.34, 0.41, 0.52), eye=(3.1, 1.6, 5.2),
                       target=(-0.4, 0.75, -0.5), vfov=32),
        "torus": scene({"torus": placed("brass", node("torus", major_radius=0.72, minor_radius=0.27),
                                        [0, 0.99, 0], [90, 0, 20])}),
        "cylinder": scene({"cylinder": placed("ochre", node("cylinder", radius=0.72, height=1.7), [0, 0.85, 0])}),
        "capsule": scene({"capsule": placed("ink", node("capsule", radius=0.5, height=0.95), [0, 0.975, 0])}),
        "cone": scene(cone),
        "ellipsoid": scene({"ellipsoid": placed("glass", node("ellipsoid", radii=[1, 0.65, 0.8]), [0, 0.65, 0])},
                           target=(0, 0.75, 0), depth=16),
        "mandelbulb": scene({"bulb": placed("bone", node("mandelbulb", power=8), [0, 1.05, 0], [20, 15, 0], 0.95)}),
        "julia": scene({"julia": placed("clay", node("julia", c=[-0.213, -0.041, -0.563, -0.56]), [0, 1.05, 0])}),
        "fbm_noise_sphere": scene({"rock": placed("ochre", node("fbm_noise_sphere", radius=0.85, amplitude=0.22,
                                                                 frequency=1.6, seed=3), [0, 0.95, 0])}),
    }


def operators():
    """A scene for every node that joins children."""
    def pair(kind, material, **fields):
        children = {"block": box(1.3, 1.3, 1.3), "ball": moved(sphere(0.72), [0.45, 0.5, 0.45])}
        return scene({kind: placed(material, node(kind, **fields, children=children), [0, 0.65, 0], [0, 12, 0])})

    core = {"block": box(1.5, 1.5, 1.5), "ball": sphere(0.98)}
    drops = {"left": moved(sphere(0.62), [-0.55, 0.62, 0]), "right": moved(sphere(0.5), [0.5, 0.5, 0.15]),
             "top": moved(sphere(0.42), [-0.05, 1.35, 0])}
    lens = placed("brass", node("intersection", children=core), [0, 0.75, 0], [0, 18, 0])
    pebble = placed("steel", node("smooth_intersection", k=0.35, children=core), [0, 0.75, 0], [0, 18, 0])
    return {
        "union": pair("union", "clay"),
        "intersection": scene({"die": lens}, target=(0, 0.8, 0)),
        "difference": pair("difference", "ochre"),
        "smooth_union": scene({"drops": placed("glass", node("smooth_union", k=0.4, children=drops))}, depth=16),
        "smooth_intersection": scene({"die": pebble}, target=(0, 0.8, 0)),
        "smooth_difference": pair("smooth_difference", "teal", k=0.3),
    }


def space():
    """A scene for every node that changes the space of its child."""
    stairs = node("union", children={"slab 1": box(1.5, 0.5, 1.5), **{
        f"slab {i + 1}": moved(box(1.5, 0.5, 1.5), [0, y, 0], [0, 12 * i, 0], round(1 - 0.15 * i, 2))
        for i, y in enumerate([0.4625, 0.85, 1.1625, 1.4], 1)}})
    pins = node("repetition", period=[0.5, 0, 0.5], count=2, child=node("capsule", radius=0.16, height=0.5))
    column = node("union", children={"shaft": moved(node("cylinder", radius=0.28, height=1.5), [0, 0.75, 0]),
                                     "capital": moved(box(0.8, 0.22, 0.8), [0, 1.6, 0])})
    columns = node("union", children={"ground": node("plane"),
                                      "columns": node("repetition", period=[2, 0, 2], child=column)})
    endless = placed("bone", columns, bounds={"min": [-60, -0.5, -100], "max": [60, 2, 5]})
    rock = node("fbm_noise", amplitude=0.16, frequency=1.8, octaves=6, seed=5,
                child=node("rounded_box", size=[1.5, 1.4, 1.2], radius=0.3))
    bow = node("bend", degrees=35, child=node("rounded_box", size=[3, 0.35, 0.9], radius=0.06))
    return {
        "fbm_noise": scene({"rock": placed("bone", rock, [0, 0.72, 0], [0, 25, 0])}, target=(0, 0.8, 0)),
        "transform": scene({"stairs": placed("ink", stairs, [0, 0.25, 0])}, target=(0, 0.8, 0)),
        "repetition": scene({"pins": placed("clay", pins, [0, 0.41, 0], [0, 15, 0])}, target=(0, 0.3, 0), vfov=29),
        "repetition_infinite": scene({"columns": endless}, cove=False, sun=True, sky=(0.34, 0.41, 0.52),
                                     eye=(2.3, 2.5, 9), target=(-0.6, 0.95, 0), vfov=34),
        "twist": scene({"column": placed("brass", node("twist", degrees=70, child=node(
            "rounded_box", size=[0.9, 2, 0.9], radius=0.08)), [0, 1, 0])}, target=(0, 0.98, 0)),
        "bend": scene({"bow": placed("teal", bow, [0, 1.1, 0], [0, 20, 0])}, target=(0, 0.7, 0), vfov=27),
    }


def textures():
    """A scene for every texture in the space of the object."""
    rock = node("fbm_noise_sphere", radius=0.85, amplitude=0.22, frequency=1.6, octaves=5, seed=3)
    carved = node("smooth_difference", k=0.2, children={"block": node("rounded_box", size=[1.5, 1.5, 1.5], radius=0.12),
                                                        "ball": moved(sphere(0.72), [0.45, 0.5, 0.45])})
    bulb = node("mandelbulb", power=8)
    return {
        "solid_checkerboard": scene({"block": placed("blocks", carved, [0, 0.75, 0], [0, 12, 0])}),
        "solid_fbm": scene({"rock": placed("heights", rock, [0, 0.95, 0])}),
        "orbit_trap": scene({"bulb": placed("orbits", bulb, [0, 1.05, 0], [20, 15, 0], 0.95)}),
    }


def closeups():
    """Close-ups of fractals."""
    bulb = {"bulb": placed("bone", node("mandelbulb", power=8))}
    other = {"bulb": placed("ochre", node("mandelbulb", power=4))}
    julia = {"julia": placed("clay", node("julia", c=[-0.213, -0.041, -0.563, -0.56], iterations=14))}
    view = {"cove": False, "sky": (0.34, 0.41, 0.52)}
    return {
        "mandelbulb_valley": scene(bulb, eye=(0.909, 0.399, 0.669), target=(0.854, 0.299, 0.427), vfov=26,
                                   key=(7.5, 6.5, 3.5), **view),
        "mandelbulb_power_4": scene(other, eye=(0.421, 0.695, 1.129), target=(0.503, 0.503, 0.905), vfov=26,
                                    key=(5.5, 7, 5.5), **view),
        "julia_close": scene(julia, eye=(-1.2, 1.1, 1.4), target=(-0.2, 0.3, 0.1), vfov=18, key=(-2, 6, 6), **view),
    }


# ---- files ------------------------------------------------------------------------------------------------


TABLES = ("materials", "meshes", "instances", "spheres", "sdf_objects", "lights", "children")


def lines(value, key=None, indent=0):
    """JSON as a person would write it: what fits on a line stands on one, tables have a line for each entry."""
    flat = json.dumps(value)
    if not isinstance(value, dict) or indent and key not in TABLES and len(flat) + indent + len(key) + 4 <= WIDTH:
        return flat
    pad, parts, line = " " * (indent + 2), [], ""
    for name, part in value.items():
        text = f"{json.dumps(name)}: {lines(part, name, indent + 2)}"
        fits = len(pad) + len(line) + len(text) + 3 <= WIDTH and not isinstance(part, dict)
        if line and fits and indent and key not in TABLES:
            line += ", " + text
        else:
            parts += [line] if line else []
            line = text
    return "{\n" + ",\n".join(pad + part for part in [*parts, line]) + "\n" + " " * indent + "}"


def files():
    """What is written: text by file name."""
    scenes = {**primitives(), **operators(), **space(), **textures(), **closeups()}
    return {"cove.obj": cove_obj(), **{f"{name}.json": lines(document) + "\n" for name, document in scenes.items()}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare with the committed files and write nothing")
    options = parser.parse_args()
    wrong = []
    for name, text in files().items():
        path = os.path.join(HERE, name)
        if not options.check:
            with open(path, "w", newline="\n", encoding="utf-8") as file:
                file.write(text)
        elif not os.path.exists(path) or open(path, encoding="utf-8", newline="").read() != text:
            wrong.append(name)
    known = set(files())
    wrong += [f"{name} (no scene here writes it)" for name in sorted(os.listdir(HERE))
              if name.endswith((".json", ".obj")) and name not in known]
    if wrong:
        sys.exit(f"error: not what make.py writes: {', '.join(wrong)}\nhint: run scenes/sdf/make.py, and git diff")


if __name__ == "__main__":
    main()
