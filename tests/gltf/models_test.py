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
import os
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "integration")]
import farm  # pylint: disable=wrong-import-position
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
