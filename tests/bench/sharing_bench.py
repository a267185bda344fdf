#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what shared paths gain, as a table: docs/sharing.md.

    tests/bench/sharing_bench.py SHEAF [NAME ...] [--width 160] [--samples 8] [--seeds 2]

SHEAF is a build's program `sheaf`. Each scene of those names, or each, is rendered with paths that
count in one pixel, with `camera+sharing` and with `camera+sharing+views`. Errors are those of
error_and_cost.py without the worst pixels, against an image of REFERENCE times the samples by
camera+sharing+views. A gain is the error times CPU seconds of paths in one pixel over that of
shared ones: 2 means that an image of the same error takes half the time. The last column is the
gain of +views over +sharing alone.

Scenes of SHEAF_PUBLIC_SCENES are added if it is set. Needs Debian's python3-openimageio and
python3-numpy.
"""
import argparse
import os
import shutil
import sys
import tempfile

from error_and_cost import measure
from technique_regions import ROOT, shrink

REFERENCE = 16  # Times the samples.
TECHNIQUES = ("camera", "camera+sharing", "camera+sharing+views")

REPLACED = {  # In the text of scenes.
    "fov of cornell-box": '"float fov" 28.2',
    "camera of cornell-box": "LookAt 0 1 -4.9   0 1 0   0 1 0",
    "fov of frosted": '"float fov" 32',
    "camera of the turntable": "LookAt 0 2.5 -7.4   0 0.92 0   0 1 0",
    "vase of the turntable": "Rotate 0 0 1 0",
}
MOTION = " ActiveTransform EndTime {} ActiveTransform All"
# A name, a scene, what of REPLACED is changed in it, and what is added there.
SCENES = [("showroom", "showroom.pbrt", None, ""),
          ("lens", "lens.pbrt", None, ""),
          ("cornell-box", "cornell-box.pbrt", None, ""),
          ("cornell-box, lens of 0.6", "cornell-box.pbrt", "fov of cornell-box",
           ' "float lensradius" 0.6 "float focaldistance" 3.9'),
          ("frosted, lens of 0.3", "frosted.pbrt", "fov of frosted",
           ' "float lensradius" 0.3 "float focaldistance" 6'),
          ("cornell-box, camera in motion", "cornell-box.pbrt", "camera of cornell-box",
           MOTION.format("Translate 0.5 0 0")),
          ("turntable, camera in motion", "turntable/turntable.0001.pbrt",
           "camera of the turntable", MOTION.format("Rotate 6 0 1 0")),
          ("turntable, vase in motion", "turntable/turntable.0001.pbrt", "vase of the turntable",
           MOTION.format("Rotate 15 0 1 0"))]
PUBLIC = [("killeroo-moving", "killeroos/killeroo-moving-small.pbrt", None, ""),
          ("killeroo-simple", "killeroos/killeroo-simple-small.pbrt", None, ""),
          ("staircase2", "staircase2/staircase2-small.pbrt", None, "")]


def prepared(scene, changed, addition, width, folder):
    """The scene, perhaps changed, as an image of the width. Beside the original's files."""
    if changed is not None:
        copy = os.path.join(folder, "scene")
        shutil.copytree(os.path.dirname(scene), copy)
        found = 0
        for name in os.listdir(copy):
            if not name.endswith(".pbrt"):
                continue
            path = os.path.join(copy, name)
            with open(path, encoding="utf-8") as f:
                text = f.read()
            found += REPLACED[changed] in text
            with open(path, "w", encoding="utf-8") as f:
                f.write(text.replace(REPLACED[changed], REPLACED[changed] + addition))
        if found == 0:
            sys.exit(f"{scene}: has no {REPLACED[changed]}")
        scene = os.path.join(copy, os.path.basename(scene))
    return shrink(scene, width, folder)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="NAME")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    places = [(os.path.join(ROOT, "scenes"), SCENES)]
    if "SHEAF_PUBLIC_SCENES" in os.environ:
        places.append((os.environ["SHEAF_PUBLIC_SCENES"], PUBLIC))
    scenes = [(name, os.path.join(folder, path), *change)
              for folder, known in places for name, path, *change in known
              if not options.scenes or name in options.scenes]
    print("| scene | relMSE of one, sharing, views | CPU s of one, sharing, views "
          "| gain of sharing | gain of sharing+views | of views alone |")
    print("|---|---|---|---|---|---|")
    for name, scene, changed, addition in scenes:
        with tempfile.TemporaryDirectory() as folder:
            small = prepared(scene, changed, addition, options.width, folder)
            choices = [("--techniques", techniques) for techniques in TECHNIQUES]
            results = measure(options, small, folder, REFERENCE, choices[-1], choices)
        costs = [r.trimmed_error * r.cpu_seconds for r in results]
        print(f"| {name} | " + ", ".join(f"{r.trimmed_error:.3g}" for r in results) + " | "
              + ", ".join(f"{r.cpu_seconds:.3g}" for r in results)
              + f" | {costs[0] / costs[1]:.2f} | {costs[0] / costs[2]:.2f} "
              f"| {costs[1] / costs[2]:.2f} |", flush=True)


if __name__ == "__main__":
    main()
