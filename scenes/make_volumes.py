#!/usr/bin/python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Makes the grids of the cloud and the fire: media of type uniformgrid, in gzipped pbrt files.

Needs python3-numpy. The outputs are committed; run it again after a change:
    /usr/bin/python3 scenes/make_volumes.py
"""
import gzip
import os

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))


def noise(points, random, octaves):
    """Sum of octaves of value noise in [-1, 1]; points: [..., 3]."""
    total = np.zeros(points.shape[:-1])
    for octave in range(octaves):
        lattice = random.uniform(-1, 1, (32, 32, 32))
        p = points * 2 ** octave
        cell = np.floor(p).astype(int)
        t = p - cell
        t = t * t * (3 - 2 * t)
        value = np.zeros_like(total)
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(np.array(corner) == 1, t, 1 - t), axis=-1)
            index = (cell + np.array(corner)) % 32
            value += weight * lattice[index[..., 0], index[..., 1], index[..., 2]]
        total += value * 0.5 ** octave
    return total


def cells(counts, lower, upper):
    """Centres of the cells, [z][y][x][3]."""
    axes = [lo + (np.arange(n) + 0.5) * (hi - lo) / n for n, lo, hi in zip(counts, lower, upper)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    return np.stack([x, y, z], axis=-1)


def write_medium(name, text, counts, lower, upper, grids):
    lines = [f'MakeNamedMedium "{name}" "string type" "uniformgrid" {text}',
             '  "integer nx" %d "integer ny" %d "integer nz" %d' % counts,
             '  "point3 p0" [%g %g %g] "point3 p1" [%g %g %g]' % (*lower, *upper)]
    for grid, (values, digits) in grids.items():
        numbers = " ".join("0" if v == 0 else f"{v:.{digits}f}" for v in values.reshape(-1))
        lines.append(f'  "float {grid}" [{numbers}]')
    path = os.path.join(HERE, "volumes", name + ".pbrt.gz")
    with open(path, "wb") as file, gzip.GzipFile("", "wb", 9, file, 0) as packed:
        packed.write(("\n".join(lines) + "\n").encode())
    print("%s: %d bytes" % (path, os.path.getsize(path)))


def cumulus():
    """Balls of vapour on a flat base, their surface broken up by noise."""
    random = np.random.default_rng(11)
    counts, lower, upper = (72, 40, 48), (-1.8, 0, -1.2), (1.8, 1.6, 1.2)
    p = cells(counts, lower, upper)
    field = np.full(p.shape[:-1], -1.0)
    for x, y, z, r in [(-0.9, 0.35, 0, 0.45), (-0.35, 0.55, 0.15, 0.6), (0.3, 0.65, -0.1, 0.66),
                       (0.85, 0.4, 0.1, 0.5), (0.05, 0.95, 0.05, 0.45), (-0.55, 0.35, -0.5, 0.4),
                       (0.5, 0.35, 0.55, 0.42), (1.25, 0.25, -0.1, 0.3), (-1.3, 0.25, 0.1, 0.27)]:
        field = np.maximum(field, 1 - np.linalg.norm(p - np.array([x, y, z]), axis=-1) / r)
    field += 0.42 * noise(p * 3, random, 4)
    base = np.clip((p[..., 1] - 0.12 - 0.05 * noise(p * 2, random, 2)) / 0.1, 0, 1)
    density = np.clip(field * 3.5, 0, 1) * base
    write_medium("cumulus", '"rgb sigma_s" [22 22 22] "rgb sigma_a" [0 0 0] "float g" 0.7', counts,
                 lower, upper, {"density": (density, 2)})


def fire():
    """Tongues that narrow and cool as they rise, and smoke above them."""
    random = np.random.default_rng(5)
    counts, lower, upper = (36, 64, 36), (-0.6, 0, -0.6), (0.6, 2.2, 0.6)
    p = cells(counts, lower, upper)
    height = p[..., 1] / 2.2
    # Rising parts sway.
    sway = np.stack([noise(p * [1.2, 1.6, 1.2] + 7 * k, random, 3) for k in range(2)], axis=-1)
    x = p[..., 0] + 0.28 * height * sway[..., 0]
    z = p[..., 2] + 0.28 * height * sway[..., 1]
    tongues = noise(np.stack([p[..., 0] * 4, p[..., 1] * 1.7, p[..., 2] * 4], -1), random, 3)
    width = 0.42 * (1 - height) ** 0.8 * (0.55 + 0.45 * np.clip(height * 6, 0, 1))
    flame = 1 - np.hypot(x, z) / np.maximum(width, 1e-3) + 0.75 * tongues * (0.3 + height)
    flame = np.clip(flame, 0, 1) * np.clip((1 - height) * 4, 0, 1)
    heat = np.sqrt(flame)
    temperature = np.where(heat > 0.05, 900 + 1300 * heat * (1 - 0.45 * height), 0)
    smoke = np.clip(1 - np.hypot(x, z) / 0.3 + 0.6 * tongues, 0, 1) * np.clip(height - 0.45, 0, 1)
    density = np.maximum(flame, 0.25 * smoke)
    write_medium("flame", '"rgb sigma_s" [1 1 1] "rgb sigma_a" [5 5 5] "float Lescale" 0.8', counts,
                 lower, upper, {"density": (density, 2), "temperature": (temperature, 0)})


if __name__ == "__main__":
    cumulus()
    fire()
