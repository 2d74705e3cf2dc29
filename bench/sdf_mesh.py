#!/usr/bin/env python3
"""The same objects as distance functions and as dense meshes, in one tiny scene: pictures, time and memory.

usage: bench/sdf_mesh.py [--spp 64] [--triangles 1000000] [--peers PROGRAM [--peers-python PYTHON]] [NAME…]

A sphere, a torus and a smooth union of two spheres stand on a floor under a square lamp, each twice: diffuse, and of
rough metal. The scene is written for Mitsuba 3 and converted by karst, so both render the same mesh; in the second
document distance functions take the place of the mesh and nothing else changes. Both are rendered with two seeds by
turns. A table says how far the pictures lie apart (mean difference in its standard errors, relMSE over the noise of
both), and another one seconds of rendering (the faster of two), seconds of loading and building, peak memory, relMSE of
the noise, and time to equal error: seconds times the noise, in units of karst's mesh.

With --peers the mesh is rendered by Mitsuba 3 too. PROGRAM is called as `PYTHON PROGRAM FOLDER --peers … --spp …
--seeds 2 --json FILE`, with scene.xml and reference.exr in FOLDER, and writes for each peer `results` with `seconds`,
`relvar` (variance over (reference² + 0.01)) and `relmse`. PYTHON must have Mitsuba. Needs numpy for the meshes.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time

try:
    import numpy as np
except ImportError:
    sys.exit("error: numpy is missing\nhint: pip install numpy")

BLEND = 0.3
SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="8"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="34"/>
    <transform name="to_world"><lookat origin="0, 3, 6.2" target="0, 0.75, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
    <film type="hdrfilm">
      <integer name="width" value="256"/><integer name="height" value="256"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <bsdf type="twosided" id="matte"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.3, 0.2"/></bsdf></bsdf>
  <bsdf type="twosided" id="metal"><bsdf type="roughconductor">
    <string name="material" value="Al"/><string name="distribution" value="ggx"/><float name="alpha" value="0.3"/>
  </bsdf></bsdf>
  <bsdf type="twosided" id="ground"><bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.5, 0.5"/></bsdf></bsdf>
  <shape type="rectangle">
    <transform name="to_world"><scale value="8"/><rotate x="1" angle="-90"/></transform><ref id="ground"/>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><scale value="1.5"/><rotate x="1" angle="90"/><translate x="-1" y="5" z="1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="12, 12, 12"/></emitter>
  </shape>
  <shape type="ply">
    <string name="filename" value="mesh.ply"/>
    <transform name="to_world"><translate x="-1.15" y="0.9"/></transform><ref id="matte"/>
  </shape>
  <shape type="ply">
    <string name="filename" value="mesh.ply"/>
    <transform name="to_world"><translate x="1.15" y="0.9"/></transform><ref id="metal"/>
  </shape>
</scene>
"""
# Keeps three channels of a picture: the peers' program does not expect karst's layers.
PLAIN = """
import sys, numpy, mitsuba as mi
mi.set_variant("scalar_rgb")
picture = mi.Bitmap(sys.argv[1])
names = [field.name for field in picture.struct_()]
mi.Bitmap(numpy.array(picture)[..., [names.index(c) for c in "RGB"]].astype("float32")).write(sys.argv[2])
"""

