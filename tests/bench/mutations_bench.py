#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what chains of mutations gain, as a table: docs/mutations.md.

    tests/bench/mutations_bench.py SHEAF [NAME ...] [--width 96] [--samples 64] [--seeds 3]

SHEAF is a build's program `sheaf`. Each scene of those names, or each, is rendered with each set of
TECHNIQUES on one thread. Errors are relMSE against an image of REFERENCE times the samples by
light paths with merging and guided emission, of all pixels, and without the worst hundredth. CPU
seconds are those of the frame's tasks, with training, without loading. The gain is the error times
CPU seconds of the set over that of camera+mutations: below 1, mutations lose.

Needs Debian's python3-openimageio and python3-numpy.
"""
import argparse
import os
import statistics
import tempfile

import numpy

from sharing_bench import WORST, colors, render
from technique_regions import DARK, ROOT, shrink

REFERENCE = 32  # Times the samples.
REFERENCE_SEED = 1000
BEST = "camera+light+merging+emission-guiding"
TECHNIQUES = ("camera", "camera+light", "camera+light+emission-guiding", BEST)
SCENES = ("caustic", "pool", "pool-from-above", "shop-window", "ajar", "cornell-box")


def errors_of(image, reference):
    """relMSE of all pixels, and without the worst."""
    least = DARK * reference.mean(axis=(0, 1))
    relative = (image - reference) ** 2 / numpy.maximum(reference, least) ** 2
    errors = numpy.sort(relative.mean(axis=-1).ravel())
    return errors.mean(), errors[:round(len(errors) * (1 - WORST))].mean()


def measure(options, scene, folder):
    """For each set of techniques: both errors and CPU seconds."""
    path, reference = (os.path.join(folder, name) for name in ("image.exr", "reference.exr"))
    render(options, scene, reference, REFERENCE * options.samples, REFERENCE_SEED, BEST)
    expected = colors(reference)
    results = {}
    for techniques in ("camera+mutations", *TECHNIQUES):
        rows = []
        for seed in range(options.seeds):
            seconds = render(options, scene, path, options.samples, seed, techniques)
            rows.append((*errors_of(colors(path), expected), seconds))
        results[techniques] = [statistics.mean(column) for column in zip(*rows)]
    return results


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="NAME")
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    print("| scene | techniques | relMSE | without the worst | CPU s | gain of mutations "
          "| without the worst |")
    print("|---|---|---|---|---|---|---|")
    for name in options.scenes or SCENES:
        with tempfile.TemporaryDirectory() as folder:
            scene = shrink(os.path.join(ROOT, "scenes", name + ".pbrt"), options.width, folder)
            results = measure(options, scene, folder)
        mutated = results["camera+mutations"]
        for techniques, (error, trimmed, seconds) in results.items():
            gains = ("", "") if techniques == "camera+mutations" else tuple(
                f"{value * seconds / (own * mutated[2]):.2f}"
                for value, own in ((error, mutated[0]), (trimmed, mutated[1])))
            print(f"| {'' if gains[0] else name} | {techniques} | {error:.3g} "
                  f"| {trimmed:.3g} | {seconds:.3g} | {gains[0]} | {gains[1]} |", flush=True)


if __name__ == "__main__":
    main()
