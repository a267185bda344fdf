#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Paths of each eye of a stereo frame reach pixels of both, and the image is still one.

A stereo frame is rendered in one process, on workers of which one is killed, and by coordinators
that are killed: one SHA-256. Its file has both views by name. SHEAF_SEED repeats the moments of a
run.
"""
import json
import os
import re
import shutil
import subprocess
import time
import unittest

import farm
from one_image_case import OneImageCase

try:
    import OpenImageIO
except ImportError:
    OpenImageIO = None

# A rough ball and a glass one in front of a wall, lit by a sphere and a sky.
SCENE = '''Film "rgb" "integer xresolution" 32 "integer yresolution" 28
PixelFilter "gaussian"
Sampler "zsobol" "integer pixelsamples" 16
LookAt 0 -5 2  0 0 0.7  0 0 1
Camera "perspective" "float fov" 35 "float lensradius" 0.03 "float focaldistance" 5
WorldBegin
LightSource "infinite" "rgb L" [0.2 0.25 0.3]
AttributeBegin
  Translate 1 -1 4
  AreaLightSource "diffuse" "rgb L" [20 18 15]
  Shape "sphere" "float radius" 0.5
AttributeEnd
AttributeBegin
  Translate -0.7 0 0.7
  Material "dielectric" "float eta" 1.5
  Shape "sphere" "float radius" 0.7
AttributeEnd
AttributeBegin
  Translate 0.8 0 0.7
  Material "coateddiffuse" "rgb reflectance" [0.6 0.2 0.1] "float roughness" 0.2
  Shape "sphere" "float radius" 0.7
AttributeEnd
Material "diffuse" "rgb reflectance" [0.6 0.6 0.6]
Shape "bilinearmesh" "point3 P" [-4 -4 0  4 -4 0  -4 4 0  4 4 0]
Shape "bilinearmesh" "point3 P" [-4 2 0  4 2 0  -4 2 4  4 2 4]
'''
STEREO = ("--stereo", "0.2,5")
SMALL = ("--pass-samples", 4, "--lease-passes", 1)
SAMPLES = 42  # Not a multiple of 16: the last passes are those of few replicates.
JOB = ("--samples", SAMPLES, *STEREO)
KILLS = 3


def quoted(scene, target, *arguments):
    """The price that a quote says, in CPU seconds."""
    quote = json.loads(farm.local("quote", scene, "--local", "--targets", target, "--json",
                                  *arguments))
    row = next(row for row in quote["rows"] if row["target_error"] == target)
    return {key: 3600 * value for key, value in row["cpu_hours"].items()}


def rendered_cpu_seconds(scene, path, target, *arguments):
    """The price of a frame with the target."""
    text = farm.render(scene, path, "--target-error", target, "--json",
                       *arguments).stdout
    return json.loads(text.splitlines()[-1])["progress"]["cpu_duration_seconds"]


class StereoTest(OneImageCase):
    SCENE_NAME, SCENE_TEXT, JOB = "balls.pbrt", SCENE, JOB

    def test_in_one_process(self):
        for arguments in (SMALL, ("--pass-samples", 64), ("--tile-size", 8, "--threads", 3)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("p", *JOB, *arguments), self.expected)
        self.assertNotEqual(self.rendered("p", "--samples", SAMPLES, "--stereo", 0.2),
                            self.expected)

    def test_the_file_has_both_views(self):
        shown = json.loads(farm.local("show", self.path("expected"), "--json"))
        self.assertEqual(shown["metadata"]["views"], "left,right")
        with open(self.path("expected"), "rb") as f:
            header = f.read(8192)
        for name in (b"multiView\0stringvector\0", b"\0R\0", b"\0right.R\0", b"\0albedo.left.R\0",
                     b"\0albedo.right.R\0", b"\0stderr.right.B\0"):
            self.assertIn(name, header)

    def view_means(self):
        """The mean of G in the left view and in the right one, as OpenImageIO reads them."""
        image = OpenImageIO.ImageBuf(self.path("expected"))
        names = image.spec().channelnames
        pixels = image.get_pixels(OpenImageIO.FLOAT)
        return [float(pixels[..., names.index(name)].mean()) for name in ("G", "right.G")]

    @unittest.skipUnless(OpenImageIO, "no python3-openimageio")
    def test_openimageio_finds_both_views(self):
        spec = OpenImageIO.ImageBuf(self.path("expected")).spec()
        self.assertEqual(tuple(spec.getattribute("multiView")), ("left", "right"))
        left, right = self.view_means()
        self.assertNotEqual(left, right)

    @unittest.skipUnless(shutil.which("oiiotool"), "no oiiotool: Debian's openimageio-tools")
    def test_oiiotool_finds_both_views(self):
        text = subprocess.run(["oiiotool", "--info", "-v", self.path("expected")], check=True,
                              capture_output=True, text=True).stdout
        self.assertRegex(text, "multiView: .*left.*right")
        self.assertIn("right.G", text)

    @unittest.skipUnless(shutil.which("exrheader"), "no exrheader: Debian's openexr")
    def test_openexr_finds_both_views(self):
        text = subprocess.run(["exrheader", self.path("expected")], check=True,
                              capture_output=True, text=True).stdout
        self.assertRegex(text, r"multiView \(type stringvector\):\s+left\s+right")

    @unittest.skipUnless(OpenImageIO and shutil.which("blender"),
                         "no Blender, or no python3-openimageio")
    def test_blender_finds_both_views(self):
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "views_in_blender.py")
        text = subprocess.run(
            ["blender", "-b", "--factory-startup", "--python-exit-code", "3", "--python", script,
             "--", self.path("expected"), self.folder.name, "32", "28"],
            env={"HOME": self.folder.name, "PATH": os.environ["PATH"]}, check=True,
            capture_output=True, text=True).stdout
        found = re.findall(r"^VIEW (\w+) (\S+)$", text, re.M)
        self.assertEqual([name for name, _ in found], ["left", "right"], text)
        for (_, mean), expected in zip(found, self.view_means()):
            self.assertAlmostEqual(float(mean) / expected, 1, places=4)

    def test_workers_of_which_one_is_killed(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(3):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *SMALL).stdout.strip()
            farm.wait_until(f.acknowledged, 60, "the first result")
            f.kill(self.random.choice(f.workers))
            self.assertEqual(self.finished(f, job), self.expected)
            samples = farm.samples_by_tile(f.acknowledged())
            self.assertEqual(len(samples), 1, "a stereo frame has one tile")
            self.assertTrue(all(len(s) == SAMPLES for s in samples.values()))

    def test_killed_coordinators(self):
        samples = ("--samples", 8 * SAMPLES, *STEREO)
        expected = self.rendered("long", *samples)
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(2):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *samples, *SMALL).stdout.strip()
            for _ in range(KILLS):
                time.sleep(self.random.uniform(0.1, 0.5))
                f.kill(f.coordinator)
                before = f.acknowledged()
                f.start_coordinator()
                self.assertLessEqual(before, f.acknowledged(), "an acknowledged result is gone")
            self.assertEqual(self.finished(f, job), expected)

    def test_rounds_end_the_frame_as_a_whole(self):
        rule = ("--target-error", "3e-3", "--samples", 512, *STEREO)
        expected = self.rendered("rounds", *rule)
        self.assertEqual(self.rendered("rounds", *rule, "--threads", 2), expected)

    def test_the_target_holds_for_the_worse_eye(self):
        farm.render(self.scene, self.path("worse"), "--target-error", "3e-3", "--samples", 4096,
                    *STEREO)
        found = json.loads(farm.local("show", self.path("worse"), "--json"))["metadata"]
        left, right = (float(found[f"{eye}EyeRelativeMse"]) for eye in ("left", "right"))
        difference = float(found["eyeDifferenceRelativeMse"])
        self.assertEqual(float(found["relativeMse"]), max(left, right))
        self.assertEqual(found["stopReason"], "target-error")
        self.assertLessEqual(max(left, right), 3e-3)
        self.assertLess(difference, left + right)
        self.assertIn("error of their difference", farm.local("show", self.path("worse")))

    def test_a_quote_is_right(self):
        price = quoted(self.scene, 1e-3, *STEREO)
        cpu = rendered_cpu_seconds(self.scene, self.path("q"), 1e-3, *STEREO)
        self.assertLess(price["low"] / 2, cpu)
        self.assertLess(cpu, 2 * price["high"])

    def test_refinement_continues(self):
        with farm.Farm() as f:
            f.start_worker()
            job = f.sheaf("submit", self.scene, "--samples", 16, *STEREO).stdout.strip()
            self.finished(f, job)
            before = f.acknowledged()
            f.sheaf("refine", job, "--samples", SAMPLES)
            self.assertEqual(self.finished(f, job), self.expected)
            self.assertLessEqual(before, f.acknowledged())

    def test_what_has_no_eyes_is_refused(self):
        wide = os.path.join(self.folder.name, "sphere.pbrt")
        with open(wide, "w", encoding="utf-8") as f:
            f.write(SCENE.replace('"perspective" "float fov" 35 "float lensradius" 0.03 '
                                  '"float focaldistance" 5', '"spherical"'))
        for scene, *flags in ((self.scene, "--crop", "0,0,8,8"), (self.scene, "--aov", "uv"),
                              (self.scene, "--techniques", "camera+light"),
                              (self.scene, "--light-samples", 4), (self.scene, "--denoise"),
                              (self.scene, "--resume-from", self.path("expected")),
                              (self.scene, "--exr-parts", "multi"),
                              (self.scene, "--exr-depth", "plane"), (wide,)):
            with self.subTest(flags=flags):
                with self.assertRaisesRegex(AssertionError, "--stereo: |--stereo needs"):
                    farm.render(scene, self.path("refused"), *STEREO, *flags)


if __name__ == "__main__":
    unittest.main(verbosity=2)