# Prints the peak memory of Mitsuba's scalar mode, in MiB, with Python and its modules.
PEAK = """
import sys, mitsuba as mi
mi.set_variant("scalar_rgb")
mi.render(mi.load_file(sys.argv[1]), spp=1)
print(next(int(line.split()[1]) // 1024 for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


# ---- shapes: a tree, and positions and normals over a grid of two angles -----------------------------------


def ball(u, v):
    """Unit vectors, in columns: longitude u and latitude v, the poles on the y axis."""
    return np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], axis=-1)


def sphere(u, v):
    """A sphere of radius 0.9."""
    return 0.9 * ball(u, v), ball(u, v)


def torus(u, v):
    """A torus around the y axis."""
    ring = np.stack([np.cos(u), 0 * u, np.sin(u)], axis=-1)
    normal = np.cos(2 * v)[..., None] * ring + np.sin(2 * v)[..., None] * np.array([0.0, 1.0, 0.0])
    return 0.65 * ring + 0.25 * normal, normal


def smooth_union(u, v):
    """Two spheres that melt: every ray from the origin is bisected for where the blend is 0."""
    rays = ball(u, v)

    def value(p):
        """The blend, and its gradient: those of the spheres weighed."""
        left, right = p + [0.4, 0, 0], p - [0.4, 0, 0]
        a, b = np.linalg.norm(left, axis=-1), np.linalg.norm(right, axis=-1)
        share = np.clip(0.5 + (a - b) / (2 * BLEND), 0, 1)[..., None]
        gradient = (1 - share) * left / a[..., None] + share * right / b[..., None]
        return np.minimum(a, b) - 0.5 - np.maximum(BLEND - abs(a - b), 0) ** 2 / (4 * BLEND), gradient

    low, high = np.full(u.shape, 0.05), np.full(u.shape, 2.0)
    for _ in range(50):
        middle = 0.5 * (low + high)
        inside = value(middle[..., None] * rays)[0] < 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    points = low[..., None] * rays
    return points, value(points)[1]


SHAPES = {
    "sphere": (sphere, {"type": "sphere", "radius": 0.9}),
    "torus": (torus, {"type": "torus", "major_radius": 0.65, "minor_radius": 0.25}),
    "smooth_union": (smooth_union, {"type": "smooth_union", "k": BLEND, "children": {
        "left": {"type": "transform", "translate": [-0.4, 0, 0], "child": {"type": "sphere", "radius": 0.5}},
        "right": {"type": "transform", "translate": [0.4, 0, 0], "child": {"type": "sphere", "radius": 0.5}}}}),
}


def write_mesh(path, shape, triangles):
    """Writes a binary PLY with normals; the number of its triangles."""
    columns = max(8, 2 * round(math.sqrt(triangles / 4)))
    rows = max(4, round(triangles / (2 * columns)))
    u, v = np.meshgrid(np.linspace(0, 2 * math.pi, columns + 1), np.linspace(0, math.pi, rows + 1))
    points, normals = shape(u, v)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    across, below = corner + 1, corner + columns + 1
    faces = np.concatenate([np.stack([corner, across, below], 1), np.stack([across, below + 1, below], 1)])
    # At the poles of a grid one side of each square has no length.
    corners = points.reshape(-1, 3)[faces]
    faces = faces[np.abs(corners - np.roll(corners, 1, axis=1)).max(axis=2).min(axis=1) > 1e-7]
    table = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    table["count"], table["corners"] = 3, faces
    with open(path, "wb") as file:
        names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {u.size}\n{names}element face {len(faces)}\n"
                   "property list uchar int vertex_indices\nend_header\n".encode())
        file.write(np.concatenate([points, normals], axis=-1).astype("<f4").tobytes() + table.tobytes())
    return len(faces)


# ---- runs -------------------------------------------------------------------------------------------------


def run(*command):
    """What a command prints; its error text is an exception."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout


def render(document, picture, seed, options):
    """Seconds of rendering and of everything else, and the peak memory in MiB of the process."""
    report = f"{picture}.report.json"
    command = [options.karst, "render", document, "-o", picture, "--report", report]
    command += ["--spp", options.spp, "--seed", seed]
    command += ["--threads", options.threads] if options.threads else []
    begin = time.monotonic()
    run(*command)
    seconds = time.monotonic() - begin
    with open(report, encoding="utf-8") as text:
        found = json.load(text)
    # The kernel's figure for a child holds what this process had when it started it, the report's does not.
    return found["render_seconds"], seconds - found["render_seconds"], found["peak_rss_bytes"] / 2**20


def compare(karst, picture, reference, *more):
    """What `karst compare` finds."""
    return json.loads(run(karst, "compare", picture, reference, "--json", *more))


def documents(folder, tree, karst):
    """Writes the scene with the mesh and with distance functions; their paths."""
    mesh, sdf = os.path.join(folder, "mesh.json"), os.path.join(folder, "sdf.json")
    with open(os.path.join(folder, "scene.xml"), "w", encoding="utf-8") as file:
        file.write(SCENE)
    run(karst, "convert", os.path.join(folder, "scene.xml"), "-o", mesh, "--strict")
    with open(mesh, encoding="utf-8") as file:
        scene = json.load(file)
    dense = {name for name, asset in scene["meshes"].items() if asset["file"] == "mesh.ply"}
    taken = {name: thing for name, thing in scene["instances"].items() if thing["mesh"] in dense}
    if len(taken) != 2:
        raise RuntimeError(f"{mesh}: found {len(taken)} instances of the mesh, expected 2")
    scene["sdf_objects"] = {name: {"material": thing["material"], "transform": thing["transform"], "tree": tree}
                            for name, thing in taken.items()}
    scene["instances"] = {name: thing for name, thing in scene["instances"].items() if name not in taken}
    scene["meshes"] = {name: asset for name, asset in scene["meshes"].items() if name not in dense}
    with open(sdf, "w", encoding="utf-8") as file:
        json.dump(scene, file, indent=1)
    return mesh, sdf


def peers(folder, reference, options):
    """Rows of what the peers say of the mesh: name, seconds, noise, relMSE to karst's picture, MiB if known."""
    run(options.peers_python, "-c", PLAIN, reference, os.path.join(folder, "reference.exr"))
    found = os.path.join(folder, "peers.json")
    run(options.peers_python, options.peers, folder, "--peers", *options.peer_names, "--spp", options.spp, "--seeds", 2,
        "--threads", options.threads or os.cpu_count(), "--lock", os.path.join(folder, "lock"), "--json", found)
    with open(found, encoding="utf-8") as file:
        for peer in json.load(file):
            if "error" in peer:
                print(f"not measured: {peer['peer']}: {peer['error']}", file=sys.stderr, flush=True)
                continue
            result, memory = peer["results"][-1], ""
            if peer["peer"] == "mitsuba-scalar":
                memory = run(options.peers_python, "-c", PEAK, os.path.join(folder, "scene.xml")).strip()
            yield peer["peer"], result["seconds"], result["relvar"], result["relmse"], memory


