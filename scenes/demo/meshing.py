"""Meshes, noise and file writers for make.py. Python standard library only; the same bytes on every run."""

import math
import struct
import zlib


def lattice(x, y, z, seed):
    """A number in [0, 1) for a lattice point."""
    n = (x * 374761393 + y * 668265263 + z * 2246822519 + seed * 3266489917) & 0xFFFFFFFF
    n = ((n ^ (n >> 13)) * 1274126177) & 0xFFFFFFFF
    return ((n ^ (n >> 16)) & 0xFFFF) / 65536.0


def noise(p, seed=0, period=None):
    """Value noise in [-1, 1] at a point; with a period it repeats in every axis."""
    cells, weights = [], []
    for c in p:
        floor = math.floor(c)
        f = c - floor
        cells.append((floor, floor + 1))
        weights.append(f * f * f * (f * (f * 6.0 - 15.0) + 10.0))
    if period:
        cells = [(a % period, b % period) for a, b in cells]
    (x0, x1), (y0, y1), (z0, z1) = cells
    u, v, w = weights

    def mix(a, b, t):
        return a + (b - a) * t

    near = mix(
        mix(lattice(x0, y0, z0, seed), lattice(x1, y0, z0, seed), u),
        mix(lattice(x0, y1, z0, seed), lattice(x1, y1, z0, seed), u), v)
    far = mix(
        mix(lattice(x0, y0, z1, seed), lattice(x1, y0, z1, seed), u),
        mix(lattice(x0, y1, z1, seed), lattice(x1, y1, z1, seed), u), v)
    return 2.0 * mix(near, far, w) - 1.0


def fbm(p, octaves, seed=0, period=None):
    """Sum of octaves of noise, each twice as fine and half as high."""
    total, height, scale = 0.0, 0.5, 1.0
    for i in range(octaves):
        total += height * noise([c * scale for c in p], seed + i, period and int(period * scale))
        height *= 0.5
        scale *= 2.0
    return total


def ridged(p, octaves, seed=0):
    """Like fbm with sharp crests, in [0, 1]."""
    total, height, scale = 0.0, 0.5, 1.0
    for i in range(octaves):
        total += height * (1.0 - abs(noise([c * scale for c in p], seed + i)))
        height *= 0.5
        scale *= 2.0
    return total


