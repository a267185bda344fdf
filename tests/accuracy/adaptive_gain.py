#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Gain of adaptive sampling.

    SHEAF_BIN=build/release/bin tests/accuracy/adaptive_gain.py SCENE... [--target 0.01] [--runs 3]
        [--reference-samples 4096] [--references FOLDER] [--crop X0,Y0,X1,Y1] [--check]

For every scene it renders a reference as target_error.py does, the target itself (adaptive), and
images with the same samples in every pixel (uniform), with about as many as the target took and
twice as many. From the line through these two on a log-log scale it computes the CPU time at which
a uniform image has the same true error as the adaptive one. Prints that time over the adaptive
image's time for each run; processes run one after the other. With --check, exits with 1 if the
median over the scenes is below 1.3 or a scene's median is below 1 / 1.05.
"""
import math
import os
import statistics
import sys
import tempfile
import typing

import target_error

GAIN_MIN, LOSS_MAX = 1.3, 1.05
STEP = 16  # Uniform images have equal samples in each replicate, which is optimal.


class Spent(typing.NamedTuple):
    cpu_seconds: float
    wall_seconds: float
    error: float
    samples: float


def cost_at(error, few, many, of):
    """CPU time of a uniform image with this error, by the line through two on a log-log scale."""
    slope = math.log(of(many) / of(few)) / math.log(many.error / few.error)
    return of(few) * math.exp(slope * math.log(error / few.error))


def cost_and_error(scene, flags, seed, folder, reference, left, *how):
    path = os.path.join(folder, "image.exr")
    frame = target_error.render_frame(scene, flags, seed, path, *how)
    error = target_error.relative_mse(reference, path) - left
    progress = frame["progress"]
    return Spent(progress["cpu_duration_seconds"], progress["wall_duration_seconds"], error,
                 progress["sample_count_done"] / target_error.pixel_count(frame))


def measure(scene, options, folder):
    flags = target_error.crop_flags(options)
    reference, left, _ = target_error.render_reference(scene, options, folder, options.target)
    gains = []
    for seed in range(1, options.runs + 1):
        def spend(*how, seed=seed):
            return cost_and_error(scene, flags, seed, folder, reference, left, *how)
        adaptive = spend("--target-error", options.target)
        count = STEP * max(1, round(adaptive.samples / STEP))
        few, many = spend("--samples", count), spend("--samples", 2 * count)
        cpu, wall = (cost_at(adaptive.error, few, many, of) / of(adaptive)
                     for of in (lambda s: s.cpu_seconds, lambda s: s.wall_seconds))
        gains.append((cpu, wall))
        print(f"{os.path.basename(scene)}: true error {adaptive.error:.5f} at "
              f"{adaptive.samples:.0f} samples, {adaptive.cpu_seconds:.2f} CPU s, "
              f"{adaptive.wall_seconds:.2f} s; uniform {few.error:.5f} at {count}, "
              f"{many.error:.5f} at {2 * count}: {cpu:.2f} times the CPU time, {wall:.2f} the time",
              flush=True)
    return [statistics.median(column) for column in zip(*gains)]


def main():
    parser = target_error.make_parser(__doc__, target_error.REFERENCE_SAMPLES_MIN)
    parser.add_argument("--target", type=float, default=0.01)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    gains = []
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            gains.append(measure(scene, options, folder))
    for what, column in zip(("CPU time", "time"), zip(*gains)):
        print(f"{len(column)} scenes: uniform takes {statistics.median(column):.2f} times the "
              f"{what} in the median, at least {min(column):.2f}")
    cpu = [gain for gain, _ in gains]
    if options.check and (statistics.median(cpu) < GAIN_MIN or min(cpu) < 1 / LOSS_MAX):
        sys.exit(1)


if __name__ == "__main__":
    main()
