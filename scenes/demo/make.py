#!/usr/bin/env python3
"""Makes the meshes, textures and the scene document of the demo: a wreck and a fractal in a sea cave.

    python3 make.py

The files are committed, so this need only run when the scene changes. Standard library only; metres, y up,
the camera looks along -z out of the cave.
"""

import json
import math
import os

from meshing import Mesh, fbm, lattice, noise, ridged, smoothstep, write_png

HERE = os.path.dirname(os.path.abspath(__file__))


def path(name):
    """A file beside this script."""
    return os.path.join(HERE, name)


# ---- rock -------------------------------------------------------------------------------------------------


def cave():
    """The shell of the cave: an arch along z, open towards -z, with a hole in the roof."""
    mesh = Mesh()
    rows, columns = 100, 78
    z_mouth, z_end = -5.5, 13.0

    def at(r, c):
        t, angle = r / (rows - 1), math.pi * (-0.12 + 1.24 * c / (columns - 1))
        z = z_mouth + (z_end - z_mouth) * t
        close = smoothstep(0.86, 1.0, t)
        wide = 4.9 + 1.3 * math.sin(0.55 * z + 0.8) + 0.9 * smoothstep(0.25, 0.0, t)
        high = 3.9 + 0.8 * math.sin(0.4 * z - 0.5)
        reach = 1.0 - 0.97 * close
        x, y = wide * math.cos(angle) * reach, 0.2 + high * math.sin(angle) * reach
        rough = 1.7 * (ridged((x * 0.22, y * 0.3, z * 0.22), 2, 5) - 0.55)
        fine = 0.75 * (ridged((x * 0.7, y * 1.1, z * 0.7), 4, 11) - 0.6)
        # Layers of stone: ledges at uneven heights.
        level = y * 1.9 + 1.2 * noise((x * 0.25, 0.3, z * 0.25), 31)
        ledge = 0.16 * (smoothstep(0.1, 0.5, level - math.floor(level)) - 0.5)
        push = rough + fine + ledge
        rim = 1.3 * fbm((x * 0.45, y * 0.45, 0.0), 4, 17) * smoothstep(0.14, 0.0, t)
        p = (x - push * math.cos(angle), y - push * math.sin(angle), z + rim)
        return p, (angle * 1.6, z * 0.33 + 0.07 * y)

    def keep(r, c):
        t, turn = r / (rows - 1), c / (columns - 1)
        z, side = z_mouth + (z_end - z_mouth) * t, (turn - 0.40) * 13.0
        wobble = 0.55 * noise((z * 1.3, side * 1.3, 0.0), 23)
        return math.hypot(z - 1.2, side * 0.9) > 1.15 + wobble

    mesh.grid(rows, columns, at, keep)
    mesh.write_ply(path("meshes/cave.ply"))


def sand_height(x, z):
    """Height of the sand: dunes, ripples, a slope up into the cave and down to the sea."""
    dune = 0.30 * fbm((x * 0.22, 0.0, z * 0.22), 3, 41)
    bend = 1.4 * noise((x * 0.3, 0.0, z * 0.3), 43)
    ripple = 0.022 * math.sin(5.6 * (z * 0.9 + 0.35 * x + bend)) * (0.5 + 0.5 * noise((x * 0.5, 1.0, z * 0.5), 47))
    walls = 0.10 * max(abs(x) - 2.2, 0.0) ** 1.5
    beach = -0.55 * smoothstep(-3.0, -11.0, z)
    # Sand drifted against the wreck, and a hollow in front of it.
    drift = 0.35 * math.exp(-((x - 2.4) ** 2 / 3.0 + (z - 0.9) ** 2 / 0.8))
    return dune + ripple + walls + beach + drift


def sand():
    """The floor of the cave and the beach."""
    mesh = Mesh()
    rows, columns = 116, 72

    def at(r, c):
        # Rows are closer together near the camera.
        t = r / (rows - 1)
        z = 10.5 - 24.0 * t ** 1.15
        x = (c / (columns - 1) - 0.5) * (15.0 + 12.0 * t)
        y = sand_height(x, z)
        return (x, y, z), (x * 0.35, z * 0.35)

    mesh.grid(rows, columns, at, flip=False)
    mesh.write_ply(path("meshes/sand.ply"))