def smoothstep(a, b, x):
    """0 below a, 1 above b, smooth between."""
    t = min(max((x - a) / (b - a), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


class Mesh:
    """Vertices (position, uv) and triangles; normals are computed where a file wants them."""

    def __init__(self):
        self.points, self.uvs, self.triangles = [], [], []

    def vertex(self, p, uv=(0.0, 0.0)):
        """Adds a vertex and returns its index."""
        self.points.append(tuple(p))
        self.uvs.append(tuple(uv))
        return len(self.points) - 1

    def quad(self, a, b, c, d):
        """Two triangles; counter-clockwise seen from the front."""
        self.triangles += [(a, b, c), (a, c, d)]

    def grid(self, rows, columns, at, keep=lambda r, c: True, flip=False):
        """A grid of rows x columns vertices; `at(r, c)` gives (position, uv), `keep` drops cells."""
        first = len(self.points)
        for r in range(rows):
            for c in range(columns):
                self.vertex(*at(r, c))
        for r in range(rows - 1):
            for c in range(columns - 1):
                if not keep(r, c):
                    continue
                i = first + r * columns + c
                corners = (i, i + 1, i + 1 + columns, i + columns)
                self.quad(*(reversed(corners) if flip else corners))

    def box(self, center, size, axes=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
        """A closed box with its own vertices per face."""
        for axis in range(3):
            for side in (-1.0, 1.0):
                u, v = (axis + 1) % 3, (axis + 2) % 3
                corners = []
                for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                    local = [0.0, 0.0, 0.0]
                    local[axis], local[u], local[v] = side, float(su), float(sv)
                    p = [center[k] + sum(0.5 * size[j] * local[j] * axes[j][k] for j in range(3)) for k in range(3)]
                    corners.append(self.vertex(p, (0.5 * (su + 1) * size[u], 0.5 * (sv + 1) * size[v])))
                self.quad(*(corners if side > 0 else reversed(corners)))

    def tube(self, a, b, radius_a, radius_b, sides=10):
        """A round spar from a to b, closed at b."""
        d = unit(sub(b, a))
        u = unit(cross(d, (0.0, 0.0, 1.0) if abs(d[2]) < 0.9 else (1.0, 0.0, 0.0)))
        v = cross(d, u)

        def ring(r, c):
            t, turn = float(min(r, 1)), 2.0 * math.pi * c / sides
            radius = (radius_a, radius_b, 0.0)[r]
            p = [a[k] + (b[k] - a[k]) * t + radius * (math.cos(turn) * u[k] + math.sin(turn) * v[k]) for k in range(3)]
            return p, (c / sides, t * 4.0)

        self.grid(3, sides + 1, ring)

    def compact(self):
        """Drops vertices that no triangle uses."""
        new = {}
        for triangle in self.triangles:
            for i in triangle:
                new.setdefault(i, len(new))
        self.points, self.uvs = [self.points[i] for i in new], [self.uvs[i] for i in new]
        self.triangles = [tuple(new[i] for i in triangle) for triangle in self.triangles]

    def normals(self):
        """Unit normals per vertex, weighted by area."""
        faces = []
        for a, b, c in self.triangles:
            faces.append(cross(sub(self.points[b], self.points[a]), sub(self.points[c], self.points[a])))
        total = [[0.0, 0.0, 0.0] for _ in self.points]
        for triangle, n in zip(self.triangles, faces):
            for i in triangle:
                for k in range(3):
                    total[i][k] += n[k]
        return [unit(n) for n in total]

    def write_ply(self, path):
        """Binary little-endian PLY with normals and uv."""
        self.compact()
        header = (
            "ply\nformat binary_little_endian 1.0\n"
            f"element vertex {len(self.points)}\n"
            + "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v"))
            + f"element face {len(self.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
        )
        with open(path, "wb") as file:
            file.write(header.encode())
            for p, n, uv in zip(self.points, self.normals(), self.uvs):
                file.write(struct.pack("<8f", *p, *n, *uv))
            for triangle in self.triangles:
                file.write(struct.pack("<B3i", 3, *triangle))

    def write_obj(self, path, smooth=True):
        """OBJ with uv, and normals where `smooth`."""
        with open(path, "w", newline="\n") as file:
            file.write("# made by make.py\n")
            for p in self.points:
                file.write("v %.4f %.4f %.4f\n" % p)
            for uv in self.uvs:
                file.write("vt %.3f %.3f\n" % uv)
            if smooth:
                for n in self.normals():
                    file.write("vn %.3f %.3f %.3f\n" % n)
            corner = "%d/%d/%d" if smooth else "%d/%d"
            for triangle in self.triangles:
                parts = (corner % ((i + 1,) * (3 if smooth else 2)) for i in triangle)
                file.write("f " + " ".join(parts) + "\n")


def write_png(path, width, height, color):
    """An 8-bit RGB picture; `color(x, y)` gives three numbers from 0 to 1, row 0 at the top."""
    rows = bytearray()
    for y in range(height):
        rows.append(1)
        before = (0, 0, 0)
        for x in range(width):
            now = tuple(min(max(round(c * 255.0), 0), 255) for c in color(x, y))
            rows += bytes((a - b) & 255 for a, b in zip(now, before))
            before = now

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        file.write(chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(bytes(rows), 9)))
        file.write(chunk(b"IEND", b""))


def sub(a, b):
    """a - b"""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def cross(a, b):
    """The cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    """a at length 1; upwards where a has no length."""
    length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return (a[0] / length, a[1] / length, a[2] / length) if length > 0.0 else (0.0, 1.0, 0.0)
