#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what --denoise gains, and how well it knows its error, as a table.

    tests/bench/denoise.py SHEAF [--public FOLDER] [--samples 16] [--reference-samples 512]
                           [--crop 192x128] [--scene NAME ...] [--keep FOLDER]

SHEAF is a build's program `sheaf`. Renders the middle of the scenes of scenes/, and of the *-small
scenes of FOLDER, twice: with --denoise, and as a reference with another seed and more samples. The
reference's own noise, known from its standard errors, is subtracted from squared errors. Needs
Debian's python3-openimageio and python3-numpy.
"""
import argparse
import glob
import os
import re
import statistics
import subprocess
import sys
import tempfile

import numpy
import OpenImageIO as oiio

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SECONDS_MAX = 7200  # For one image.
SEED, REFERENCE_SEED = 11, 77
DARK = 0.1  # Dark pixels count against this fraction of the mean.


def scenes_of(public):
    own = sorted(glob.glob(os.path.join(ROOT, "scenes", "*.pbrt")))
    return own + (sorted(glob.glob(os.path.join(public, "*", "*-small.pbrt"))) if public else [])


def crop_of(sheaf, scene, size):
    """The arguments that render the middle of the scene: none where it is smaller."""
    text = open(scene, encoding="utf-8").read()
    sizes = [re.search(rf'"integer {axis}resolution"\s*\[?\s*(\d+)', text) for axis in "xy"]
    full = [int(size_of[1]) if size_of else 0 for size_of in sizes]
    first = [max(0, (whole - part) // 2) for whole, part in zip(full, size)]
    last = [min(whole, begin + part) for whole, begin, part in zip(full, first, size)]
    return ["--crop", ",".join(map(str, first + last))] if all(full) else []


def render(sheaf, scene, target, *arguments):
    if os.path.exists(target):
        return
    command = [sheaf, "render", scene, "-o", target, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_MAX)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])


def channels(path):
    image = oiio.ImageBuf(path)
    names = image.spec().channelnames
    pixels = image.get_pixels(oiio.FLOAT).astype(numpy.float64)
    told = image.spec().getattribute("sheaf:denoisedMse")
    return {name: pixels[..., i] for i, name in enumerate(names)}, told


def color(planes, layer=""):
    return numpy.stack([planes[layer + c] for c in "RGB"])


def measure(path, reference):
    """Gains of the mean squared error, and of relMSE, and expected over true error."""
    planes, told = channels(path)
    truth_planes, _ = channels(reference)
    truth, noise = color(truth_planes), color(truth_planes, "stderr.") ** 2
    raw, denoised = ((color(planes, layer) - truth) ** 2 - noise for layer in ("", "denoised."))
    weight = 1 / (truth ** 2 + (DARK * truth.mean()) ** 2)
    return (raw.mean() / denoised.mean(), (raw * weight).mean() / (denoised * weight).mean(),
            float(told) / denoised.mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("--public")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--reference-samples", type=int, default=512)
    parser.add_argument("--crop", default="192x128")
    parser.add_argument("--scene", nargs="*", default=[])
    parser.add_argument("--keep")
    arguments = parser.parse_args()
    size = [int(part) for part in arguments.crop.split("x")]
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or temporary
        os.makedirs(folder, exist_ok=True)
        print("| scene | MSE, times lower | relMSE, times lower | expected / true MSE |\n"
              "|---|---|---|---|")
        for scene in scenes_of(arguments.public):
            name = os.path.splitext(os.path.basename(scene))[0]
            if arguments.scene and name not in arguments.scene:
                continue
            image, reference = (os.path.join(folder, f"{name}.{kind}.exr")
                                for kind in (arguments.samples, "reference"))
            crop = crop_of(arguments.sheaf, scene, size)
            try:
                render(arguments.sheaf, scene, image, "--samples", arguments.samples, "--seed",
                       SEED, "--denoise", *crop)
                render(arguments.sheaf, scene, reference, "--samples",
                       arguments.reference_samples, "--seed", REFERENCE_SEED, *crop)
            except (RuntimeError, subprocess.TimeoutExpired) as error:
                print(f"{name}: {error}", file=sys.stderr)
                continue
            rows.append(measure(image, reference))
            print("| {} | {:.2f} | {:.2f} | {:.2f} |".format(name, *rows[-1]), flush=True)
    if rows:
        medians = [statistics.median(column) for column in zip(*rows)]
        print("| median | {:.2f} | {:.2f} | {:.2f} |".format(*medians))


if __name__ == "__main__":
    main()
