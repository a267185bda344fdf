#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what both eyes of a stereo frame cost, as a table: docs/stereo.md.

    tests/bench/stereo_bench.py SHEAF [SCENE EYE_DISTANCE,CONVERGENCE ...] [--width 120]
                                [--samples 32] [--seeds 3]

SHEAF is a build's program `sheaf`. Each scene is rendered as a stereo frame and from its own
camera alone, on one thread. Errors are relMSE against images of 16 times the samples, without the
worst hundredth of the pixels: fireflies, and edges of lamps in view, are rare events that decide
the relMSE of so few samples by chance. The error of a stereo frame is that of both eyes. CPU
seconds are those of the frame's tasks, without loading. The price is error times CPU seconds of
both eyes over those of one alone: at equal error, two independent renders cost 2.

Scenes of SHEAF_PUBLIC_SCENES are added if it is set and no scene is given. Needs Debian's
python3-openimageio and python3-numpy.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

import numpy
import OpenImageIO as oiio

from technique_regions import DARK, ROOT, shrink

SCENES = [("cornell-box", "0.3,6"), ("showroom", "0.065,3"), ("ajar", "0.1,4"),
          ("frosted", "0.1,4")]
PUBLIC = [("cornell-box/cornell-box-specular-small.pbrt", "0.05,3"),
          ("killeroos/killeroo-simple-small.pbrt", "10,400"),
          ("staircase2/staircase2-small.pbrt", "0.2,10"),
          ("veach-mis/veach-mis-small.pbrt", "0.5,20")]
REFERENCE = 16  # Times the samples.
REFERENCE_SEED = 1000
WORST = 0.01  # Fraction of the pixels that are left out.


def run(options, *arguments):
    done = subprocess.run([options.sheaf, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))}: {done.stderr}")
    return done.stdout


def render(options, scene, path, samples, seed, *eyes):
    """The CPU seconds of the frame."""
    text = run(options, "render", scene, "-o", path, "--samples", samples, "--seed", seed,
               "--threads", 1, "--techniques", "camera", "--json", *eyes)
    return json.loads(text.splitlines()[-1])["progress"]["cpu_duration_seconds"]


def colors(path):
    """R, G and B of all views, side by side."""
    image = oiio.ImageBuf(path)
    names = image.spec().channelnames
    pixels = image.get_pixels(oiio.FLOAT).astype(numpy.float64)
    views = [view for view in ("", "right.") if view + "R" in names]
    return numpy.hstack([numpy.stack([pixels[..., names.index(view + c)] for c in "RGB"], axis=-1)
                         for view in views])


def error_of(image, reference):
    least = DARK * reference.mean(axis=(0, 1))
    relative = (image - reference) ** 2 / numpy.maximum(reference, least) ** 2
    errors = numpy.sort(relative.mean(axis=-1).ravel())
    return errors[:round(len(errors) * (1 - WORST))].mean()


def measure(options, scene, folder, *eyes):
    """Error times CPU seconds, and both."""
    path, reference = (os.path.join(folder, name) for name in ("image.exr", "reference.exr"))
    render(options, scene, reference, REFERENCE * options.samples, REFERENCE_SEED, *eyes)
    errors, seconds = [], []
    for seed in range(options.seeds):
        seconds.append(render(options, scene, path, options.samples, seed, *eyes))
        errors.append(error_of(colors(path), colors(reference)))
    return statistics.mean(errors), statistics.mean(seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--width", type=int, default=120)
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    scenes = list(zip(options.scenes[::2], options.scenes[1::2]))
    if not scenes:
        scenes = [(os.path.join(ROOT, "scenes", name if "." in name else name + ".pbrt"), eyes)
                  for name, eyes in SCENES]
        public = os.environ.get("SHEAF_PUBLIC_SCENES")
        scenes += [(os.path.join(public, name), eyes) for name, eyes in PUBLIC] if public else []
    print("| scene | eyes | relMSE of one, of both | CPU s of one, of both | both cost |")
    print("|---|---|---|---|---|")
    prices = []
    for scene, eyes in scenes:
        with tempfile.TemporaryDirectory() as folder:
            small = scene
            if scene.endswith(".pbrt"):
                small = shrink(scene, options.width, folder)
            error, seconds = measure(options, small, folder)
            both_error, both_seconds = measure(options, small, folder, "--stereo", eyes)
        prices.append(both_error * both_seconds / (error * seconds))
        print(f"| {os.path.splitext(os.path.basename(scene))[0]} | {eyes} | {error:.3g}, "
              f"{both_error:.3g} | {seconds:.3g}, {both_seconds:.3g} | {prices[-1]:.2f} |",
              flush=True)
    print(f"\nMedian: {statistics.median(prices):.2f}.")


if __name__ == "__main__":
    main()
