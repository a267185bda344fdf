#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Cost of true error bars: sixteen replicates against one sequence per pixel.

    SHEAF_BIN=build/release/bin tests/accuracy/one_sequence.py SCENE... [--samples 64] [--runs 4]
        [--reference-samples 4096] [--references FOLDER] [--crop X0,Y0,X1,Y1] [--check]

For every scene it renders a reference by one sequence with another seed, then images of several
seeds both ways, and prints the errors of replicates over those of one sequence, as relMSE and as
MSE. The error of the reference itself is included in both, which moves the ratios slightly towards
1. If emitter silhouettes are visible, a few samples in thousands of pixels dominate, and even forty
runs only show that neither method is better. With --check, exits with 1 if the median loss in
relMSE over the scenes is 10 % or more.
"""
import json
import os
import statistics
import sys
import tempfile

import target_error

LOSS_MAX = 0.1


def errors(scene, flags, options, folder, reference, *how):
    """Means over the runs of relMSE and MSE."""
    rows = []
    for seed in range(1, options.runs + 1):
        image = os.path.join(folder, "image.exr")
        target_error.render_frame(scene, flags, seed, image, "--samples", options.samples, *how)
        found = json.loads(target_error.run("compare", reference, image, "--json"))
        rows.append((found["relative_mse"], found["mse"]))
    return [statistics.mean(column) for column in zip(*rows)]


def measure(scene, options, folder):
    flags = target_error.crop_flags(options)
    reference, _ = target_error.make_reference(scene, options, folder,
                                               target_error.reference_samples(scene, options))
    apart = errors(scene, flags, options, folder, reference)
    whole = errors(scene, flags, options, folder, reference, "--one-sequence")
    print(f"{os.path.basename(scene)}: replicates over one sequence at {options.samples} samples: "
          f"relMSE {apart[0] / whole[0]:.2f} ({apart[0]:.5f} over {whole[0]:.5f}), "
          f"MSE {apart[1] / whole[1]:.2f}", flush=True)
    return apart[0] / whole[0]


def main():
    parser = target_error.make_parser(__doc__, target_error.REFERENCE_SAMPLES_MIN)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--runs", type=int, default=4)
    options = parser.parse_args()
    ratios = []
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            ratios.append(measure(scene, options, folder))
    print(f"{len(ratios)} scenes: {100 * (statistics.median(ratios) - 1):.0f} % more in the median")
    if options.check and statistics.median(ratios) - 1 >= LOSS_MAX:
        sys.exit(1)


if __name__ == "__main__":
    main()
