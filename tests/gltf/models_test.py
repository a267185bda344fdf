#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Each model of make_models.py is read and planned, or refused for the reason it was made for.

Two are rendered as well: one with an image inside, one as frames of an animation. With a folder of
models as argument or in SHEAF_GLTF_SAMPLES (Khronos' sample assets, for example), all of its models
are rendered small, or name what they refuse.

Usage: models_test.py [FOLDER]
"""
import glob
import math
import os
import re
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "integration")]
import farm  # pylint: disable=wrong-import-position
from guided_farm_test import png_rows  # pylint: disable=wrong-import-position
import make_models  # pylint: disable=wrong-import-position

MODELS_MIN = 25
SAMPLE_SECONDS_MAX = 120
EXIT_BAD_SCENE = 4
SMALL = ("--size", "64x48", "--samples", "4")


def sheaf(*arguments, seconds=60):
    done = subprocess.run([os.path.join(farm.programs(), "sheaf"), *arguments], text=True,
                          capture_output=True, timeout=seconds * farm.PATIENCE, check=False)
    return done.returncode, done.stdout + done.stderr


class ModelsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="sheaf gltf ")
        cls.models = make_models.write_models(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_each_is_read_or_says_why_not(self):
        self.assertGreaterEqual(len(self.models), MODELS_MIN)
        for path, says in self.models:
            with self.subTest(os.path.basename(path)):
                code, text = sheaf("plan", path)
                says = says or ""
                refused = says.startswith("error: ")
                self.assertEqual(code != 0, refused, text)
                self.assertIn(says.removeprefix("error: "), text)
                if refused:
                    self.assertIn(os.path.basename(path) + ": ", text)

    def test_images_within_files_are_uploaded(self):
        code, text = sheaf("render", self.path("textures.glb"), *SMALL, "-o", self.path("t.exr"))
        self.assertEqual(code, 0, text)
        self.assertTrue(os.path.exists(self.path("t.exr")))

    def test_emission_is_tiled(self):
        """Regression: emission was clamped to the edges of its image, whatever the sampler said."""
        def render(name):
            exr = self.path(name + ".exr")
            code, text = sheaf("render", self.path(name + ".glb"), *SMALL, "--environment", "none",
                               "-o", exr)
            self.assertEqual(code, 0, text)
            return exr
        tile = render("emission-tile")
        code, text = sheaf("compare", tile, render("emission-repeat"), "--tolerance", "1e-6")
        self.assertEqual(code, 0, text)
        # A mirrored image has other samples of the same light.
        code, text = sheaf("compare", tile, render("emission-mirror"))
        self.assertEqual(code, 0, text)
        self.assertIn("within noise", text)

    def test_lights_in_candela_are_exposed_automatically(self):
        """Regression: PNGs of Blender's exports were white."""
        def render(name, *arguments):
            exr, png = self.path(name + ".exr"), self.path(name + ".png")
            code, text = sheaf("render", self.path("lamp.glb"), *SMALL, "-o", exr, "--png", png,
                               *arguments)
            self.assertEqual(code, 0, text)
            return farm.read_bytes(exr), farm.read_bytes(png), text

        exr, png, text = render("automatic")
        found = re.search(r"automatic\.png: exposed by (-\d+\.\d\d) stops", text)
        self.assertTrue(found, text)
        # The square has 1000 cd / (2 m)^2 / pi = 80 cd/m^2 at its center, a little less elsewhere;
        # this becomes middle gray.
        self.assertAlmostEqual(float(found[1]), math.log2(0.18 / (250 / math.pi)), delta=0.3)
        levels = b"".join(png_rows(self.path("automatic.png")))
        self.assertLess(levels.count(255), len(levels) / 5)
        self.assertAlmostEqual(sum(levels) / len(levels), 118, delta=8)
        self.assertEqual(render("same", "--exposure", found[1])[:2], (exr, png))
        render("white", "--exposure", "0")
        self.assertEqual(max(b"".join(png_rows(self.path("white.png")))), 255)
        self.assertNotIn("exposed by", render("given", "--exposure", "-3")[2])
        code, text = sheaf("render", self.path("lamp.glb"), "--exposure", "bright")
        self.assertEqual(code, 2, text)
        self.assertIn("--exposure", text)
        # A surrounding has no unit.
        code, text = sheaf("render", self.path("draco.glb"), *SMALL, "--png", self.path("d.png"),
                           "-o", self.path("d.exr"))
        self.assertNotIn("exposed by", text)

    def test_white_models_are_seen(self):
        """Regression: the surrounding of files without lights was as white as the model."""
        png = self.path("white.png")
        code, text = sheaf("render", self.path("white.glb"), "--size", "64x48", "--samples", "16",
                           "--png", png, "-o", self.path("white.exr"))
        self.assertEqual(code, 0, text)
        self.assertIn("a gray surrounding, bright above, lights it", text)
        rows = list(png_rows(png))

        def mean(y, x):
            return sum(sum(row[3 * x:3 * x + 24]) for row in rows[y:y + 8]) / (8 * 24)

        background, middle, top = mean(0, 0), mean(22, 28), mean(13, 28)
        self.assertGreater(middle - background, 25)
        self.assertGreater(top - middle, 15)

    def test_colors_of_unlit_vertices_are_seen(self):
        png = self.path("unlit.png")
        code, text = sheaf("render", self.path("unlit-colors.glb"), "--size", "64x48",
                           "--samples", "16", "--environment", "none", "--exposure", "0",
                           "--png", png, "-o", self.path("unlit.exr"))
        self.assertEqual(code, 0, text)
        levels = b"".join(png_rows(png))
        pixels = list(zip(levels[0::3], levels[1::3], levels[2::3]))
        for channel in range(3):
            others = [c for c in range(3) if c != channel]
            self.assertTrue(any(p[channel] > 200 and max(p[c] for c in others) < 110
                                for p in pixels), "no corner of channel %d" % channel)

    def test_frames_are_times(self):
        code, text = sheaf("render", self.path("animation.glb"), *SMALL, "--fps", "4", "--frames",
                           "1,3", "-o", self.path("a.####.exr"))
        self.assertEqual(code, 0, text)
        images = []
        for number in (1, 3):
            with open(self.path(f"a.{number:04d}.exr"), "rb") as file:
                images.append(file.read())
        self.assertNotEqual(images[0], images[1])

    def test_flags_are_for_gltf_only(self):
        scene = os.path.join(ROOT, "scenes", "cornell-box.pbrt")
        code, text = sheaf("plan", scene, "--camera", "Main")
        self.assertNotEqual(code, 0)
        self.assertIn("--camera", text)

    def test_samples_of_a_folder(self):
        folder = os.environ.get("SHEAF_GLTF_SAMPLES", "")
        if not os.path.isdir(folder):
            self.skipTest("SHEAF_GLTF_SAMPLES names no folder")
        paths = sorted(path for ending in ("glb", "gltf") for path in
                       glob.glob(os.path.join(folder, "**", "*." + ending), recursive=True))
        self.assertTrue(paths, folder)
        for path in paths:
            with self.subTest(os.path.relpath(path, folder)):
                code, text = sheaf("render", path, *SMALL, "-o", self.path("sample.exr"),
                                   seconds=SAMPLE_SECONDS_MAX)
                self.assertIn(code, (0, EXIT_BAD_SCENE), text)
                if code != 0:
                    self.assertIn(os.path.basename(path) + ": ", text)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        os.environ["SHEAF_GLTF_SAMPLES"] = sys.argv.pop(1)
    unittest.main()
