#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints certified bounds beside estimates, and how often they are missed: docs/certificate.md.

    tests/bench/certificate_bench.py SHEAF [--stops N] [--samples 64]

SHEAF is a build's program `sheaf`. Each scene is rendered once in its full size with three clamps:
the table has the estimated error, its bound of 95 %, the certified bound, and the clamp over the
standard deviation of a sample (root mean square over the pixels). Then small crops are rendered
N times with seeds of their own and end at a certified target; their errors are those against an
image of 64 times the samples. A miss is a true error above the certified bound.
"""
import argparse
import json
import os
import subprocess
import tempfile

import numpy
import OpenImageIO as oiio

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCENES = {"cornell-box": "100,100,148,132", "lens": "100,100,148,132",
          "principled": "100,100,148,132", "showroom": "270,150,318,182"}
CLAMPS = (1, 4, 16)  # Times the mean of the image.


def render(sheaf, scene, path, *arguments):
    done = subprocess.run([sheaf, "render", scene, "-o", path, "--json", "--color", "rgb",
                           "--techniques", "camera", *map(str, arguments)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])["frames"][0]


def pixels(path, names=("R", "G", "B")):
    image = oiio.ImageBuf(path)
    channels = image.spec().channelnames
    data = image.get_pixels(oiio.FLOAT)
    return numpy.stack([data[..., channels.index(n)] for n in names], -1).astype(float)


def relative_mse(image, truth):
    floor = 0.1 * truth.mean()
    return float((((image - truth) ** 2) / (truth**2 + floor**2)).mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sheaf")
    parser.add_argument("--stops", type=int, default=25)
    parser.add_argument("--samples", type=int, default=64)
    arguments = parser.parse_args()
    print(f"{'scene':14}{'clamp':>8}{'in sigma':>9}{'estimate':>10}{'bound':>10}{'certified':>10}"
          f"{'stops':>7}{'missed':>7}")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "image.exr")
        for name, crop in SCENES.items():
            scene = os.path.join(ROOT, "scenes", name + ".pbrt")
            if not os.path.exists(scene):
                print(f"{name}: not in scenes/")
                continue
            render(arguments.sheaf, scene, path, "--samples", 16)
            mean = pixels(path).mean()
            for times in CLAMPS:
                clamp = round(times * mean, 6)
                frame = render(arguments.sheaf, scene, path, "--samples", arguments.samples,
                               "--clamp", clamp)
                last = frame["rounds"][-1]
                error = pixels(path, ("stderr.R", "stderr.G", "stderr.B"))
                sigma = numpy.sqrt((error**2).mean() * arguments.samples)
                missed = stops = 0
                if times == CLAMPS[0]:
                    small = ("--crop", crop, "--clamp", clamp)
                    render(arguments.sheaf, scene, path, *small, "--samples",
                           64 * arguments.samples, "--seed", 1)
                    truth = pixels(path)
                    for seed in range(arguments.stops):
                        frame = render(arguments.sheaf, scene, path, *small, "--samples",
                                       arguments.samples, "--seed", 1000 + seed)
                        bound = frame["rounds"][-1]["certified_relative_mse"]
                        stops += 1
                        missed += relative_mse(pixels(path), truth) > bound > 0
                print(f"{name:14}{clamp:8.3g}{clamp / sigma:9.1f}{last['relative_mse']:10.2e}"
                      f"{last['relative_mse_upper']:10.2e}{last['certified_relative_mse']:10.2e}"
                      f"{stops:7}{missed:7}", flush=True)


if __name__ == "__main__":
    main()
