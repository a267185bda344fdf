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
import argparse
import os
import tempfile

from error_and_cost import measure
from technique_regions import ROOT, shrink

REFERENCE = 16  # Times the samples.
CHAINS = "camera+chains"
TECHNIQUES = (CHAINS, "camera", "camera+light")
SCENES = ("caustic", "pool", "pool-from-above")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="NAME")
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    print("| scene | techniques | relMSE | without the worst | CPU s | gain of chains "
          "| without the worst |")
    print("|---|---|---|---|---|---|---|")
    for name in options.scenes or SCENES:
        with tempfile.TemporaryDirectory() as folder:
            scene = shrink(os.path.join(ROOT, "scenes", name + ".pbrt"), options.width, folder)
            results = measure(options, scene, folder, REFERENCE, ("--techniques", CHAINS),
                              [("--techniques", techniques) for techniques in TECHNIQUES])
        chained = results[0]
        for techniques, (error, trimmed, seconds) in zip(TECHNIQUES, results):
            gains = ("", "") if techniques == CHAINS else tuple(
                f"{value * seconds / (own * chained.cpu_seconds):.2f}"
                for value, own in zip((error, trimmed), chained))
            print(f"| {'' if gains[0] else name} | {techniques} | {error:.3g} "
                  f"| {trimmed:.3g} | {seconds:.3g} | {gains[0]} | {gains[1]} |", flush=True)


if __name__ == "__main__":
    main()
