#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what chains of mutations gain, as a table: docs/mutations.md.

    tests/bench/mutations_bench.py SHEAF [NAME ...] [--width 96] [--samples 64] [--seeds 3]

SHEAF is a build's program `sheaf`. Each scene of those names, or each, is rendered with each set of
TECHNIQUES. Errors are those of error_and_cost.py against an image of REFERENCE times the samples by
light paths with merging and guided emission. The gain is the error times CPU seconds of the set
over that of camera+mutations: below 1, mutations lose.

Needs Debian's python3-openimageio and python3-numpy.
"""
from gain_table import print_gains

REFERENCE = 32  # Times the samples.
BEST = "camera+light+merging+emission-guiding"
TECHNIQUES = ("camera+mutations", "camera", "camera+light", "camera+light+emission-guiding", BEST)
SCENES = ("caustic", "pool", "pool-from-above", "shop-window", "ajar", "cornell-box")


if __name__ == "__main__":
    print_gains(__doc__.splitlines()[0], "mutations", TECHNIQUES, (BEST, REFERENCE), SCENES)
