"""Pictures of several seeds and what they tell: variance, bias, efficiency. Needs numpy and OpenEXR; with pyoidn the
reference is denoised."""
import statistics
import sys

try:
    import numpy as np
    import OpenEXR
except ImportError as missing:
    sys.exit(f"error: {missing}\nhint: {sys.executable} -m pip install numpy OpenEXR pyoidn")
try:
    import pyoidn
except ImportError:
    pyoidn = None


def picture(path):
    """The colours of an EXR."""
    with OpenEXR.File(path) as file:
        channels = file.channels()
        for name in ("RGB", "RGBA"):
            if name in channels:
                return channels[name].pixels[..., :3].astype(np.float64)
        return np.stack([channels[name].pixels for name in "RGB"], axis=2).astype(np.float64)


def save(path, pixels):
    """Writes an EXR."""
    OpenEXR.File({}, {"RGB": np.ascontiguousarray(pixels, dtype=np.float32)}).write(path)


def denoises():
    """Whether references are denoised here."""
    return pyoidn is not None


def weights(reference):
    """What squared errors are multiplied with. Noise of the reference would make it large where that is too dark."""
    if pyoidn:
        reference = pyoidn.denoise(np.ascontiguousarray(reference, dtype=np.float32), hdr=True).astype(np.float64)
    return 1 / (reference**2 + 1e-2)


class Runs:
    """Pictures and seconds of one program on one scene."""

    def __init__(self, program, spp):
        self.program, self.spp, self.pictures, self.seconds = program, spp, [], []

    def add(self, pixels, seconds):
        """One more picture."""
        self.pictures.append(pixels)
        self.seconds.append(seconds)

    def mean(self):
        """The mean of all pictures."""
        return np.mean(self.pictures, axis=0)

    def result(self, weight):
        """The figures of a row."""
        variance = (np.var(self.pictures, axis=0, ddof=1) * weight).mean(axis=2).ravel()
        kept = np.sort(variance)[: int(0.999 * len(variance))]
        seconds = statistics.median(self.seconds)
        found = {"relvar": float(variance.mean()), "relvar_trimmed": float(kept.mean()), "seconds": seconds}
        return {
            "program": self.program, "spp": self.spp, **found, "seconds_all": self.seconds,
            "msamples_per_second": len(variance) * self.spp / seconds * 1e-6,
            "efficiency": 1 / (found["relvar"] * seconds), "efficiency_trimmed": 1 / (found["relvar_trimmed"] * seconds),
        }

    def bias(self, reference):
        """Difference of the pooled mean to the reference, in parts of it, and its standard error from 64 tiles."""
        difference = self.mean() - reference
        rows = np.array_split(np.arange(difference.shape[0]), 8)
        columns = np.array_split(np.arange(difference.shape[1]), 8)
        tiles = [difference[np.ix_(row, column)].mean() for row in rows for column in columns]
        return float(np.mean(tiles) / reference.mean()), float(np.std(tiles, ddof=1) / 8 / reference.mean())
