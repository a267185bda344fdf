#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Images of public scenes against images by another renderer.

Needs SHEAF_PUBLIC_SCENES (a folder with the scenes and references/NAME.exr); skips without it. The
reference renderer transports spectra, and its rough surfaces scatter once, so ours are rendered
with --color spectral --single-scattering; it stores half floats. The tolerance is 1 % of a
channel's mean (2 % with coats), and no 16x16 tile may differ by more than 5 standard errors plus
that fraction of the tile's mean. The tolerance for tiles of one scene is larger: the reference
overestimates light that leaves a rough coat by 7 to 13 %, as
CoatTableTest.ReferenceRendererWeightsDoNotSumToOne shows. The short form has some of the scenes and
fewer samples; the error bars of both forms are their own. SHEAF_SAMPLES changes the samples per
pixel.
"""
import functools
import json
import os
import subprocess
import tempfile
import unittest

import sys
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402

PLAIN, COATED, REFERENCE_COAT = 0.01, 0.02, 0.13
# name: (scene, samples of the reference, tolerance of means, of tiles, our samples). Caustics are
# rare and bright: the replicates need many samples to estimate their own error.
SCENES = {
    "cornell-box": ("cornell-box/cornell-box-small.pbrt", 2048, PLAIN, PLAIN, 256),
    "cornell-specular": ("cornell-box/cornell-box-specular-small.pbrt", 1024, PLAIN, PLAIN, 1024),
    "killeroo-simple": ("killeroos/killeroo-simple-small.pbrt", 1024, COATED, REFERENCE_COAT, 256),
    "killeroo-moving": ("killeroos/killeroo-moving-small.pbrt", 1024, COATED, REFERENCE_COAT, 256),
    "veach-mis": ("veach-mis/veach-mis-small.pbrt", 1024, PLAIN, PLAIN, 256),
    "material-testball":
        ("material-testball/material-testball-small.pbrt", 1024, COATED, COATED, 256),
    "teapot-cloud": ("teapot-cloud/teapot_cloud-small.pbrt", 1024, PLAIN, PLAIN, 256),
    "staircase2": ("staircase2/staircase2-small.pbrt", 1024, COATED, REFERENCE_COAT, 256),
}
SHORT, SHORT_SAMPLES = ("cornell-box", "veach-mis"), 64
NAMES = tuple(SCENES) if farm.ALL_TESTS else SHORT


@functools.lru_cache(maxsize=None)
def comparison(name):
    """The result of `sheaf compare` for our image of a scene, which is rendered once."""
    scene, reference_samples, _, tile_allowance, samples = SCENES[name]
    samples = os.environ.get("SHEAF_SAMPLES", samples if farm.ALL_TESTS else SHORT_SAMPLES)
    with tempfile.TemporaryDirectory() as folder:
        image = os.path.join(folder, name + ".exr")
        farm.render(os.path.join(farm.public_scenes(), scene), image, "--samples", samples,
                    "--color", "spectral", "--single-scattering")
        done = subprocess.run(
            [os.path.join(farm.programs(), "sheaf"), "compare", "--json", "--tiles",
             "--tile-tolerance", str(tile_allowance), "--tile-sigmas", "5", "--reference-samples",
             str(reference_samples),
             os.path.join(farm.public_scenes(), "references", name + ".exr"), image],
            capture_output=True, text=True)
        print(name, done.stdout.strip(), flush=True)
        return json.loads(done.stdout)


@unittest.skipUnless(farm.public_scenes(), "SHEAF_PUBLIC_SCENES is not set: comparison skipped")
class PublicScenesTest(unittest.TestCase):
    def test_channel_means(self):
        for name in NAMES:
            allowance = SCENES[name][2]
            with self.subTest(name):
                for ratio in comparison(name)["mean_ratio"]:
                    self.assertLess(abs(ratio - 1), allowance, "mean of a channel")
                self.assertEqual(comparison(name)["nonfinite_count"], 0)

    def test_tiles(self):
        for name in NAMES:
            with self.subTest(name):
                self.assertEqual(comparison(name)["tiles_deviating"], 0,
                                 "tiles beyond 5 standard errors")


if __name__ == "__main__":
    unittest.main(verbosity=2)
