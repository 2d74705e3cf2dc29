"""Other renderers beside karst: which ones, where they are, whether they can be had, and pictures by them."""
import json
import os
import re
import sys
import tempfile

from served import Served

MITSUBA = ["mitsuba-scalar", "mitsuba-llvm"]
DEFAULT = [f"{name}:{sampler}" for name in MITSUBA for sampler in ("independent", "multijitter")]
HINTS = {
    "mitsuba-scalar": "{python} -m pip install mitsuba numpy OpenEXR pyoidn, or --peers-python PYTHON that has them",
    "mitsuba-llvm": "{python} -m pip install mitsuba numpy OpenEXR pyoidn; "
                    "apt-get install libllvm19; DRJIT_LIBLLVM_PATH=…/libLLVM.so.19.1",
    "cycles": "{python} -m pip install 'bpy~=4.5' numpy OpenEXR (Python 3.11), or --cycles-python PYTHON that has them",
}

# A ball that shines: what every peer can render, to see whether it is there.
TRIAL = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="3"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/><sampler type="independent"/>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/></film></sensor>
<shape type="sphere"><point name="center" x="0" y="0" z="4"/><float name="radius" value="1"/>
<bsdf type="diffuse"/><emitter type="area"><rgb name="radiance" value="1 1 1"/></emitter></shape>
</scene>
"""


class Spec:
    """Which renderer: NAME[:SAMPLER][@SPP]."""

    def __init__(self, text, spp):
        found = re.fullmatch(r"([a-z-]+)(?::([a-z]+))?(?:@([1-9][0-9]*))?", text)
        self.name, sampler, own_spp = found.groups() if found else ("", None, None)
        allowed = self.name in MITSUBA or (self.name == "cycles" and not sampler) or (self.name, sampler) == ("karst", "adaptive")
        if not allowed:
            sys.exit(f"error: peer {text!r}, expected {', '.join(f'{name}[:SAMPLER]' for name in MITSUBA)}, cycles or "
                     "karst:adaptive, each with @SPP or without")
        self.sampler = sampler or "independent"
        self.spp = int(own_spp or spp)
        self.label = self.name if self.name == "cycles" else f"{self.name}:{self.sampler}"

    def is_own(self):
        """Whether it is karst in another way."""
        return self.name == "karst"


def add_options(parser):
    """What others are, and where."""
    parser.add_argument("--peer", action="append", default=[], metavar="NAME[:SAMPLER][@SPP]",
                        help=f"which others, repeatable: {', '.join(DEFAULT)} (those four, and cycles with --cycles-python), "
                        "and karst:adaptive; @SPP for other samples per pixel than karst's")
    parser.add_argument("--peers-folder", metavar="DIR", help="where baseline.py and cycles_peer.py are (SCENES/../tools/peers)")
    parser.add_argument("--peers-python", default=sys.executable, metavar="PYTHON", help="one that has mitsuba (this one)")
    parser.add_argument("--cycles-python", metavar="PYTHON", help="one that has bpy (that of --peers-python)")
    parser.add_argument("--patience", type=float, default=900, metavar="S", help="longest that a picture may take (900)")


def resolve(options, spp):
    """The peers that are asked for, and their folder; those that every comparison has where none is named."""
    names = options.peer or [*DEFAULT, *(["cycles"] if options.cycles_python else [])]
    specs = [Spec(name, spp) for name in names]
    folder = options.peers_folder or os.path.join(options.scenes or ".", os.pardir, "tools", "peers")
    options.peers_folder = os.path.dirname(folder) if os.path.isfile(folder) else folder
    for program in ("baseline.py", "cycles_peer.py"):
        if any(not spec.is_own() for spec in specs) and not os.path.exists(os.path.join(options.peers_folder, program)):
            sys.exit(f"error: no {program} in {options.peers_folder}\nhint: --peers-folder says where the programs of peers are")
    return specs


def python_of(spec, options):
    """What runs a peer."""
    return (options.cycles_python or options.peers_python) if spec.name == "cycles" else options.peers_python


def stage(folder, work, sampler):
    """A folder like that of the scene, in which a peer may write."""
    with open(os.path.join(folder, "scene.xml"), encoding="utf-8") as file:
        # baseline.py replaces exactly this.
        if sampler != "independent" and '<sampler type="independent"' not in file.read():
            raise RuntimeError("the scene has a sampler of its own")
    staged = os.path.join(work, "staged")
    if not os.path.isdir(staged):
        os.makedirs(staged)
        for name in os.listdir(folder):
            os.symlink(os.path.abspath(os.path.join(folder, name)), os.path.join(staged, name))
    return staged


class Peer(Served):
    """Another renderer with a scene, which has rendered one picture that nobody counts."""

    def __init__(self, spec, folder, work, seeds, options):
        asked = {
            "programs": os.path.abspath(options.peers_folder), "name": spec.name, "scene": stage(folder, work, spec.sampler),
            "sampler": spec.sampler, "spp": spec.spp, "seeds": seeds, "threads": options.threads,
        }
        program = os.path.join(os.path.dirname(os.path.abspath(__file__)), "peer_serve.py")
        command = [python_of(spec, options), program, json.dumps(asked)]
        super().__init__(command, os.path.join(work, f"{spec.label.replace(':', '-')}.log"), options.patience)
        try:
            self.told = self.answer()
        except RuntimeError:
            self.end()
            raise

    def draw(self, path):
        """Seconds of the next picture, which goes to a file."""
        return self.answer(path)["seconds"]


def check(specs, options):
    """Ends the program, saying what to do, where a peer cannot render at all. Returns what each calls itself."""
    versions = {}
    with tempfile.TemporaryDirectory() as work:
        folder = os.path.join(work, "trial")
        os.makedirs(folder)
        with open(os.path.join(folder, "scene.xml"), "w", encoding="utf-8") as file:
            file.write(TRIAL)
        for spec in specs:
            if spec.is_own():
                continue
            try:
                peer = Peer(spec, folder, work, 1, options)
            except RuntimeError as error:
                python = python_of(spec, options)
                sys.exit(f"error: {spec.label} by {python}: {error}\nhint: {HINTS[spec.name].format(python=python)}")
            versions[spec.label] = peer.told["version"]
            peer.end()
    return versions
