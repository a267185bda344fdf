#!/usr/bin/python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Renders a cloud of many voxels from memory and by pages, and compares image, CPU, memory, start.

    B=build/release/bin/paged_volume_bench
    /usr/bin/python3 tests/bench/paged_volume.py $B --mib 512 --budget-mib 128

Makes a cloud of about --mib MiB and its page file in a temporary folder (--folder keeps them),
renders each with the same settings in one thread, and prints the figures as JSON. Exits with 1 if
the tiles differ. The target "benches" builds the program. Needs python3-numpy, and twice the
cloud's size on the disk.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support",
                                "volume"))
from nanovdb_file import LEAF_BYTES, LOWER_BYTES, NanovdbFile  # noqa: E402

FILL = 0.45  # The part of the cube's leaves that the cloud has, about.

SCENE = """Film "rgb" "integer xresolution" %(width)d "integer yresolution" %(height)d
Sampler "zsobol" "integer pixelsamples" 32
Integrator "volpath" "integer maxdepth" 50
LookAt 0 0.4 -4.2  0 0 0  0 1 0
Camera "perspective" "float fov" 32
WorldBegin
LightSource "distant" "rgb L" [3.6 2.7 1.8] "point3 from" [-4 2.4 -1.4] "point3 to" [0 0 0]
LightSource "infinite" "rgb L" [0.16 0.27 0.52]
MakeNamedMedium "cloud" "string type" "nanovdb" "string filename" "%(file)s"
  "rgb sigma_a" [0 0 0] "rgb sigma_s" [40 40 40] "float g" 0.6
AttributeBegin
  Material "interface"
  MediumInterface "cloud" ""
  Shape "trianglemesh"
    "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
    "integer indices" [0 2 1  0 3 2  4 5 6  4 6 7  0 1 5  0 5 4  3 7 6  3 6 2  0 4 7  0 7 3  1 2 6
                       1 6 5]
AttributeEnd
"""


def smooth_noise(random, side):
    """Periodic noise in [-1, 1]."""
    noise = random.uniform(-1, 1, (side, side, side)).astype(np.float32)
    for axis in range(3):
        for _ in range(2):
            noise = (np.roll(noise, 1, axis) + 2 * noise + np.roll(noise, -1, axis)) / 4
    return noise / np.abs(noise).max()


def density(noises, side, origin):
    """The values of the 128^3 voxels at origin."""
    axes = [np.arange(o, o + 128) for o in origin]
    r2 = 0
    for axis, at in enumerate(axes):
        shape = [1, 1, 1]
        shape[axis] = 128
        r2 = r2 + (((at + 0.5) * 2 / side - 1).reshape(shape) ** 2).astype(np.float32)
    value = 1.6 * (0.9 - np.sqrt(r2))
    for noise, step, weight in noises:
        index = [(at // step) % len(noise) for at in axes]
        value = value + weight * noise[np.ix_(*index)]
    return np.clip(value, 0, 1).astype(np.float32)


def lower_and_leaves(values, origin):
    """The bytes of the leaves and of their lower node, which comes after them."""
    blocks = values.reshape(16, 8, 16, 8, 16, 8).transpose(0, 2, 4, 1, 3, 5).reshape(4096, 512)
    is_leaf = blocks.max(axis=1) > 0
    places = np.flatnonzero(is_leaf)
    leaves = np.zeros((len(places), LEAF_BYTES), np.uint8)
    corners = np.stack([places >> 8, (places >> 4) & 15, places & 15], axis=1) * 8 + origin
    leaves[:, :12] = corners.astype("<i4").view(np.uint8).reshape(-1, 12)
    leaves[:, 12:15] = 7
    leaves[:, 15] = 2
    leaves[:, 16:80] = np.packbits(blocks[places] > 0, axis=1, bitorder="little")
    leaves[:, 96:] = np.ascontiguousarray(blocks[places]).view(np.uint8)
    lower = np.zeros(LOWER_BYTES, np.uint8)
    lower[:24] = np.array([*origin, *(origin + 127)], "<i4").view(np.uint8)
    lower[544:1056] = np.packbits(is_leaf, bitorder="little")
    table = np.zeros(4096, "<i8")
    table[places] = (np.arange(len(places)) - len(places)) * LEAF_BYTES
    lower[1088:] = table.view(np.uint8)
    return leaves.tobytes(), lower.tobytes()


def write_cloud(path, mib):
    side = int(round((mib * 2 ** 20 / LEAF_BYTES / FILL) ** (1 / 3))) * 8
    random = np.random.default_rng(3)
    noises = [(smooth_noise(random, 64), 4, 0.5), (smooth_noise(random, 64), 1, 0.3)]
    regions = -(-side // 128)
    with NanovdbFile(path, side) as file:
        for key in np.ndindex(regions, regions, regions):
            origin = np.array(key) * 128
            values = density(noises, side, origin)
            for axis in range(3):  # Nothing beyond the cube.
                inside = np.arange(origin[axis], origin[axis] + 128) < side
                values *= inside.reshape([-1 if a == axis else 1 for a in range(3)])
            if values.any():
                file.add_region(key, *lower_and_leaves(values, origin))
    return os.path.getsize(path)


def run(*arguments):
    """The figures that the program prints."""
    return json.loads(subprocess.run(arguments, stdout=subprocess.PIPE, check=True).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bench")
    parser.add_argument("--mib", type=int, default=512)
    parser.add_argument("--budget-mib", type=int, default=128)
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--height", type=int, default=120)
    parser.add_argument("--folder")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or temporary
        os.makedirs(folder, exist_ok=True)
        volume, pages = (os.path.join(folder, name) for name in ("cloud.nvdb", "cloud.pages"))
        row = {"budget_mib": arguments.budget_mib}
        if not os.path.exists(volume):
            write_cloud(volume, arguments.mib)
        row["volume_mib"] = os.path.getsize(volume) >> 20
        if not os.path.exists(pages):
            row["pack"] = run(arguments.bench, "--pack", volume, pages)
        row["pages_mib"] = os.path.getsize(pages) >> 20
        for name, file in (("memory", volume), ("paged", pages)):
            scene = os.path.join(folder, name + ".pbrt")
            with open(scene, "w", encoding="ascii") as text:
                text.write(SCENE % {"file": os.path.basename(file), "width": arguments.width,
                                    "height": arguments.height})
            row[name] = run(arguments.bench, scene, str(arguments.samples),
                            str(arguments.budget_mib))
    memory, paged = row["memory"], row["paged"]
    row["same_sha256"] = memory["sha256"] == paged["sha256"]
    row["cpu_ratio"] = round(paged["cpu_seconds"] / memory["cpu_seconds"], 3)
    row["first_ratio"] = round(memory["first_tile_seconds"] / paged["first_tile_seconds"], 2)
    row["peak_of_budget"] = round(paged["peak_mib"] / arguments.budget_mib, 3)
    print(json.dumps(row, indent=1))
    sys.exit(0 if row["same_sha256"] else 1)


if __name__ == "__main__":
    main()
