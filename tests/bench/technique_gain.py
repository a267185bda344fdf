#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints how much more efficient `--techniques auto` is than camera paths, scene by scene.

    tests/bench/technique_gain.py SHEAF [SCENE ...] [--samples 64] [--reference-factor 8]

SHEAF is a build's program `sheaf`. Both images have the same number of samples. Efficiency is
relMSE times CPU seconds of the process, with the small images by which auto chooses, and with the
training of guided frames. The reference has --reference-factor times the samples, a seed of its own
and the techniques that auto chose; its noise makes both errors greater, so that a gain looks
smaller than it is. `chosen` is the ratio without the time in which auto chooses, which a longer
frame does not notice. Scenes of SHEAF_PUBLIC_SCENES are added if it is set.
"""
import argparse
import json
import os
import statistics
import tempfile

from techniques_page import PUBLIC, ROOT, SCENES, number, render, run

MORE_SCENES = [(name, f"scenes/{name}.pbrt") for name in
               ("cloud", "fire", "insides", "lens", "principled")]
MORE_PUBLIC = [
    ("cornell-box (public)", "cornell-box/cornell-box-small.pbrt"),
    ("killeroo-moving", "killeroos/killeroo-moving-small.pbrt"),
    ("material-testball", "material-testball/material-testball-small.pbrt"),
    ("staircase2", "staircase2/staircase2-small.pbrt"),
    ("teapot-cloud", "teapot-cloud/teapot_cloud-small.pbrt"),
]


def measure(sheaf, scene, options, folder):
    """Returns the name of auto's techniques, and by image the relMSE and the CPU seconds."""
    plan = json.loads(run([sheaf, "plan", scene, "--measure", "--measure-seconds", "0.5",
                           "--samples", str(options.samples), "--json"]))
    chosen = plan["measurement"]["techniques"]["best"]
    reference = os.path.join(folder, "reference.exr")
    render(sheaf, scene, chosen, options.samples * options.reference_factor, 2, reference)
    images = {}
    for techniques in ("camera", "auto", chosen):
        if techniques in images:
            continue
        out = os.path.join(folder, "image.exr")
        cpu_seconds = render(sheaf, scene, techniques, options.samples, 1, out)
        compared = json.loads(run([sheaf, "compare", reference, out, "--json"]))
        images[techniques] = (compared["relative_mse"], cpu_seconds)
    return chosen, images


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these names")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--reference-factor", type=int, default=8)
    options = parser.parse_args()
    scenes = [(name, os.path.join(ROOT, path)) for name, path in SCENES + MORE_SCENES]
    if public := os.environ.get("SHEAF_PUBLIC_SCENES", ""):
        scenes += [(name, os.path.join(public, path)) for name, path in PUBLIC + MORE_PUBLIC]
    print("| scene | auto | relMSE of camera paths | CPU s | relMSE of auto | CPU s | gain "
          "| chosen |\n|---|---|---|---|---|---|---|---|", flush=True)
    gains = []
    for name, scene in scenes:
        if options.scenes and name not in options.scenes:
            continue
        with tempfile.TemporaryDirectory() as folder:
            chosen, images = measure(options.sheaf, scene, options, folder)
        product = {techniques: error * seconds for techniques, (error, seconds) in images.items()}
        gains.append((product["camera"] / product["auto"], product["camera"] / product[chosen]))
        cells = [number(value) for value in images["camera"] + images["auto"] + gains[-1]]
        print(f"| {name} | {chosen} | {' | '.join(cells)} |", flush=True)
    for column, label in enumerate(("gain", "chosen")):
        values = [gain[column] for gain in gains]
        print(f"\n{label}: median {number(statistics.median(values))}, worst "
              f"{number(min(values))}")


if __name__ == "__main__":
    main()