def stack():
    """A sea stack: a column of rock."""
    mesh = Mesh()
    rows, columns = 26, 36

    def at(r, c):
        t, angle = r / (rows - 1), 2.0 * math.pi * (c % (columns - 1)) / (columns - 1)
        radius = (0.52 - 0.3 * t ** 1.6) * (1.0 - smoothstep(0.86, 1.0, t) * 0.9)
        x, z = math.cos(angle), math.sin(angle)
        grow = 1.0 + 0.75 * fbm((x * 1.1, t * 2.2, z * 1.1), 4, 61) + 0.25 * (ridged((x * 2, t * 6, z * 2), 3, 67) - 0.5)
        return (x * radius * grow + 0.1 * t, t * 1.0, z * radius * grow), (2.0 * c / columns, 2.0 * t)

    mesh.grid(rows, columns, at, flip=True)
    mesh.write_ply(path("meshes/stack.ply"))


def plain_quad(name, corners):
    """One quad, its front to the side from which the corners run counter-clockwise."""
    mesh = Mesh()
    mesh.quad(*(mesh.vertex(p, uv) for p, uv in zip(corners, ((0, 0), (1, 0), (1, 1), (0, 1)))))
    mesh.write_obj(path(f"meshes/{name}.obj"), smooth=False)


# ---- the wreck: x from stern (-) to bow (+), y up, z to starboard --------------------------------------------

STATIONS, STRAKES = 30, 11


def hull_point(s, u):
    """A point of the hull (starboard): s from stern 0 to bow 1, u from keel 0 to rail 1."""
    t = 2.0 * s - 1.0
    fore, aft = max(t, 0.0), max(-t, 0.0)
    beam = 1.15 * (1.0 - fore ** 2.5) ** 0.85 * (1.0 - 0.42 * aft ** 2.2)
    keel = -1.05 + 0.85 * fore ** 4 + 0.30 * aft ** 5
    rail = 0.55 + 0.62 * fore ** 2 + 0.50 * aft ** 2
    full = (1.0 - max(1.0 - u, 0.0) ** 2.4) ** (0.62 + 0.5 * fore ** 2)
    flare = 1.0 + 0.10 * u * fore
    x = 3.6 * t + (0.75 * u - 0.25) * fore ** 3 - 0.30 * u * aft ** 4
    return (x, keel + (rail - keel) * u, max(beam * full * flare, 0.02))


