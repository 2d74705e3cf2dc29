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
    """The shell of the cave: an arch along z, open towards -z."""
    mesh = Mesh()
    rows, columns = 100, 78
    z_mouth, z_end = -5.5, 13.0

    def at(r, c):
        t, angle = r / (rows - 1), math.pi * (-0.12 + 1.24 * c / (columns - 1))
        z = z_mouth + (z_end - z_mouth) * t
        close = smoothstep(0.86, 1.0, t)
        wide = 5.2 + 1.0 * math.sin(0.55 * z + 0.8) + 1.6 * smoothstep(0.35, 0.0, t)
        high = 4.1 + 0.5 * math.sin(0.4 * z - 0.5) + 1.3 * smoothstep(0.35, 0.0, t)
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

    mesh.grid(rows, columns, at)
    mesh.write_ply(path("meshes/cave.ply"))


def sand_height(x, z):
    """Height of the sand: dunes, ripples, a slope up into the cave and down to the sea."""
    dune = 0.30 * fbm((x * 0.22, 0.0, z * 0.22), 3, 41)
    bend = 1.4 * noise((x * 0.3, 0.0, z * 0.3), 43)
    ripple = 0.034 * math.sin(5.6 * (z * 0.9 + 0.35 * x + bend)) * (0.5 + 0.5 * noise((x * 0.5, 1.0, z * 0.5), 47))
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
    hole = math.hypot((i - 17.0) / 4.6, (j - 6.4) / 2.8) + 0.35 * (lattice(i // 2, j, 0, 71) - 0.5)
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

            keep = (lambda r, i, j=j: not missing(i, j)) if side < 0 else (lambda r, i: True)
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


def lantern():
    """A cage for a flame at the origin: foot, cap, ring, four bars."""
    mesh = Mesh()
    mesh.box((0.0, -0.15, 0.0), (0.22, 0.03, 0.22))
    mesh.box((0.0, 0.15, 0.0), (0.24, 0.025, 0.24))
    mesh.box((0.0, 0.19, 0.0), (0.13, 0.06, 0.13))
    mesh.tube((0.0, 0.2, 0.0), (0.0, 0.34, 0.0), 0.012, 0.012, 5)
    for x in (-0.095, 0.095):
        for z in (-0.095, 0.095):
            mesh.box((x, 0.0, z), (0.016, 0.3, 0.016))
    mesh.write_obj(path("meshes/lantern.obj"))


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
        return (v * 0.98, v * 0.99, v * 1.02)

    def wood(x, y):
        plank = 4 * y // size
        long = fbm((x * 3.0 / size, y * 48.0 / size, plank + 0.5), 3, 113)
        seam = 0.45 if (y * 4) % size < 8 else 1.0
        v = (0.40 + 0.20 * long + 0.10 * (lattice(plank, 0, 0, 127) - 0.5)) * seam
        return (v * 1.12, v * 0.86, v * 0.66)

    def grains(x, y):
        p = (x * 8.0 / size, y * 8.0 / size, 0.5)
        v = 0.62 + 0.13 * fbm(p, 3, 131, 8) + 0.10 * (lattice(x, y, 0, 137) - 0.5)
        return (v * 1.02, v * 0.95, v * 0.84)

    for name, color in (("rock", rock), ("wood", wood), ("sand", grains)):
        write_png(path(f"textures/{name}.png"), size, size, color)


# ---- the document -----------------------------------------------------------------------------------------


def image(name):
    """A reflectance from one of the textures."""
    return {"type": "image", "file": f"textures/{name}.png", "color_space": "srgb"}


def sky_strips(instances):
    """The evening sky: emissive strips far outside, each of one colour."""
    colors = ((1.90, 1.02, 0.58), (1.62, 1.04, 0.72), (1.15, 1.00, 0.88), (0.78, 0.92, 1.02),
              (0.54, 0.80, 1.08), (0.40, 0.68, 1.06), (0.30, 0.57, 1.00), (0.24, 0.48, 0.93),
              (0.20, 0.41, 0.86), (0.17, 0.36, 0.80), (0.15, 0.32, 0.74), (0.13, 0.29, 0.69))
    heights = [-1.5 + 1.1 * i for i in range(17)] + [22.0, 34.0]
    for i, (low, high) in enumerate(zip(heights, heights[1:])):
        f = min(i / 16.0, 1.0) * (len(colors) - 1)
        a, b = colors[int(f)], colors[min(int(f) + 1, len(colors) - 1)]
        emission = [round(1.1 * (p + (q - p) * (f - int(f))), 4) for p, q in zip(a, b)]
        instances[f"sky_{i + 1:02d}"] = {
            "mesh": "strip", "material": "black", "emission": emission,
            "transform": {"translate": [0, round(low, 3), -60], "scale": [70, round(high - low, 3), 1]},
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
            # The haze in front of it.
            "emission": [0.05, 0.085, 0.14] if shade == "far" else [0.16, 0.24, 0.35],
        }
    for name, material in (("hull", "wood"), ("rigging", "spar"), ("sail", "canvas")):
        instances[name] = {"mesh": name, "material": material, "transform": WRECK}
    instances["windows"] = {"mesh": "windows", "material": "black", "transform": WRECK, "emission": [6, 2.7, 0.85]}
    for name, (center, scale) in lantern_places().items():
        instances[f"lantern_{name}"] = {
            "mesh": "lantern", "material": "iron", "transform": {"translate": center, "scale": scale, "rotate": [0, 20, 0]}}
    sky_strips(instances)
    # A cool softbox under the roof, out of the picture: what a crack above would let in, without its noise.
    instances["skylight"] = {
        "mesh": "pane", "material": "black", "emission": [2.6, 4.6, 7.6],
        "transform": {"translate": [1.3, 3.85, 4.9], "rotate": [198, 0, 8], "scale": [1.3, 1, 0.8]}}
    return {
        "version": 1,
        "camera": {
            "type": "perspective", "vfov": 44,
            "transform": {"look_at": {"eye": [-0.5, 1.55, 8.2], "target": [-0.1, 1.75, 0], "up": [0, 1, 0]}},
        },
        "film": {"width": 640, "height": 360, "filter": {"type": "blackman_harris", "radius": 1.5}, "exposure": 0.9, "view": "filmic"},
        "sampling": {"spp": 32, "seed": 1},
        "integrator": {"max_depth": 5},
        "materials": {
            "rock": {"type": "diffuse", "reflectance": image("rock")},
            "sand": {"type": "diffuse", "reflectance": image("sand")},
            "wood": {"type": "diffuse", "reflectance": image("wood")},
            "iron": {"type": "diffuse", "reflectance": [0.06, 0.055, 0.05]},
            "spar": {"type": "diffuse", "reflectance": [0.20, 0.13, 0.085]},
            "canvas": {"type": "diffuse", "reflectance": [0.62, 0.55, 0.45]},
            "sea": {"type": "diffuse", "reflectance": [0.22, 0.42, 0.5]},
            "rock_far": {"type": "diffuse", "reflectance": [0.16, 0.20, 0.26]},
            "rock_farther": {"type": "diffuse", "reflectance": [0.34, 0.42, 0.52]},
            "bone": {"type": "diffuse", "reflectance": [0.90, 0.66, 0.44]},
            "stone": {"type": "diffuse", "reflectance": [0.33, 0.31, 0.29]},
            "dark_stone": {"type": "diffuse", "reflectance": [0.17, 0.165, 0.16]},
            "black": {"type": "diffuse", "reflectance": [0.02, 0.02, 0.02]},
        },
        "meshes": {
            "cave": {"file": "meshes/cave.ply"}, "sand": {"file": "meshes/sand.ply"}, "stack": {"file": "meshes/stack.ply"},
            "sea": {"file": "meshes/sea.obj"}, "strip": {"file": "meshes/strip.obj"}, "pane": {"file": "meshes/pane.obj"}, "lantern": {"file": "meshes/lantern.obj"}, "hull": {"file": "meshes/hull.ply"},
            "rigging": {"file": "meshes/rigging.obj"}, "sail": {"file": "meshes/sail.obj"}, "windows": {"file": "meshes/windows.obj"},
        },
        "instances": instances,
        "spheres": lanterns(),
        "sdf_objects": sdf_objects(),
        "animation": {
            "fps": 24, "frames": [1, 4],
            "tracks": {
                "sdf_objects.heart.transform.rotate": {
                    "interpolation": "linear",
                    "keys": [{"frame": 1, "value": [-20, 12, 0]}, {"frame": 4, "value": [-20, 12, 9]}]},
                "camera.transform.look_at.eye": {
                    "interpolation": "linear",
                    "keys": [{"frame": 1, "value": [-0.5, 1.55, 8.2]}, {"frame": 4, "value": [-0.38, 1.55, 8.14]}]},
                "spheres.flame_rock.emission": {
                    "interpolation": "linear",
                    "keys": [{"frame": 1, "value": FLAME}, {"frame": 2, "value": [62, 27, 7.8]},
                             {"frame": 4, "value": [90, 42, 13.5]}]},
            },
        },
    }


RING = (-1.9, 1.75, 0.2)


FLAME = [80, 37, 11.5]
WRECK = {"translate": [3.55, 0.62, -1.7], "rotate": [-13, 203, -6], "scale": 0.84}


def on_wreck(p):
    """A point of the wreck's own frame in the world: scaled, turned about x, y, z, moved."""
    x, y, z = (c * WRECK["scale"] for c in p)
    a, b, c = (math.radians(d) for d in WRECK["rotate"])
    y, z = y * math.cos(a) - z * math.sin(a), y * math.sin(a) + z * math.cos(a)
    x, z = x * math.cos(b) + z * math.sin(b), z * math.cos(b) - x * math.sin(b)
    x, y = x * math.cos(c) - y * math.sin(c), x * math.sin(c) + y * math.cos(c)
    return [round(v + t, 4) for v, t in zip((x, y, z), WRECK["translate"])]


def lantern_places():
    """Where the visible lanterns hang: name to (position, scale)."""
    return {
        "rock": ([-2.72, 1.36, 3.55], 1.0),
        "hull": (on_wreck((0.55, -0.15, 0.1)), 1.1),
        "yard": (on_wreck((0.36, 2.52, -1.42)), 1.0),
        "bow": (on_wreck((5.2, 1.22, 0.05)), 0.8),
    }


def lanterns():
    """Lights: a flame in every lantern, beads on the ring, embers behind the fractal, two keys out of the picture."""
    lights = {}
    for name, (center, scale) in lantern_places().items():
        lights[f"flame_{name}"] = {"center": center, "radius": round(0.075 * scale, 4), "emission": FLAME}
    lights["flame_hull"]["emission"] = [260, 115, 32]
    lights["key_ring"] = {"center": [-4.0, 2.2, 4.4], "radius": 0.22, "emission": [95, 48, 18]}
    lights["ember"] = {"center": [RING[0] - 0.25, RING[1] - 0.1, RING[2] - 1.3], "radius": 0.2, "emission": [110, 26, 11]}
    for i in range(7):
        turn = math.pi * (0.08 + 0.84 * i / 6)
        center = [RING[0] + 1.52 * math.cos(turn), RING[1] + 1.52 * math.sin(turn), RING[2] + 0.24]
        lights[f"bead_{i + 1}"] = {"center": [round(c, 4) for c in center], "radius": 0.055, "emission": [12, 5.4, 1.6]}
    return {name: {**light, "material": "black"} for name, light in lights.items()}


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
        "type": "smooth_union", "k": 0.42,
        "children": {
            "a": boulder([0, 0, 0], [0.8, 0.5, 0.7], [22, 35, -18]), "b": boulder([0.8, -0.25, 0.3], [0.6, 0.4, 0.5], [-16, 10, 25]),
            "post": boulder([0.1, 0.3, 0.05], [0.16, 1.0, 0.16], [6, 20, -5]),
            "c": ball([-0.7, -0.15, 0.2], 0.36), "d": ball([0.3, 0.1, -0.35], 0.30), "e": ball([0.25, -0.3, 0.75], 0.34),
        },
    }
    return {
        "heart": {
            "material": "bone", "transform": {"translate": list(RING), "rotate": [-20, 12, 0], "scale": 1.0},
            "tree": {"type": "mandelbulb", "power": 8, "iterations": 5, "bailout": 4},
        },
        "ring": {"material": "stone", "transform": {"translate": list(RING), "rotate": [0, 12, 0]}, "tree": ring},
        "boulders": {"material": "dark_stone", "transform": {"translate": [-3.1, 0.45, 3.5], "rotate": [0, 20, 0]}, "tree": boulders},
    }


def main():
    """Writes everything."""
    for folder in ("meshes", "textures"):
        os.makedirs(path(folder), exist_ok=True)
    cave()
    sand()
    stack()
    plain_quad("sea", ((-70, -0.42, -7), (70, -0.42, -7), (70, -0.42, -60), (-70, -0.42, -60)))
    plain_quad("pane", ((-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)))
    plain_quad("strip", ((-1, 0, 0), (1, 0, 0), (1, 1, 0), (-1, 1, 0)))
    hull()
    rigging()
    sail()
    windows()
    lantern()
    textures()
    with open(path("demo.json"), "w", newline="\n") as file:
        json.dump(document(), file, indent=1)
        file.write("\n")


if __name__ == "__main__":
    main()
