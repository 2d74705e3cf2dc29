#!/usr/bin/env python3
"""Speed against error, scene by scene, beside other renderers.

usage: bench/race.py --scenes DIR [--spp 64] [--seeds 4] [--threads N] [--out DIR] [--json OUT] [--bin DIR]
                     [--peer NAME[:SAMPLER][@SPP]]… [--peers-folder DIR] [--peers-python PYTHON] [--cycles-python PYTHON]
                     [NAME…]

DIR has one folder a scene: scene.xml, which karst converts as it is, and reference.exr. The programs render every scene with
several seeds, in turn: a picture by karst, one by each peer, the next seed. A peer loads the scene once and stands still while
others render. Peers are those of --peer; with --peers-folder and without --peer, Mitsuba 3 as scalar and llvm, each with its
independent and its multijitter sampler, and Cycles with --cycles-python; with neither, karst alone.

The error is the variance between seeds, relative to the picture: relVar = mean(var / (d² + 0.01)) over pixels and channels, d
the denoised reference; efficiency = 1 / (relVar · seconds), also without the 0.1 % of pixels that vary most. Seconds are the
median of rendering alone, until the picture is in memory: loading, building trees, compiling and writing are left out for all
(of Cycles by taking off the seconds of a picture at 1 sample per pixel). Bias is looked at apart: the difference of pooled
means to the reference, with its standard error from 64 tiles of the picture.

@SPP gives a slow peer fewer samples: efficiency is per second. Such a row is at a disadvantage where the error falls faster than
1 / SPP, as with multijitter. Cycles renders its own version of a scene (cycles_peer.py), which not every scene has: its error is
relative to the denoised mean of its own pictures. karst:adaptive renders to the error that karst's first picture reports;
like all but Mitsuba and Cycles it does not count.

Writes DATE-COMMIT-race.json, .md and .svg into bench/results/, or --out, anew after every scene. Needs numpy and OpenEXR; with
pyoidn references are denoised.
"""
import argparse
import contextlib
import json
import os
import sys
import tempfile

import peers
import shared
import verdict
from pictures import Runs, denoises, np, picture, weights


class Own:
    """karst with a scene."""

    label = "karst"

    def __init__(self, document, work, options):
        self.document, self.work, self.options, self.spp = document, work, options, options.spp
        # The relMSE that each picture reported.
        self.reported = []

    def asked(self):
        """How many samples."""
        return ["--spp", self.spp]

    def draw(self, seed):
        """A picture, its seconds and its samples per pixel."""
        out, path = os.path.join(self.work, "own.exr"), os.path.join(self.work, "own.json")
        shared.run(self.options.karst, "render", self.document, *self.asked(), "--seed", 100 + seed, "--threads",
                   self.options.threads, "-o", out, "--report", path)
        with open(path, encoding="utf-8") as file:
            report = json.load(file)
        report = report[0] if isinstance(report, list) else report
        self.reported.append(report["rel_mse"])
        return picture(out), report["render_seconds"], report["spp_mean"]

    def end(self):
        """Nothing goes on between its pictures."""


class Adaptive(Own):
    """karst until the error that it reports of a picture with the same samples everywhere."""

    label = "karst:adaptive"

    def __init__(self, even, work, options):
        super().__init__(even.document, work, options)
        self.even = even

    def asked(self):
        target = self.even.reported[0] ** 0.5
        return ["--target-error", target, "--min-spp", min(16, self.spp), "--max-spp", 64 * self.spp]


class Other:
    """Another renderer with a scene."""

    def __init__(self, spec, folder, work, options):
        self.label, self.file = spec.label, os.path.join(work, "peer.npy")
        self.peer = peers.Peer(spec, folder, work, options.seeds, options)
        self.spp = self.peer.told["spp"]

    def draw(self, _):
        """Its next picture, with seconds and samples per pixel."""
        seconds = self.peer.draw(self.file)
        return np.load(self.file).astype(np.float64), seconds, self.spp

    def end(self):
        """Lets it go."""
        self.peer.end()


