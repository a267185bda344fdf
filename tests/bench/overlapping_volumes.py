#!/usr/bin/python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Renders wisps whose grids overlap, and the one grid of their sum, and compares mean and CPU.

    /usr/bin/python3 tests/bench/overlapping_volumes.py build/release/bin/sheaf

Every wisp is a grid of its own in a box of its own. Their voxels lie on one lattice and are 0 at
their faces, so that the sum of the wisps is one grid, exactly. --place spread moves the wisps
apart, --place same gives all the same box. Prints the figures of one thread as JSON: user CPU of a
frame less that of one with fewer samples, so that reading the scene does not count, and of the
latter. Exits with 1 if the images differ by more than their noise, or the CPU by more than
--ratio-max. Needs python3-numpy.
"""
import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile

import numpy as np

LATTICE = 96  # Cells across the box of the sum.

SCENE = """Film "rgb" "integer xresolution" %(size)d "integer yresolution" %(size)d
Sampler "zsobol" "integer pixelsamples" 16
Integrator "volpath" "integer maxdepth" 20
LookAt 0 0.3 -4.2  0 0 0  0 1 0
Camera "perspective" "float fov" 32
WorldBegin
LightSource "distant" "rgb L" [3.6 2.7 1.8] "point3 from" [-4 2.4 -1.4] "point3 to" [0 0 0]
LightSource "infinite" "rgb L" [0.16 0.27 0.52]
"""

MEDIUM = """MakeNamedMedium "%(name)s" "string type" "uniformgrid"
  "integer nx" %(nx)d "integer ny" %(ny)d "integer nz" %(nz)d
  "point3 p0" [%(p0)s] "point3 p1" [%(p1)s] "rgb sigma_a" [1 1 1] "rgb sigma_s" [9 9 9]
  "float g" 0.3 "float density" [%(density)s]
AttributeBegin
  Material "interface"
  MediumInterface "%(name)s" ""
  Shape "trianglemesh" "point3 P" [%(corners)s]
    "integer indices" [0 2 3 0 3 1 4 5 7 4 7 6 0 1 5 0 5 4 2 6 7 2 7 3 0 4 6 0 6 2 1 3 7 1 7 5]
AttributeEnd
"""


def place(cell):
    """The place of a cell's lower corner in the scene."""
    return [round(2 * c / LATTICE - 1, 6) for c in cell]


def medium(name, lo, values):
    """The medium of these cells, x slowest, and its box."""
    p0, p1 = place(lo), place(np.add(lo, values.shape))
    corners = [" ".join(str((p0, p1)[n >> a & 1][a]) for a in range(3)) for n in range(8)]
    nx, ny, nz = values.shape
    density = values.transpose(2, 1, 0).ravel()  # In the file x is fastest.
    return MEDIUM % {"name": name, "nx": nx, "ny": ny, "nz": nz, "p0": " ".join(map(str, p0)),
                     "p1": " ".join(map(str, p1)), "corners": "  ".join(corners),
                     "density": " ".join("%.6g" % v if v else "0" for v in density)}


def wisps(count, across, where):
    """Their lower corners and cells."""
    random = np.random.default_rng(5)
    at = np.linspace(-1, 1, across)
    x, y, z = np.meshgrid(at, at, at, indexing="ij")
    made = []
    for _ in range(count):
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        along = x * axis[0] + y * axis[1] + z * axis[2]
        r2 = x * x + y * y + z * z
        bend = 0.35 * np.sin(4 * along + random.uniform(0, 6))
        aside = np.abs(np.sqrt(np.maximum(r2 - along ** 2, 0)) - np.abs(bend))
        values = np.clip(1 - 4 * aside, 0, 1) * np.clip(1.6 * (0.95 - np.sqrt(r2)), 0, 1)
        for a in range(3):
            for end in (0, -1):
                values[tuple(end if b == a else slice(None) for b in range(3))] = 0
        spread = LATTICE - across
        lo = {"near": random.integers(spread // 2 - spread // 4, spread // 2 + spread // 4, 3),
              "spread": random.integers(0, spread + 1, 3),
              "same": np.full(3, spread // 2)}[where]
        made.append((lo, np.round(values, 4)))
    return made


def render(sheaf, scene, out, samples):
    """User CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run([sheaf, "render", scene, "-o", out, "--threads", "1", "--samples", str(samples)],
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sheaf")
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--across", type=int, default=40, help="cells of a wisp")
    parser.add_argument("--place", choices=("near", "spread", "same"), default="near")
    parser.add_argument("--size", type=int, default=48)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--ratio-max", type=float, default=3)
    parser.add_argument("--folder")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or temporary
        os.makedirs(folder, exist_ok=True)
        made = wisps(arguments.count, arguments.across, arguments.place)
        total = np.zeros((LATTICE,) * 3)
        for lo, values in made:
            total[tuple(slice(l, l + n) for l, n in zip(lo, values.shape))] += values
        texts = {"sum": medium("sum", [0, 0, 0], total),
                 "wisps": "".join(medium("wisp%d" % i, lo, values)
                                  for i, (lo, values) in enumerate(made))}
        row = {"wisps": arguments.count, "place": arguments.place}
        for name, text in texts.items():
            scene = os.path.join(folder, name + ".pbrt")
            with open(scene, "w", encoding="ascii") as file:
                file.write(SCENE % {"size": arguments.size} + text)
            out = os.path.join(folder, name + ".exr")
            few = render(arguments.sheaf, scene, os.path.join(folder, "few.exr"), 16)
            many = render(arguments.sheaf, scene, out, arguments.samples)
            row[name + "_cpu_seconds"] = round(many - few, 2)
            row[name + "_few_seconds"] = round(few, 2)
        row["cpu_ratio"] = round(row["wisps_cpu_seconds"] / row["sum_cpu_seconds"], 2)
        compared = subprocess.run(
            [arguments.sheaf, "compare", "--json"] + [os.path.join(folder, name + ".exr")
                                                      for name in texts],
            stdout=subprocess.PIPE, check=True)
        row["verdict"] = json.loads(compared.stdout)["verdict"]
    print(json.dumps(row))
    is_good = row["verdict"] == "within noise" and row["cpu_ratio"] <= arguments.ratio_max
    sys.exit(0 if is_good else 1)


main()
