#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what chains through smooth interfaces gain, as a table: docs/adr/0210-chains.md.

    tests/bench/chains_bench.py SHEAF [NAME ...] [--width 96] [--samples 64] [--seeds 3]

SHEAF is a build's program `sheaf`. Each scene of those names, or each, is rendered with each set of
TECHNIQUES. Errors are those of error_and_cost.py against an image of REFERENCE times the samples by
chains, the only technique without bias that finds all light of small lamps. The gain is the error
times CPU seconds of the set over that of camera+chains: below 1, chains lose.

Needs Debian's python3-openimageio and python3-numpy.
"""
from gain_table import print_gains

REFERENCE = 16  # Times the samples.
CHAINS = "camera+chains"
TECHNIQUES = (CHAINS, "camera", "camera+light")
SCENES = ("caustic", "pool", "pool-from-above")


if __name__ == "__main__":
    print_gains(__doc__.splitlines()[0], "chains", TECHNIQUES, (CHAINS, REFERENCE), SCENES)