def missing(i, j):
    """Planks that the sea has taken, on the side that the camera sees."""
    hole = math.hypot((i - 12.2) / 4.3, (j - 6.2) / 2.6) + 0.35 * (lattice(i // 2, j, 0, 71) - 0.5)
    return hole < 1.0 or (lattice(i // 3, j, 1, 73) < 0.045 and j > 2)


def hull():
    """Lapped planks on both sides, ribs, keel, transom, rails, deck."""
    mesh = Mesh()
    for side in (1.0, -1.0):
        for j in range(STRAKES):
            def at(r, i, j=j, side=side):
                x, y, z = hull_point(i / (STATIONS - 1), (j + (0.0 if r < 2 else 1.04)) / STRAKES)
                lap = (0.0, 0.030, 0.004)[r]
                return (x, y - 0.3 * lap, side * (z + lap)), (0.55 * x + 0.37 * j, (j + 0.5 * min(r, 1) + 0.45 * (r > 1)) / 4.0)

            keep = (lambda r, i, j=j: not missing(i, j)) if side > 0 else (lambda r, i: True)
            mesh.grid(3, STATIONS, at, keep, flip=side < 0)
    frames = [2, 4, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20, 22, 24]
    for i in frames:
        for side in (1.0, -1.0):
            rib(mesh, i / (STATIONS - 1) + 0.008, side)
    keel(mesh)
    transom(mesh)
    rails(mesh)
    deck(mesh)
    mesh.write_ply(path("meshes/hull.ply"))


def rib(mesh, s, side):
    """A bent timber inside the planks."""
    def at(r, c):
        x, y, z = hull_point(s, c / 12.0)
        inward = (0.03, 0.03, 0.16, 0.16)[r]
        return (x + (0.045, -0.045, -0.045, 0.045)[r], y, side * max(z - inward, 0.0)), (0.3 + 0.1 * r, c / 6.0)

    mesh.grid(4, 13, lambda r, c: at(r % 4, c))
    mesh.grid(2, 13, lambda r, c: at((3, 0)[r], c))


def keel(mesh):
    """Keel and stem: a bar along the bottom and up the bow."""
    line = [hull_point(i / 24.0, 0.0) for i in range(25)] + [hull_point(1.0, u / 8.0) for u in range(1, 9)]

    def at(r, c):
        x, y, _ = line[c]
        dy, z = ((0.06, 0.07), (-0.12, 0.07), (-0.12, -0.07), (0.06, -0.07))[r % 4]
        forward = 0.14 * smoothstep(22.0, 27.0, c)
        return (x + forward * (dy < 0), y + dy * (1.0 - smoothstep(24.0, 28.0, c)), z), (c * 0.15, r * 0.25)

    mesh.grid(5, len(line), at)


def transom(mesh):
    """The flat stern."""
    def at(r, c):
        x, y, z = hull_point(0.0, r / 8.0)
        return (x, y, z * (1.0 - 2.0 * c)), (y * 0.6, c * 1.2)

    mesh.grid(9, 2, at)


def rails(mesh):
    """A cap along the rail of each side."""
    for side in (1.0, -1.0):
        def at(r, c, side=side):
            x, y, z = hull_point(c / 28.0, 1.0)
            dy, dz = ((-0.05, 0.07), (0.05, 0.07), (0.05, -0.07), (-0.05, -0.07))[r % 4]
            return (x, y + dy, side * (z + dz)), (c * 0.2, r * 0.25)

        mesh.grid(5, 29, at, flip=side < 0)


def deck(mesh):
    """The deck, with a broken hatch."""
    def at(r, c):
        s = 0.03 + 0.9 * r / 26.0
        x, y, z = hull_point(s, 0.80)
        across = 2.0 * c / 12.0 - 1.0
        return (x, y + 0.05 * (1.0 - across * across), z * 0.97 * across), (0.5 * x, across * 1.5)

    mesh.grid(27, 13, at, keep=lambda r, c: not (11 <= r < 16 and 3 <= c < 9))


def rigging():
    """Mast, yard, bowsprit, cabin, a few ropes."""
    mesh = Mesh()
    mesh.tube((0.45, -0.6, 0.0), (0.25, 4.1, 0.0), 0.11, 0.075)
    mesh.tube((0.36, 2.95, -1.55), (0.36, 3.25, 1.45), 0.055, 0.045)
    mesh.tube((3.1, 0.85, 0.0), (5.3, 1.75, 0.05), 0.085, 0.05)
    mesh.tube((-2.75, 0.2, 0.0), (-3.0, 2.5, 0.1), 0.07, 0.05)
    for start, end in (
        ((0.25, 4.0, 0.0), (5.2, 1.7, 0.05)), ((0.27, 3.9, 0.0), (-0.5, 0.62, 1.1)), ((0.27, 3.9, 0.0), (1.1, 0.62, 1.1)),
        ((0.27, 3.9, 0.0), (-0.5, 0.62, -1.1)), ((0.25, 4.0, 0.0), (-2.98, 2.4, 0.1)),
    ):
        mesh.tube(start, end, 0.014, 0.014, 5)
    mesh.box((-2.45, 1.0, 0.0), (1.45, 0.75, 1.35))
    mesh.box((-2.45, 1.42, 0.0), (1.65, 0.08, 1.6))
    mesh.write_obj(path("meshes/rigging.obj"))


def sail():
    """What is left of the sail."""
    mesh = Mesh()
    rows, columns = 22, 22

    def at(r, c):
        t, across = r / (rows - 1), c / (columns - 1)
        z = -1.4 + 2.7 * across
        torn = 1.55 + 0.75 * noise((across * 5.0, 0.0, 0.0), 83) - 0.9 * smoothstep(0.5, 0.8, across)
        drop = t * max(torn, 0.35)
        belly = 0.42 * math.sin(math.pi * min(t, 1.0) * 0.8) * math.sin(math.pi * across) + 0.05 * math.sin(9.0 * across + 3.0 * t)
        return (0.43 + belly, 3.06 + 0.10 * across - drop, z * (1.0 - 0.12 * t)), (across * 2.0, t)

    def keep(r, c):
        return noise((r * 0.33, c * 0.33, 0.0), 89) > -0.62

    mesh.grid(rows, columns, at, keep)
    mesh.write_obj(path("meshes/sail.obj"))


def windows():
    """The lit panes of the cabin, fronts outwards."""
    mesh = Mesh()
    for x in (-2.8, -2.1):
        corners = ((x - 0.17, 0.9, 0.69), (x + 0.17, 0.9, 0.69), (x + 0.17, 1.2, 0.69), (x - 0.17, 1.2, 0.69))
        mesh.quad(*(mesh.vertex(p) for p in corners))
    corners = ((-1.71, 0.88, 0.28), (-1.71, 0.88, -0.28), (-1.71, 1.22, -0.28), (-1.71, 1.22, 0.28))
    mesh.quad(*(mesh.vertex(p) for p in corners))
    mesh.write_obj(path("meshes/windows.obj"), smooth=False)


# ---- textures ---------------------------------------------------------------------------------------------


def textures():
    """Tileable colours for rock, wood and sand."""
    size = 160

    def rock(x, y):
        p = (x * 4.0 / size, y * 4.0 / size, 0.5)
        grain, vein = fbm(p, 5, 101, 4), abs(noise((p[0] * 2.0, p[1] * 2.0, 3.5), 107, 8))
        layer = 0.5 + 0.5 * math.sin(2.0 * math.pi * (3.0 * y / size + 0.9 * fbm(p, 2, 103, 4)))
        v = 0.46 + 0.26 * grain + 0.10 * (layer - 0.5) - 0.10 * (vein < 0.06)
        return (v * 1.06, v * 0.98, v * 0.90)

    def wood(x, y):
        plank = 4 * y // size
        long = fbm((x * 3.0 / size, y * 48.0 / size, plank + 0.5), 3, 113)
        seam = 0.45 if (y * 4) % size < 8 else 1.0
        v = (0.40 + 0.20 * long + 0.10 * (lattice(plank, 0, 0, 127) - 0.5)) * seam
        return (v * 1.12, v * 0.86, v * 0.66)

    def grains(x, y):
        p = (x * 8.0 / size, y * 8.0 / size, 0.5)
        v = 0.62 + 0.13 * fbm(p, 3, 131, 8) + 0.10 * (lattice(x, y, 0, 137) - 0.5)
        return (v * 1.06, v * 0.93, v * 0.76)

    for name, color in (("rock", rock), ("wood", wood), ("sand", grains)):
        write_png(path(f"textures/{name}.png"), size, size, color)


# ---- the document -----------------------------------------------------------------------------------------


def image(name):
    """A reflectance from one of the textures."""
    return {"type": "image", "file": f"textures/{name}.png", "color_space": "srgb"}


def sky_strips(instances):
    """The evening sky: emissive strips far outside, each of one colour."""
    colors = ((1.60, 0.98, 0.56), (1.42, 1.00, 0.70), (1.10, 0.98, 0.86), (0.82, 0.92, 0.98),
              (0.62, 0.84, 1.04), (0.48, 0.74, 1.03), (0.37, 0.63, 0.98), (0.29, 0.53, 0.92),
              (0.23, 0.45, 0.85), (0.19, 0.39, 0.79), (0.16, 0.34, 0.73), (0.14, 0.30, 0.68))
    steps = 36
    for i in range(steps):
        f = i / (steps - 1) * (len(colors) - 1)
        a, b = colors[int(f)], colors[min(int(f) + 1, len(colors) - 1)]
        emission = [round(p + (q - p) * (f - int(f)), 4) for p, q in zip(a, b)]
        instances[f"sky_{i + 1:02d}"] = {
            "mesh": "strip", "material": "black", "emission": emission,
            "transform": {"translate": [0, round(-1.0 + i * 0.9, 3), -60], "scale": [100, 0.9, 1]},
        }


def document():
    """The whole scene."""
    instances = {
        "cave": {"mesh": "cave", "material": "rock"},
        "sand": {"mesh": "sand", "material": "sand"},
        "sea": {"mesh": "sea", "material": "sea"},
    }
    for i, (x, z, width, height, shade) in enumerate(
        ((-9.0, -31.0, 5.0, 8.5, "far"), (13.0, -42.0, 8.0, 12.0, "farther"), (-19.0, -45.0, 9.0, 7.5, "farther"),
         (5.6, -26.0, 2.6, 3.1, "far"))
    ):
        instances[f"stack_{i + 1}"] = {
            "mesh": "stack", "material": f"rock_{shade}",
            "transform": {"translate": [x, -0.6, z], "rotate": [0, 80 * i, 0], "scale": [width, height, width]},
        }
    wreck = {"translate": [2.5, 0.72, -0.6], "rotate": [-14, 24, 5]}
    wreck["rotate"] = [-13, 206, -6]
    for name, material in (("hull", "wood"), ("rigging", "spar"), ("sail", "canvas")):
        instances[name] = {"mesh": name, "material": material, "transform": wreck}
    instances["windows"] = {"mesh": "windows", "material": "black", "transform": wreck, "emission": [14, 6.2, 1.9]}
    sky_strips(instances)
    return {
        "version": 1,
        "camera": {
            "type": "perspective", "vfov": 44,
            "transform": {"look_at": {"eye": [-0.5, 1.55, 8.2], "target": [-0.1, 1.75, 0], "up": [0, 1, 0]}},
        },
        "film": {"width": 640, "height": 360, "filter": {"type": "blackman_harris", "radius": 1.5}, "exposure": 0.6, "view": "filmic"},
        "sampling": {"spp": 64, "seed": 1},
        "integrator": {"max_depth": 8, "roulette_depth": 4},
        "materials": {
            "rock": {"type": "diffuse", "reflectance": image("rock")},
            "sand": {"type": "diffuse", "reflectance": image("sand")},
            "wood": {"type": "diffuse", "reflectance": image("wood")},
            "spar": {"type": "diffuse", "reflectance": [0.20, 0.13, 0.085]},
            "canvas": {"type": "diffuse", "reflectance": [0.62, 0.55, 0.45]},
            "sea": {"type": "diffuse", "reflectance": [0.10, 0.22, 0.27]},
            "rock_far": {"type": "diffuse", "reflectance": [0.16, 0.20, 0.26]},
            "rock_farther": {"type": "diffuse", "reflectance": [0.34, 0.42, 0.52]},
            "bone": {"type": "diffuse", "reflectance": [0.86, 0.66, 0.48]},
            "stone": {"type": "diffuse", "reflectance": [0.33, 0.31, 0.29]},
            "black": {"type": "diffuse", "reflectance": [0.02, 0.02, 0.02]},
        },
        "meshes": {
            "cave": {"file": "meshes/cave.ply"}, "sand": {"file": "meshes/sand.ply"}, "stack": {"file": "meshes/stack.ply"},
            "sea": {"file": "meshes/sea.obj"}, "strip": {"file": "meshes/strip.obj"}, "hull": {"file": "meshes/hull.ply"},
            "rigging": {"file": "meshes/rigging.obj"}, "sail": {"file": "meshes/sail.obj"}, "windows": {"file": "meshes/windows.obj"},
        },
        "instances": instances,
        "spheres": lanterns(),
        "sdf_objects": sdf_objects(),
        "lights": {"dusk": {"type": "environment", "radiance": [0.10, 0.16, 0.26]}},
        "animation": {
            "fps": 24, "frames": [1, 4],
            "tracks": {
                "sdf_objects.heart.tree.power": {
                    "interpolation": "linear", "keys": [{"frame": 1, "value": 8}, {"frame": 4, "value": 7.4}]},
                "spheres.lantern_rock.emission": {
                    "interpolation": "linear",
                    "keys": [{"frame": 1, "value": [95, 43, 13]}, {"frame": 2, "value": [80, 35, 10]},
                             {"frame": 4, "value": [100, 46, 14]}]},
            },
        },
    }


RING = (-1.75, 1.62, -0.4)


def lanterns():
    """Warm lights: on a rock in front, in the broken hull, on the mast, and beads in the ring."""
    lights = {
        "lantern_rock": {"center": [-3.05, 0.98, 3.6], "radius": 0.085, "material": "black", "emission": [95, 43, 13]},
        "lantern_hull": {"center": [2.75, 0.85, -0.75], "radius": 0.10, "material": "black", "emission": [95, 40, 11]},
        "lantern_mast": {"center": [2.05, 2.35, 0.05], "radius": 0.07, "material": "black", "emission": [70, 34, 11]},
        "heart_light": {"center": [RING[0], RING[1] - 0.05, RING[2] - 0.95], "radius": 0.12, "material": "black", "emission": [60, 14, 7]},
    }
    for i in range(7):
        turn = math.pi * (0.08 + 0.84 * i / 6)
        center = [RING[0] + 1.52 * math.cos(turn), RING[1] + 1.52 * math.sin(turn), RING[2] + 0.24]
        lights[f"bead_{i + 1}"] = {
            "center": [round(c, 4) for c in center], "radius": 0.05, "material": "black", "emission": [60, 27, 8]}
    return lights


def sdf_objects():
    """The fractal, the stone ring that holds it, and boulders."""
    def boulder(at, size, turn):
        return {"type": "transform", "translate": at, "rotate": turn, "child": {"type": "box", "size": size}}

    def ball(at, radius):
        return {"type": "transform", "translate": at, "child": {"type": "sphere", "radius": radius}}

    ring = {
        "type": "smooth_union", "k": 0.35,
        "children": {
            "ring": {"type": "transform", "rotate": [90, 0, 0], "child": {"type": "torus", "major_radius": 1.52, "minor_radius": 0.20}},
            "foot": boulder([0.0, -1.75, 0.0], [1.9, 0.5, 0.9], [0, 8, 3]),
            "left": boulder([-1.15, -1.55, 0.1], [0.7, 0.8, 0.7], [10, 30, 14]),
            "right": boulder([1.2, -1.6, 0.05], [0.6, 0.7, 0.75], [-8, 20, -12]),
            "knob": ball([0.0, 1.72, 0.0], 0.16),
        },
    }
    boulders = {
        "type": "smooth_union", "k": 0.3,
        "children": {
            "a": boulder([0, 0, 0], [1.1, 0.7, 0.9], [12, 35, -8]), "b": boulder([0.75, -0.2, 0.35], [0.8, 0.55, 0.7], [-6, 10, 15]),
            "c": ball([-0.7, -0.15, 0.2], 0.42), "d": ball([0.3, 0.2, -0.35], 0.36),
        },
    }
    return {
        "heart": {
            "material": "bone", "transform": {"translate": list(RING), "rotate": [-64, 24, 0], "scale": 0.98},
            "tree": {"type": "mandelbulb", "power": 8, "iterations": 8, "bailout": 4},
        },
        "ring": {"material": "stone", "transform": {"translate": list(RING), "rotate": [0, 12, 0]}, "tree": ring},
        "boulders": {"material": "stone", "transform": {"translate": [-3.1, 0.45, 3.5], "rotate": [0, 20, 0]}, "tree": boulders},
    }


def main():
    """Writes everything."""
    for folder in ("meshes", "textures"):
        os.makedirs(path(folder), exist_ok=True)
    cave()
    sand()
    stack()
    plain_quad("sea", ((-70, -0.42, -7), (70, -0.42, -7), (70, -0.42, -60), (-70, -0.42, -60)))
    plain_quad("strip", ((-1, 0, 0), (1, 0, 0), (1, 1, 0), (-1, 1, 0)))
    hull()
    rigging()
    sail()
    windows()
    textures()
    with open(path("demo.json"), "w", newline="\n") as file:
        json.dump(document(), file, indent=1)
        file.write("\n")


if __name__ == "__main__":
    main()
