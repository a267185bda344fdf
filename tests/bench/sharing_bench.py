#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what shared paths gain, as a table: docs/sharing.md.

    tests/bench/sharing_bench.py SHEAF [NAME ...] [--width 160] [--samples 8] [--seeds 2]

SHEAF is a build's program `sheaf`. Each scene of those names, or each, is rendered with paths that
count in one pixel, with `camera+sharing` and with `camera+sharing+views`, on one thread. Errors are
relMSE against an image of REFERENCE times the samples by camera+sharing+views, without the worst
hundredth of the pixels. CPU seconds are those of the frame's tasks, without loading. A gain is the
error times CPU seconds of paths in one pixel over that of shared ones: 2 means that an image of the
same error takes half the time. The last column is the gain of +views over +sharing alone.

Scenes of SHEAF_PUBLIC_SCENES are added if it is set. Needs Debian's python3-openimageio and
python3-numpy.
"""
import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile

import numpy
import OpenImageIO as oiio

from technique_regions import DARK, ROOT, shrink

REFERENCE = 16  # Times the samples.
REFERENCE_SEED = 1000
WORST = 0.01  # Fraction of the pixels that is left out.
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


def render(options, scene, path, samples, seed, techniques):
    """The CPU seconds of the frame."""
    arguments = [options.sheaf, "render", scene, "-o", path, "--samples", samples, "--seed", seed,
                 "--threads", 1, "--techniques", techniques, "--json"]
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{scene}, {techniques}: {done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])["progress"]["cpu_duration_seconds"]


def colors(path):
    image = oiio.ImageBuf(path)
    names = image.spec().channelnames
    pixels = image.get_pixels(oiio.FLOAT).astype(numpy.float64)
    return numpy.stack([pixels[..., names.index(c)] for c in "RGB"], axis=-1)


def error_of(image, reference):
    least = DARK * reference.mean(axis=(0, 1))
    relative = (image - reference) ** 2 / numpy.maximum(reference, least) ** 2
    errors = numpy.sort(relative.mean(axis=-1).ravel())
    return errors[:round(len(errors) * (1 - WORST))].mean()


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


def measure(options, scene, folder):
    """For each set of techniques: relMSE and CPU seconds."""
    path, reference = (os.path.join(folder, name) for name in ("image.exr", "reference.exr"))
    render(options, scene, reference, REFERENCE * options.samples, REFERENCE_SEED, TECHNIQUES[-1])
    results = []
    for techniques in TECHNIQUES:
        errors, seconds = [], []
        for seed in range(options.seeds):
            seconds.append(render(options, scene, path, options.samples, seed, techniques))
            errors.append(error_of(colors(path), colors(reference)))
        results.append((statistics.mean(errors), statistics.mean(seconds)))
    return results


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
            results = measure(options, small, folder)
        costs = [error * seconds for error, seconds in results]
        print(f"| {name} | " + ", ".join(f"{error:.3g}" for error, _ in results) + " | "
              + ", ".join(f"{seconds:.3g}" for _, seconds in results)
              + f" | {costs[0] / costs[1]:.2f} | {costs[0] / costs[2]:.2f} "
              f"| {costs[1] / costs[2]:.2f} |", flush=True)


if __name__ == "__main__":
    main()
