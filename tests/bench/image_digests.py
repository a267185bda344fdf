#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""SHA-256 of the pixels of small images of many scenes, to show that a change alters no bit.

    tests/bench/image_digests.py SHEAF [OTHER_SHEAF]

SHEAF is a build's program `sheaf`. Renders our scenes, and those of SHEAF_PUBLIC_SCENES if it is
set, in RGB and in spectral color, and one in rounds, and prints a digest for each image. With
OTHER_SHEAF, renders all with both programs and exits with 1 if a digest differs.
"""
import json
import os
import subprocess
import sys
import tempfile

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes")
PUBLIC = os.environ.get("SHEAF_PUBLIC_SCENES", "")
OUTPUTS = ["--aov", "position,normal-shading", "--light-paths"]
# Name, scene, options. Crops keep the parts that use the most effects.
IMAGES = [
    ("cornell-box", "cornell-box.pbrt", ["--samples", "16"]),
    ("cornell-box in rounds", "cornell-box.pbrt",
     ["--samples", "256", "--target-error", "0.01", "--crop", "0,0,128,128"]),
    ("cornell-box, spectral", "cornell-box.pbrt", ["--samples", "8", "--color", "spectral"]),
    ("cloud", "cloud.pbrt", ["--samples", "4"]),
    ("fire", "fire.pbrt", ["--samples", "4"] + OUTPUTS),
    ("fog-room", "fog-room.pbrt", ["--samples", "4"]),
    ("fog-room, spectral", "fog-room.pbrt", ["--samples", "4", "--color", "spectral"]),
    ("insides", "insides.pbrt", ["--samples", "4"]),
    ("insides, generic", "insides.pbrt", ["--samples", "2", "--generic"]),
    ("caustic", "caustic.pbrt", ["--samples", "4"]),
    ("ajar", "ajar.pbrt", ["--samples", "4"]),
    ("pool", "pool.pbrt", ["--samples", "4"]),
    ("frosted", "frosted.pbrt", ["--samples", "4"]),
    ("lens", "lens.pbrt", ["--samples", "4"]),
    ("showroom", "showroom.pbrt", ["--samples", "4"] + OUTPUTS),
    ("showroom, spectral", "showroom.pbrt", ["--samples", "4", "--color", "spectral"]),
]
PUBLIC_IMAGES = [
    ("killeroo-simple", "killeroos/killeroo-simple-small.pbrt", ["--samples", "8"]),
    ("killeroo-moving", "killeroos/killeroo-moving-small.pbrt", ["--samples", "4"]),
    ("killeroo-coated-gold", "killeroos/killeroo-coated-gold.pbrt",
     ["--samples", "4", "--crop", "300,200,500,400"]),
    ("material-testball", "material-testball/material-testball-small.pbrt", ["--samples", "4"]),
    ("veach-mis", "veach-mis/veach-mis-small.pbrt", ["--samples", "4"]),
    ("staircase2", "staircase2/staircase2-small.pbrt", ["--samples", "4"]),
    ("teapot-cloud", "teapot-cloud/teapot_cloud-small.pbrt",
     ["--samples", "2", "--crop", "100,60,200,140"]),
    ("cornell-box-specular, spectral", "cornell-box/cornell-box-specular-small.pbrt",
     ["--samples", "4", "--color", "spectral"]),
    ("volumetric-caustic", "cornell-box/volumetric-caustic.pbrt",
     ["--samples", "2", "--crop", "100,100,200,200"]),
]


def digest(sheaf, scene, options):
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "image.exr")
        for command in ([sheaf, "render", scene, "-o", out] + options,
                        [sheaf, "show", "--json", out]):
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit("%s failed:\n%s" % (" ".join(command), done.stderr[-2000:]))
    shown = json.loads(done.stdout.strip().split("\n")[-1])
    return shown.get("image_digest") or shown["picture_digest"]


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    images = [(name, os.path.join(SCENES, scene), options) for name, scene, options in IMAGES]
    if PUBLIC:
        images += [(name, os.path.join(PUBLIC, scene), options)
                   for name, scene, options in PUBLIC_IMAGES]
    differ = 0
    for name, scene, options in images:
        found = [digest(sheaf, scene, options) for sheaf in sys.argv[1:]]
        verdict = "" if len(set(found)) == 1 else "  DIFFERS from " + found[-1]
        differ += len(set(found)) - 1
        print("%-32s %s%s" % (name, found[0], verdict), flush=True)
    sys.exit(1 if differ else 0)


if __name__ == "__main__":
    main()
