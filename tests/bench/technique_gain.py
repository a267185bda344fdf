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
frame does not notice. Where auto keeps camera paths, both images are the same: their error is not
measured, and the gain is the ratio of times. Camera paths cannot find some of the light of scenes
with a star: their image is another one, and the summary leaves these scenes out. Scenes of
SHEAF_PUBLIC_SCENES are added if it is set.
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
    """Returns the name of auto's techniques, whether camera paths find all light, and by image the
    relMSE and the CPU seconds. The relMSE is None where no image can differ.
    """
    plan = json.loads(run([sheaf, "plan", scene, "--measure", "--measure-seconds", "0.5",
                           "--samples", str(options.samples), "--json"]))
    measured = plan["measurement"]["techniques"]
    chosen, is_whole = measured["best"], measured["only_light_share"] == 0
    reference = os.path.join(folder, "reference.exr")
    differs = chosen != "camera"
    if differs:
        render(sheaf, scene, chosen, options.samples * options.reference_factor, 2, reference)
    images = {}
    for techniques in ("camera", "auto", chosen):
        if techniques in images:
            continue
        out = os.path.join(folder, "image.exr")
        cpu_seconds = render(sheaf, scene, techniques, options.samples, 1, out)
        error = None
        if differs:
            compared = json.loads(run([sheaf, "compare", reference, out, "--json"]))
            error = compared["relative_mse"]
        images[techniques] = (error, cpu_seconds)
    return chosen, is_whole, images


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
            chosen, is_whole, images = measure(options.sheaf, scene, options, folder)
        product = {techniques: (error or 1) * seconds
                   for techniques, (error, seconds) in images.items()}
        gain = (product["camera"] / product["auto"], product["camera"] / product[chosen])
        if is_whole:
            gains.append(gain)
        values = images["camera"] + images["auto"] + gain
        cells = ["the same" if value is None else number(value) for value in values]
        print(f"| {name}{'' if is_whole else '*'} | {chosen} | {' | '.join(cells)} |", flush=True)
    for column, label in enumerate(("gain", "chosen") if gains else ()):
        values = [gain[column] for gain in gains]
        print(f"\n{label}: median {number(statistics.median(values))}, worst "
              f"{number(min(values))}")


if __name__ == "__main__":
    main()
