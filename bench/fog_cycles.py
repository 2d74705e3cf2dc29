#!/usr/bin/env python3
"""A spotlight in fog, by karst and by Cycles: speed against error, and whether the pictures agree.

usage: bench/fog_cycles.py --python PYTHON [--spp 64] [--seeds 4] [--threads N] [--bin DIR] [--pictures DIR] [--json OUT]

PYTHON is one that has bpy 4.5 and OpenEXR (pip install bpy OpenEXR); this script calls itself there. The scene is a room of
diffuse walls with a ball, filled with even fog that scatters forward, lit by one spotlight without size. Both trace a fixed
number of samples with as many threads, a box filter of one pixel and the same number of bounces; Cycles with its light tree,
without clamping, adaptive sampling, denoising and guiding. Seconds are of rendering alone: of Cycles those that a picture
takes less those of one at 1 sample per pixel. Runs take turns. Errors and efficiency as in bench/race.py, relative to the
mean of all pictures of both.
"""
import argparse
import json
import math
import os
import sys
import tempfile
import time

import numpy as np

import shared
import verdict
from pictures import Runs, picture, save, weights
from race import Own
from served import Served

EYE, TARGET, VFOV = (0.0, 1.5, 4.6), (0.0, 1.15, 0.0), 48.0
SIZE, MAX_DEPTH = (256, 192), 8
LOW, HIGH = (-2.5, 0.0, -2.5), (2.5, 3.2, 5.0)
BALL, RADIUS = (0.6, 0.6, -0.3), 0.6
LAMP, AIM, CONE, BLEND = (-1.6, 2.9, -1.2), (0.5, 0.4, -0.2), 36.0, 0.3
INTENSITY = (40.0, 34.0, 26.0)
SIGMA_A, SIGMA_S, G = 0.02, 0.22, 0.55
WALL, BALL_COLOR = (0.5, 0.5, 0.5), (0.5, 0.15, 0.1)

# The corners of the room's walls, which face inwards.
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def corners():
    """The corners of the room."""
    return [[(LOW, HIGH)[i >> 2 & 1][0], (LOW, HIGH)[i >> 1 & 1][1], (LOW, HIGH)[i & 1][2]] for i in range(8)]


def write_document(folder):
    """The scene as karst reads it."""
    with open(os.path.join(folder, "room.obj"), "w", encoding="utf-8") as file:
        file.writelines("v {} {} {}\n".format(*corner) for corner in corners())
        file.writelines("f {} {} {} {}\n".format(*(i + 1 for i in side)) for side in SIDES)
    document = {
        "version": 1,
        "camera": {"type": "perspective", "vfov": VFOV, "transform": {"look_at": {"eye": EYE, "target": TARGET}}},
        "film": {"width": SIZE[0], "height": SIZE[1], "filter": {"type": "box", "radius": 0.5}},
        "sampling": {"spp": 64},
        "integrator": {"max_depth": MAX_DEPTH},
        "medium": "fog",
        "media": {"fog": {"sigma_a": [SIGMA_A] * 3, "sigma_s": [SIGMA_S] * 3, "g": G}},
        "materials": {
            "wall": {"type": "diffuse", "reflectance": WALL, "two_sided": True},
            "red": {"type": "diffuse", "reflectance": BALL_COLOR},
        },
        "meshes": {"room": {"file": "room.obj"}},
        "instances": {"room": {"mesh": "room", "material": "wall"}},
        "spheres": {"ball": {"center": BALL, "radius": RADIUS, "material": "red"}},
        "lights": {
            "lamp": {
                "type": "spotlight", "position": LAMP, "direction": [b - a for a, b in zip(LAMP, AIM)],
                "intensity": INTENSITY, "cone_angle": CONE, "blend": BLEND,
            }
        },
    }
    path = os.path.join(folder, "scene.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(document, file, indent=1)
    return path


def look(eye, target):
    """Where a camera or a lamp is: up is +y here, and they look along their own −z."""
    import mathutils

    back = (mathutils.Vector(eye) - mathutils.Vector(target)).normalized()
    right = mathutils.Vector((0, 1, 0)).cross(back).normalized()
    columns = mathutils.Matrix((right, back.cross(right), back)).transposed().to_4x4()
    return mathutils.Matrix.Translation(eye) @ columns


def place(scene, name, data, matrix=None):
    """A thing in the scene."""
    import bpy

    thing = bpy.data.objects.new(name, data)
    scene.collection.objects.link(thing)
    if matrix is not None:
        thing.matrix_world = matrix
    return thing


def diffuse(name, color):
    """A material."""
    import bpy

    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1)
    material.node_tree.links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def fill_with_fog(scene):
    """The medium, everywhere."""
    import bpy

    world = scene.world = bpy.data.worlds.new("world")
    world.use_nodes = True
    nodes = world.node_tree.nodes
    nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    parts = []
    for kind, strength in (("Absorption", SIGMA_A), ("Scatter", SIGMA_S)):
        node = nodes.new(f"ShaderNodeVolume{kind}")
        node.inputs["Density"].default_value = strength
        # Blender absorbs what a colour is short of white, and scatters the colour.
        node.inputs["Color"].default_value = (0, 0, 0, 1) if kind == "Absorption" else (1, 1, 1, 1)
        parts.append(node)
    parts[1].inputs["Anisotropy"].default_value = G
    both = nodes.new("ShaderNodeAddShader")
    for number, node in enumerate(parts):
        world.node_tree.links.new(node.outputs[0], both.inputs[number])
    world.node_tree.links.new(both.outputs[0], nodes["World Output"].inputs["Volume"])


