"""Renders a scene with another renderer, in a Python that has it, picture by picture on request.

usage: PYTHON bench/peer_serve.py ASKED (by bench/peers.py)

ASKED is JSON: `programs` (the folder of baseline.py and cycles_peer.py), `name` (mitsuba-llvm, mitsuba-scalar or cycles),
`scene` (its folder), `sampler`, `spp`, `seeds`, `threads`. After loading, a line of JSON says `version`, `spp` (which a sampler
may round up), and the seconds of loading and of a first picture that nobody counts. Then for each line of the standard input,
the path of a file, the picture of the next seed goes there as a numpy array and a line says its `seconds`.
"""
import json
import os
import sys
import time
import types

import numpy as np


def start(steps, threads):
    """Has baseline.py load the scene and render a first picture. With a pool of one thread Mitsuba waits for itself for ever
    while it loads, so that a single thread has to come afterwards."""
    import drjit

    choose = drjit.set_thread_count
    if threads == 1:
        drjit.set_thread_count = lambda count: None
    found = next(steps)
    choose(threads)
    return found


def mitsuba(asked):
    """Pictures by Mitsuba, after what there is to say of it: baseline.py loads, compiles by a first picture, and renders."""
    import baseline
    import mitsuba as mi

    spp = asked["spp"]
    steps = baseline.mitsuba_worker(types.SimpleNamespace(
        worker=asked["name"], scene=[asked["scene"]], sampler=asked["sampler"], spp=[spp], nseeds={spp: asked["seeds"]},
        threads=asked["threads"],
    ))
    loading, first = start(steps, asked["threads"])
    taken = mi.load_dict({"type": asked["sampler"], "sample_count": spp}).sample_count()
    yield {"version": f"Mitsuba {mi.__version__}", "spp": int(taken), "loading": loading, "first": first}
    for _, _, seconds, pixels in steps:
        yield seconds, pixels


def check_cycles(scene):
    """What makes samples of Cycles comparable: all of them, and nothing but them."""
    import bpy

    cycles = scene.cycles
    wanted = {
        "use_adaptive_sampling": False, "use_denoising": False, "use_guiding": False, "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0, "device": "CPU",
    }
    for name, value in wanted.items():
        if getattr(cycles, name) != value:
            raise ValueError(f"Cycles has {name} {getattr(cycles, name)}, expected {value}")
    return f"Cycles {bpy.app.version_string}"


def cycles(asked):
    """Pictures by Cycles. Of its seconds those of a picture at 1 sample per pixel are taken off: they go into handing the
    scene over and writing the file."""
    import cycles_peer

    begin = time.perf_counter()
    renderer = cycles_peer.Renderer(os.path.join(asked["scene"], "scene.xml"), asked["threads"])
    version, loading = check_cycles(renderer.sc), time.perf_counter() - begin
    yield {"version": version, "spp": asked["spp"], "loading": loading, "first": renderer.render(1, 0)[0]}
    for seed in range(asked["seeds"]):
        idle = renderer.render(1, 1 + seed)[0]
        seconds, pixels = renderer.render(asked["spp"], 1000 + seed)
        if seconds <= idle:
            raise ValueError(f"{asked['spp']} samples per pixel are too few to be timed")
        yield seconds - idle, pixels


def main():
    """Answers until the standard input ends."""
    asked = json.loads(sys.argv[1])
    sys.path.insert(0, asked["programs"])
    # Renderers talk on the standard output.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    say = lambda **what: print(json.dumps(what), file=answers, flush=True)
    try:
        steps = (cycles if asked["name"] == "cycles" else mitsuba)(asked)
        say(**next(steps))
        for line in sys.stdin:
            seconds, pixels = next(steps)
            np.save(line.strip(), pixels.astype(np.float32))
            say(seconds=seconds)
    except Exception as error:
        # Whatever went wrong is for the one who asked to judge.
        say(error=f"{type(error).__name__}: {' '.join(str(error).split())}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
