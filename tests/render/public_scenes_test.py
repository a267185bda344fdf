#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Pictures of public scenes against pictures another renderer made of them.

Needs SHEAF_PUBLIC_SCENES (a folder with the scenes and references/NAME.exr); skips without. The
reference renderer transports spectra and stores half floats, so the allowance is 1.5 % of a
channel's mean (3 % with coats or measured spectra), and no tile of 16x16 may be off by more than 5
standard errors beyond that share of the mean of the tile or of the picture, whichever is larger.
SHEAF_SAMPLES changes the samples per pixel.
"""
import json
import os
import subprocess
import tempfile
import unittest

import sys
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402

SAMPLES = int(os.environ.get("SHEAF_SAMPLES", "256"))
PLAIN, COATED = 0.015, 0.03
# Transport is RGB: a saturated coat under coloured light differs from a spectral picture by up to
# 8 % of the picture's mean in red, though the means of the channels agree within 1 %.
SATURATED = 0.10
# name: (scene, samples of the reference, allowance for channels, allowance for tiles)
SCENES = {
    "cornell-box": ("cornell-box/cornell-box-small.pbrt", 2048, PLAIN, PLAIN),
    "cornell-specular": ("cornell-box/cornell-box-specular-small.pbrt", 1024, PLAIN, PLAIN),
    "killeroo-simple": ("killeroos/killeroo-simple-small.pbrt", 1024, COATED, COATED),
    "veach-mis": ("veach-mis/veach-mis-small.pbrt", 1024, COATED, COATED),
    "material-testball": ("material-testball/material-testball-small.pbrt", 1024, COATED,
                          SATURATED),
}


@unittest.skipUnless(farm.public_scenes(), "SHEAF_PUBLIC_SCENES is not set: comparison skipped")
class PublicScenesTest(unittest.TestCase):
    def compare(self, name):
        scene, reference_samples, allowance, tile_allowance = SCENES[name]
        with tempfile.TemporaryDirectory() as folder:
            picture = os.path.join(folder, name + ".exr")
            farm.render(os.path.join(farm.public_scenes(), scene), picture, "--samples", SAMPLES)
            done = subprocess.run(
                [os.path.join(farm.programs(), "sheaf"), "compare", "--json", "--tiles",
                 "--allow", str(tile_allowance), "--sigmas", "5", "--reference-samples",
                 str(reference_samples),
                 os.path.join(farm.public_scenes(), "references", name + ".exr"), picture],
                capture_output=True, text=True)
            result = json.loads(done.stdout)
            print(name, done.stdout.strip(), flush=True)
        for ratio in result["mean_ratio"]:
            self.assertLess(abs(ratio - 1), allowance, "mean of a channel")
        self.assertEqual(result["tiles_beyond"], 0, "tiles beyond 5 standard errors")
        self.assertEqual(result["nonfinite_count"], 0)

    def test_cornell_box(self):
        self.compare("cornell-box")

    def test_cornell_specular(self):
        self.compare("cornell-specular")

    def test_killeroo_simple(self):
        self.compare("killeroo-simple")

    def test_veach_mis(self):
        self.compare("veach-mis")

    def test_material_testball(self):
        self.compare("material-testball")


if __name__ == "__main__":
    unittest.main(verbosity=2)