def measure(name, folder, options):
    """The lines of both tables for a shape."""
    os.makedirs(folder, exist_ok=True)
    shape, tree = SHAPES[name]
    count = write_mesh(os.path.join(folder, "mesh.ply"), shape, options.triangles)
    kinds = dict(zip(("mesh", "sdf"), documents(folder, tree, options.karst), strict=True))
    runs, noise = {kind: [] for kind in kinds}, {}
    # By turns, so that both meet the same machine; no two pictures share a seed.
    for again in (0, 1):
        for i, kind in enumerate(kinds):
            picture = os.path.join(folder, f"{kind}-{again}.exr")
            runs[kind].append(render(kinds[kind], picture, 2 * again + i + options.seed, options))
    first = {kind: os.path.join(folder, f"{kind}-0.exr") for kind in kinds}
    second = {kind: os.path.join(folder, f"{kind}-1.exr") for kind in kinds}
    for kind in kinds:
        # Two pictures differ by the noise of both.
        noise[kind] = compare(options.karst, first[kind], second[kind])["rel_mse"] / 2
    found = compare(options.karst, first["sdf"], first["mesh"], "--repeat", second["sdf"],
                    "--reference-error", math.sqrt(noise["mesh"]), "--diff", os.path.join(folder, "difference.png"))
    same = (f"| {name} | {100 * found['mean_rel_diff']:+.3f} % | {found['mean_rel_diff_sigmas']:+.1f} "
            f"| {found['rel_mse']:.3e} | {found['rel_mse_ratio']:.2f} | {found['flip_mean']:.4f} |")
    best = {kind: min(times) for kind, times in runs.items()}
    unit, costs = best["mesh"][0] * noise["mesh"], []
    for kind in kinds:
        seconds, rest, memory = best[kind][0], min(t[1] for t in runs[kind]), max(t[2] for t in runs[kind])
        what = f"mesh of {count} triangles" if kind == "mesh" else "distance functions"
        costs.append(f"| {name} | karst, {what} | {seconds:.2f} | {rest:.2f} | {memory:.0f} | {noise[kind]:.2e} "
                     f"| {seconds * noise[kind] / unit:.2f} |")
    if options.peers:
        for peer, seconds, variance, distance, memory in peers(folder, first["mesh"], options):
            costs.append(f"| {name} | {peer}, the mesh (relMSE to karst's {distance:.1e}, noise of both "
                         f"{variance + noise['mesh']:.1e}) | {seconds:.2f} | | {memory} | {variance:.2e} "
                         f"| {seconds * variance / unit:.2f} |")
    return same, costs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel (64)")
    parser.add_argument("--seed", type=int, default=0, help="first of four seeds (0)")
    parser.add_argument("--triangles", type=int, default=1_000_000, help="triangles of a mesh, about (1000000)")
    parser.add_argument("--threads", type=int, help="threads (all)")
    parser.add_argument("--bin", default=os.path.join(root, "target", "release"), metavar="DIR", help="where karst is")
    parser.add_argument("--peers", metavar="PROGRAM", help="program that measures other renderers (none)")
    parser.add_argument("--peers-python", default="python3", metavar="PYTHON", help="Python that has Mitsuba (python3)")
    parser.add_argument("--peer-names", nargs="+", default=["mitsuba-scalar", "mitsuba-llvm"], metavar="PEER",
                        help="as PROGRAM calls them (mitsuba-scalar mitsuba-llvm)")
    parser.add_argument("--keep", metavar="DIR", help="keep meshes, documents and pictures here")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SHAPES)} (all)")
    options = parser.parse_args()
    options.karst = os.path.join(options.bin, "karst")
    unknown = [name for name in options.names if name not in SHAPES]
    if unknown:
        parser.error(f"{', '.join(unknown)}: expected {', '.join(SHAPES)}")
    same, costs = [], []
    with tempfile.TemporaryDirectory() as scratch:
        for name in options.names or SHAPES:
            print(name, file=sys.stderr, flush=True)
            line, lines = measure(name, os.path.join(options.keep or scratch, name), options)
            same.append(line)
            costs += lines
    print("| shape | mean difference | standard errors | relMSE | over noise | FLIP |")
    print("|---|---|---|---|---|---|", *same, sep="\n")
    print("\n| shape | rendered | seconds | loading, building | peak MiB | relMSE of noise | time to equal error |")
    print("|---|---|---|---|---|---|---|", *costs, sep="\n")


if __name__ == "__main__":
    sys.exit(main())
