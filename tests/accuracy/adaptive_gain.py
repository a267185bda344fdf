#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""What it saves to give samples where they are needed.

    SHEAF_BIN=build/dev/bin tests/accuracy/adaptive_gain.py SCENE... [--target 0.01] [--runs 3]
        [--reference-samples 4096] [--references FOLDER] [--crop X0,Y0,X1,Y1] [--check]

Of every scene it renders a reference as target_error.py does, the target itself (adaptive), and
pictures with the same samples in every pixel (uniform), about as many as the target took and twice
that; then works out, by the line through the two on a log-log scale, the CPU time with which a
uniform picture has the same true error as the adaptive one. Prints that time over the adaptive
one's, of each run, in one process after the other. With --check, exits with 1 where the median over
the scenes is below 1.3 or a scene's median below 1 / 1.05.
"""
import math
import os
import statistics
import sys
import tempfile

import target_error

GAIN_MIN, LOSS_MAX = 1.3, 1.05


def cost_and_error(scene, flags, seed, folder, reference, left, *how):
    path = os.path.join(folder, "image.exr")
    frame = target_error.render_frame(scene, flags, seed, path, *how)
    error = target_error.relative_mse(reference, path) - left
    return (frame["progress"]["cpu_duration_seconds"], error,
            frame["progress"]["sample_count_done"] / target_error.pixel_count(frame))


def measure(scene, options, folder):
    flags = target_error.crop_flags(options)
    reference, left, _ = target_error.render_reference(scene, options, folder, options.target)
    gains = []
    for seed in range(1, options.runs + 1):
        adaptive, error, samples = cost_and_error(scene, flags, seed, folder, reference, left,
                                                  "--target-error", options.target)
        few = max(16, int(samples))
        cost1, error1, _ = cost_and_error(scene, flags, seed, folder, reference, left,
                                          "--samples", few)
        cost2, error2, _ = cost_and_error(scene, flags, seed, folder, reference, left,
                                          "--samples", 2 * few)
        slope = math.log(cost2 / cost1) / math.log(error2 / error1)
        uniform = cost1 * math.exp(slope * math.log(error / error1))
        gains.append(uniform / adaptive)
        print(f"{os.path.basename(scene)}: true error {error:.5f} at {samples:.0f} samples, "
              f"{adaptive:.2f} CPU s; uniform {error1:.5f} at {few}, {error2:.5f} at {2 * few}: "
              f"{uniform:.2f} CPU s, {gains[-1]:.2f} times as much", flush=True)
    return statistics.median(gains)


def main():
    parser = target_error.make_parser(__doc__, target_error.REFERENCE_SAMPLES_MIN)
    parser.add_argument("--target", type=float, default=0.01)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    gains = []
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            gains.append(measure(scene, options, folder))
    print(f"{len(gains)} scenes: uniform takes {statistics.median(gains):.2f} times as long in the "
          f"median, at least {min(gains):.2f}")
    if options.check and (statistics.median(gains) < GAIN_MIN or min(gains) < 1 / LOSS_MAX):
        sys.exit(1)


if __name__ == "__main__":
    main()
