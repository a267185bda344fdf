#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what both eyes of a stereo frame cost, as a table: docs/stereo.md.

    tests/bench/stereo_bench.py SHEAF [SCENE EYE_DISTANCE,CONVERGENCE ...] [--width 120]
                                [--samples 32] [--seeds 3]

SHEAF is a build's program `sheaf`. Each scene is rendered as a stereo frame and from its own
camera alone. Errors are those of error_and_cost.py without the worst pixels, against images of
REFERENCE times the samples; the error of a stereo frame is that of both eyes. The price is error
times CPU seconds of both eyes over those of one alone: at equal error, two independent renders
cost 2.

Scenes of SHEAF_PUBLIC_SCENES are added if it is set and no scene is given. Needs Debian's
python3-openimageio and python3-numpy.
"""
import argparse
import os
import statistics
import tempfile

from error_and_cost import measure
from technique_regions import ROOT, shrink

SCENES = [("cornell-box", "0.3,6"), ("showroom", "0.065,3"), ("ajar", "0.1,4"),
          ("frosted", "0.1,4")]
PUBLIC = [("cornell-box/cornell-box-specular-small.pbrt", "0.05,3"),
          ("killeroos/killeroo-simple-small.pbrt", "10,400"),
          ("staircase2/staircase2-small.pbrt", "0.2,10"),
          ("veach-mis/veach-mis-small.pbrt", "0.5,20")]
REFERENCE = 16  # Times the samples.


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
            camera = ("--techniques", "camera")
            one, both = (measure(options, small, folder, REFERENCE, choice, [choice])[0]
                         for choice in (camera, (*camera, "--stereo", eyes)))
        prices.append(both.trimmed_error * both.cpu_seconds
                      / (one.trimmed_error * one.cpu_seconds))
        print(f"| {os.path.splitext(os.path.basename(scene))[0]} | {eyes} "
              f"| {one.trimmed_error:.3g}, {both.trimmed_error:.3g} "
              f"| {one.cpu_seconds:.3g}, {both.cpu_seconds:.3g} | {prices[-1]:.2f} |", flush=True)
    print(f"\nMedian: {statistics.median(prices):.2f}.")


if __name__ == "__main__":
    main()