def enter(specs, folder, work, options):
    """All programs that have the scene, karst first, and why the others do not."""
    own = Own(shared.converted(folder, work, options), work, options)
    programs, missing = [own], {}
    for spec in specs:
        try:
            programs.append(Adaptive(own, work, options) if spec.is_own() else Other(spec, folder, work, options))
        except RuntimeError as error:
            missing[spec.label] = shared.without_folders(str(error))
    return programs, missing


def take_turns(programs, missing, options):
    """Pictures of all programs, a seed after the other; who fails is out."""
    runs = {program.label: Runs(program.label, program.spp) for program in programs}
    for seed in range(options.seeds):
        for program in programs:
            if program.label in missing:
                continue
            try:
                pixels, seconds, spp = program.draw(seed)
            except RuntimeError as error:
                if program is programs[0]:
                    raise
                missing[program.label] = shared.without_folders(str(error))
                continue
            runs[program.label].add(pixels, seconds)
            runs[program.label].spp = spp
    return [found for label, found in runs.items() if label not in missing]


def figures(runs, reference):
    """The rows of a scene."""
    weight, rows = weights(reference), []
    for found in runs:
        own_version = found.program == "cycles"
        row = found.result(weights(found.mean()) if own_version else weight)
        row["bias"], row["bias_error"] = found.bias(reference)
        rows.append({**row, "own_version": own_version})
    for row in rows:
        row["karst_over"] = rows[0]["efficiency"] / row["efficiency"]
        row["karst_over_trimmed"] = rows[0]["efficiency_trimmed"] / row["efficiency_trimmed"]
    return rows


def race(name, folder, specs, work, options):
    """All programs on one scene."""
    with contextlib.ExitStack() as stack:
        programs, missing = enter(specs, folder, work, options)
        for program in programs:
            stack.callback(program.end)
        runs = take_turns(programs, missing, options)
    with open(programs[0].document, encoding="utf-8") as file:
        fog = bool(json.load(file).get("media"))
    rows = figures(runs, picture(os.path.join(folder, "reference.exr")))
    return {"scene": name, "kind": "fog" if fog else "surfaces", "rows": rows, **verdict.ratios(rows), "missing": missing}


def all_races(folders, specs, results, options):
    """A row group for each scene, written after every one."""
    print(verdict.HEAD, flush=True)
    base = os.path.join(options.out, f"{results['about']['date']}-{results['about']['commit']}-race")
    with tempfile.TemporaryDirectory() as scratch:
        for name, folder in folders:
            try:
                found = race(name, folder, specs, os.path.join(scratch, name), options)
            except RuntimeError as error:
                results["not_raced"][name] = shared.without_folders(str(error))
                print(f"{name}: {error}", file=sys.stderr, flush=True)
                continue
            print("\n".join(verdict.lines(found)), flush=True)
            results["scenes"].append(found)
            results["marks"] = verdict.marks(results["scenes"])
            shared.keep(results, options.json)
            shared.publish(base, results, verdict.page(results), ("karst over others", verdict.plot(results)))
    if not results["scenes"]:
        sys.exit("error: karst rendered none of the scenes")
    print("\n" + verdict.closing(results))
    print(f"\n{base}.json, .md, .svg", file=sys.stderr)


def parse():
    """The options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=64, metavar="N", help="samples per pixel (64)")
    parser.add_argument("--seeds", type=int, default=4, metavar="N", help="pictures of each program (4)")
    parser.add_argument("--out", default=os.path.join(shared.ROOT, "bench", "results"), metavar="DIR", help="where results go")
    parser.add_argument("--json", metavar="OUT", help="write all figures here too")
    peers.add_options(parser)
    # The older name of the option, which took baseline.py itself.
    parser.add_argument("--peers", dest="peers_folder", metavar="DIR", help=argparse.SUPPRESS)
    options = shared.parse(parser)
    if options.seeds < 2:
        parser.error("--seeds: at least 2, or there is no variance between them")
    return options


def main():
    options = parse()
    folders = shared.need_folders(options)
    specs = peers.resolve(options, options.spp) if options.peer or options.peers_folder else []
    os.makedirs(options.out, exist_ok=True)
    results = {
        "about": {**shared.about(options), "spp": options.spp, "seeds": options.seeds, "reference_denoised": denoises(),
                  "peers": peers.check(specs, options)},
        "scenes": [], "not_raced": {}, "marks": [],
    }
    all_races(folders, specs, results, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
