#!/usr/bin/env python3
"""Makes oracle.csv: cases of the Disney BSDF evaluated in float64 by a numpy implementation of the model.

usage: oracle.py disney272.py > oracle.csv

The implementation has a function disney(p, wo, wi): p a dict of the parameters by name, wo and wi unit vectors.
"""
import importlib.util
import sys

import numpy as np

NAMES = ("specular_transmission metallic subsurface specular roughness specular_tint anisotropic sheen sheen_tint "
         "clearcoat clearcoat_gloss eta").split()


def direction(z, angle):
    s = np.sqrt(1 - z * z)
    return np.array([s * np.cos(angle), s * np.sin(angle), z])


def main():
    spec = importlib.util.spec_from_file_location("oracle", sys.argv[1])
    oracle = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(oracle)
    random = np.random.default_rng(272)
    print("# The Disney BSDF in float64 by disney272.py (numpy), made by oracle.py beside this file.")
    print("# Parameters are multiples of 1/64, which an f32 holds exactly. Directions: z, angle around z in radians.")
    print("# base_color r,g,b," + ",".join(NAMES) + ",wo z,wo angle,wi z,wi angle,f r,g,b")
    for case in range(400):
        numbers = np.clip(random.integers(-16, 81, 14), 0, 64) / 64
        p = dict(zip(NAMES, numbers[3:]))
        p["base_color"] = numbers[:3]
        p["roughness"] = random.integers(6, 65) / 64
        p["eta"] = random.integers(40, 160) / 64
        if p["eta"] == 1:
            p["eta"] = 1.5
        z, angle = np.round(random.uniform(-1, 1), 4), np.round(random.uniform(0, 6.28), 4)
        wo = direction(z, angle)
        if case % 2:  # near the peaks: reflected or refracted at a facet that is nearly flat
            alpha = p["roughness"] ** 2
            h = np.array([*(alpha * random.normal(size=2)), 1.0])
            h /= np.linalg.norm(h)
            eta = p["eta"] if z > 0 else 1 / p["eta"]
            cos = wo @ h
            cos2 = 1 - (1 - cos * cos) / eta ** 2
            if case % 4 == 1 or cos2 <= 0:
                wi = 2 * cos * h - wo
            else:
                wi = (cos / eta - np.sign(cos) * np.sqrt(cos2)) * h - wo / eta
            zi, ai = np.round(wi[2], 4), np.round(np.arctan2(wi[1], wi[0]), 4)
        else:
            zi, ai = np.round(random.uniform(-1, 1), 4), np.round(random.uniform(0, 6.28), 4)
        zi = np.clip(zi, -0.9999, 0.9999)
        if z == 0 or zi == 0:
            continue
        f = oracle.disney(p, wo, direction(zi, ai))
        row = [*p["base_color"], *(p[name] for name in NAMES), z, angle, zi, ai]
        print(",".join(f"{float(x):.10g}" for x in row) + "," + ",".join(f"{float(x):.12g}" for x in f))


if __name__ == "__main__":
    main()
