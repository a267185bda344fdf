#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints how much more efficient one program or choice of techniques is than another.

    tests/bench/technique_ratio.py BEFORE AFTER SCENE ... --techniques camera+light
        [--techniques-before NAME] [--samples 64] [--seeds 3] [--reference-samples N]

BEFORE and AFTER are programs `sheaf`, of two builds or the same one. Efficiency is relMSE times CPU
seconds of the process, with loading and training. Images are rendered in turns with the same number
of samples. The reference is rendered by AFTER with --reference-techniques and a seed of its own;
its noise makes both errors greater, so that a ratio looks nearer to 1 than it is.
"""
import argparse
import json
import os
import statistics
import tempfile

from techniques_page import REFERENCE_TECHNIQUES, number, render, run

REFERENCE_SEED = 1000


def error_of(sheaf, reference, image):
    return json.loads(run([sheaf, "compare", reference, image, "--json"]))["relative_mse"]


def measure(options, scene, folder):
    """Returns, for both programs, the list of (relMSE, CPU seconds) by seed."""
    reference = os.path.join(folder, "reference.exr")
    render(options.after, scene, options.reference_techniques, options.reference_samples,
           REFERENCE_SEED, reference)
    sides = [(options.before, options.techniques_before or options.techniques),
             (options.after, options.techniques)]
    found = [[], []]
    image = os.path.join(folder, "image.exr")
    for seed in range(1, options.seeds + 1):
        for side, (sheaf, techniques) in enumerate(sides):
            cpu_seconds = render(sheaf, scene, techniques, options.samples, seed, image)
            found[side].append((error_of(options.after, reference, image), cpu_seconds))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--techniques", required=True)
    parser.add_argument("--techniques-before")
    parser.add_argument("--reference-techniques", default=REFERENCE_TECHNIQUES)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--reference-samples", type=int, default=1024)
    options = parser.parse_args()
    print("| scene | relMSE before | after | CPU s before | after | ratio of relMSE | "
          "of relMSE x CPU |")
    print("|---|---|---|---|---|---|---|")
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            before, after = measure(options, scene, folder)
        errors = [statistics.mean(error for error, _ in side) for side in (before, after)]
        seconds = [statistics.median(cpu for _, cpu in side) for side in (before, after)]
        gain = errors[0] / errors[1]
        name = os.path.splitext(os.path.basename(scene))[0]
        print(f"| {name} | {number(errors[0])} | {number(errors[1])} | {seconds[0]:.2f} | "
              f"{seconds[1]:.2f} | {gain:.2f} | {gain * seconds[0] / seconds[1]:.2f} |", flush=True)


if __name__ == "__main__":
    main()