def build_in_blender():
    """The same scene in Blender's terms."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    room = bpy.data.meshes.new("room")
    room.from_pydata(corners(), [], SIDES)
    room.materials.append(diffuse("wall", WALL))
    place(scene, "room", room)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=7, radius=RADIUS, location=BALL)
    ball = bpy.context.object.data
    ball.polygons.foreach_set("use_smooth", np.ones(len(ball.polygons), bool))
    ball.materials.append(diffuse("red", BALL_COLOR))
    # Blender's lamps have a power that a point of this intensity would have, whatever their cone.
    lamp = bpy.data.lights.new("lamp", "SPOT")
    lamp.shadow_soft_size, lamp.spot_size, lamp.spot_blend = 0.0, math.radians(CONE), BLEND
    lamp.energy, lamp.color = 4 * math.pi * max(INTENSITY), [i / max(INTENSITY) for i in INTENSITY]
    place(scene, "lamp", lamp, look(LAMP, AIM))
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle_y, camera.clip_start = "VERTICAL", math.radians(VFOV), 1e-3
    scene.camera = place(scene, "camera", camera, look(EYE, TARGET))
    fill_with_fog(scene)
    return scene


def serve_cycles(threads):
    """Renders what the lines of the standard input ask for: samples, seed, file. Answers with the seconds."""
    import bpy

    scene = build_in_blender()
    scene.render.engine, cycles = "CYCLES", scene.cycles
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising, cycles.use_guiding = "CPU", False, False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.pixel_filter_type, cycles.filter_width, cycles.use_light_tree = "BOX", 1.0, True
    for kind in ("max", "diffuse", "glossy", "transmission", "volume", "transparent_max"):
        setattr(cycles, f"{kind}_bounces", MAX_DEPTH - 2)
    scene.render.threads_mode, scene.render.threads, scene.render.use_persistent_data = "FIXED", threads, True
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode, settings.exr_codec = "OPEN_EXR", "32", "RGB", "NONE"
    scene.render.dither_intensity = 0
    # Blender talks on the standard output.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in sys.stdin:
        samples, seed, path = line.split(maxsplit=2)
        cycles.samples, cycles.seed, scene.render.filepath = int(samples), int(seed), path.strip()
        begin = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        print(json.dumps({"seconds": time.perf_counter() - begin}), file=answers, flush=True)
    return 0


def render_all(work, options):
    """Pictures of both, in turn."""
    document, out = write_document(work), os.path.join(work, "cycles.exr")
    command = [options.python, os.path.abspath(__file__), "--serve", str(options.threads)]
    karst, cycles = Own(document, work, options), Served(command, os.path.join(work, "cycles.log"), 900)
    own, other = Runs("karst", options.spp), Runs("cycles", options.spp)
    seconds = lambda samples, seed: cycles.answer(f"{samples} {seed} {out}")["seconds"]
    try:
        seconds(1, 0)
        for seed in range(options.seeds):
            own.add(*karst.draw(seed)[:2])
            idle = seconds(1, seed)
            spent = seconds(options.spp, 100 + seed) - idle
            other.add(picture(out), spent)
    except RuntimeError as error:
        sys.exit(f"error: {error}\nhint: does the --python have bpy and OpenEXR?")
    finally:
        cycles.end()
    return own, other


def report(own, other):
    """The rows of both, and how far their means are apart."""
    means = [own.mean(), other.mean()]
    weight = weights((means[0] + means[1]) / 2)
    difference, error = other.bias(means[0])
    rows = [runs.result(weight) for runs in (own, other)]
    for row, (off, spread) in zip(rows, ((0.0, 0.0), (difference, error))):
        row.update(bias=off, bias_error=spread, own_version=False)
        for end in ("", "_trimmed"):
            row[f"karst_over{end}"] = rows[0][f"efficiency{end}"] / row[f"efficiency{end}"]
    return {"scene": "spotlight in fog", "rows": rows, "difference": difference, "difference_error": error}


def main():
    if sys.argv[1:2] == ["--serve"]:
        return serve_cycles(int(sys.argv[2]))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", required=True, metavar="PYTHON", help="one that has bpy")
    parser.add_argument("--spp", type=int, default=64, metavar="N", help="samples per pixel (64)")
    parser.add_argument("--seeds", type=int, default=4, metavar="N", help="pictures of each program (4)")
    parser.add_argument("--pictures", metavar="DIR", help="keep the mean pictures here, as EXR")
    parser.add_argument("--json", metavar="OUT", help="write all figures here")
    shared.common_options(parser)
    options = shared.finish(parser)
    with tempfile.TemporaryDirectory() as work:
        runs = render_all(work, options)
    if options.pictures:
        os.makedirs(options.pictures, exist_ok=True)
        for of in runs:
            save(os.path.join(options.pictures, f"{of.program}.exr"), of.mean())
    found = report(*runs)
    print("\n".join([verdict.HEAD, *verdict.lines(found)]))
    last = found["rows"][-1]
    print(f"\nCycles' pooled mean lies {100 * found['difference']:+.2f} ± {100 * found['difference_error']:.2f} % off karst's; "
          f"efficiency {last['karst_over']:.2f}, without 0.1 % {last['karst_over_trimmed']:.2f}")
    told = {**shared.about(options), "spp": options.spp, "seeds": options.seeds}
    shared.keep({"about": told, "scenes": [found]}, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
