#!/usr/bin/env python3
"""Rays against triangles beside Embree: how many a second by one thread, what they meet, and leaks of a closed mesh.

usage: bench/rays.py --tools DIR --embree3 LIB --embree4 LIB [--runs 3] [--rounds 5] [--work DIR] [--json OUT] [MESH…]

--tools is a folder with embench.cpp, a driver that casts one set of rays by a given Embree library; it is compiled here (headers
of Embree 3 must be installed). Each MESH is NAME.mesh in --work (u32 vertices, u32 triangles, f32 positions, u32 corners), with
rays from the camera below; those of a closed mesh that are aimed at its edges and corners must all hit. All programs run on
processor 1 in turn, so that whatever else the machine does meets all alike; a round's figure is its median, ratios are of figures of
the same round, and their median over rounds is printed. A hit differs where the distances are more than 1e-4 apart: rays that meet an
edge may meet either side of it. Needs numpy.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import sweep

# Eye, target and field of view of the rays, and whether the mesh is closed.
CAMERAS = {
    "sponza": ([-10, 5, 0, 0, 5, 0, 70], False),
    "teapot": ([500, 300, 850, 265, 110, 250, 40], False),
    "cave": ([0, 0, 0, 1, 0.1, 0.2, 90], True),
}
KINDS = ["primary", "bounce", "shadow"]
HEAD = "| mesh | rays | karst Mrays/s | Embree fast | Embree robust | over fast | over robust |\n|---|---|---|---|---|---|---|"


def call(*command):
    """What a program prints."""
    return subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout


def karst_bench():
    """The built program of core/benches/rays.rs."""
    built = call("cargo", "bench", "-p", "karst-core", "--bench", "rays", "--locked", "--no-run", "--message-format", "json")
    found = [json.loads(line) for line in built.splitlines() if line.startswith("{")]
    return next(one["executable"] for one in found if one.get("target", {}).get("name") == "rays" and one.get("executable"))


def parse(printed, first):
    """Mrays/s by kind, seconds of the build and bytes per triangle; numbers begin at column `first`."""
    found, build = {}, None
    for line in printed.splitlines():
        row = line.split("\t")
        if row[0] == "BUILD":
            build = [float(row[first]), float(row[first + 1])]
        elif row[0] == "RAYS" and not row[1].endswith("-x8"):
            found.setdefault(row[first], []).append(float(row[first + 1]))
    return {kind: statistics.median(values) for kind, values in found.items()}, build


def hits(prefix, kind, program):
    """Distances and triangles."""
    pairs = np.fromfile(f"{prefix}.{kind}.{program}.hits", dtype=[("t", "<f4"), ("triangle", "<u4")])
    return pairs["t"], pairs["triangle"]


def differing(prefix, kind):
    """Rays of so many that meet something else than by Embree robust."""
    (own, _), (other, _) = hits(prefix, kind, "karst"), hits(prefix, kind, "robust")
    both = np.isfinite(own) & np.isfinite(other)
    apart = np.abs(own[both] - other[both]) > 1e-4 * np.maximum(own[both], 1e-6)
    return int((np.isfinite(own) != np.isfinite(other)).sum()), int(apart.sum()), len(own)


def measure(name, bench, options):
    """The figures of a mesh."""
    prefix, mesh = os.path.join(options.work, name), os.path.join(options.work, f"{name}.mesh")
    embench = os.path.join(options.work, "embench")
    eye, closed = CAMERAS[name]
    if not os.path.exists(f"{prefix}.primary.rays"):
        call(embench, "gen", options.embree3, mesh, prefix, *eye, *(["edge"] if closed else []))
    rounds, builds = [], {}
    for _ in range(options.rounds):
        figures = {}
        pinned = ["taskset", "-c", "1"]
        figures["karst"], builds["karst"] = parse(call(*pinned, bench, mesh, prefix, options.runs), 1)
        for program, robust in (("fast", 0), ("robust", 1)):
            printed = call(*pinned, embench, "bench", options.embree4, 4, program, mesh, prefix, name, robust, options.runs)
            rows = [line.split("\t") for line in printed.splitlines()]
            figures[program] = {row[3]: float(row[4]) for row in rows if row[0] == "RAYS" and row[1] == program}
            builds[program] = next([float(row[3]), float(row[4])] for row in rows if row[0] == "BUILD")
        rounds.append(figures)
    median = lambda of: statistics.median(of(figures) for figures in rounds)
    row = {"mesh": name, "build_seconds_and_bytes_per_triangle": builds, "kinds": {}, "rounds": rounds}
    for kind in KINDS:
        row["kinds"][kind] = {
            **{program: median(lambda f, p=program: f[p][kind]) for program in ("karst", "fast", "robust")},
            **{f"over_{p}": median(lambda f, p=p: f["karst"][kind] / f[p][kind]) for p in ("fast", "robust")},
            "hit_or_not_differs_distance_differs_of": differing(prefix, kind),
        }
    if closed:
        row["leaks_of_rays_at_edges"] = {
            program: int(np.isinf(hits(prefix, "edge", program)[0]).sum()) for program in ("karst", "fast", "robust")
        }
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tools", required=True, metavar="DIR", help="folder of embench.cpp")
    parser.add_argument("--embree3", required=True, metavar="LIB", help="libembree3.so, which makes the rays")
    parser.add_argument("--embree4", required=True, metavar="LIB", help="libembree4.so, which is measured")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="times that a round casts all rays (3)")
    parser.add_argument("--rounds", type=int, default=5, metavar="N", help="rounds (5)")
    parser.add_argument("--work", default=".", metavar="DIR", help="where meshes, rays and hits are (here)")
    parser.add_argument("--json", metavar="OUT", help="write all figures here")
    parser.add_argument("meshes", nargs="*", default=list(CAMERAS), metavar="MESH", help="meshes (all)")
    options = parser.parse_args()
    options.karst, options.threads = os.path.join(sweep.ROOT, "target", "release", "karst"), 1
    call("g++", "-O3", "-march=x86-64-v3", os.path.join(options.tools, "embench.cpp"), "-o",
         os.path.join(options.work, "embench"), "-ldl")
    bench = karst_bench()
    results = {"about": sweep.about(options), "rows": []}
    print(HEAD, flush=True)
    for name in options.meshes:
        row = measure(name, bench, options)
        results["rows"].append(row)
        for kind, found in row["kinds"].items():
            print(f"| {name} | {kind} | {found['karst']:.2f} | {found['fast']:.2f} | {found['robust']:.2f} "
                  f"| {found['over_fast']:.2f} | {found['over_robust']:.2f} |")
        print(f"{name}: seconds of the build and bytes per triangle {row['build_seconds_and_bytes_per_triangle']}, hits that "
              f"differ {[found['hit_or_not_differs_distance_differs_of'] for found in row['kinds'].values()]}, leaks at edges "
              f"{row.get('leaks_of_rays_at_edges', 'not asked')}", flush=True)
    sweep.keep(results, options.json)


if __name__ == "__main__":
    main()
