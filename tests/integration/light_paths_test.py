#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Light paths reach any pixel, and the image is still one.

A frame with both techniques is rendered in one process, on 1 and 4 workers of which one is killed,
and by coordinators that are killed: one SHA-256. Its crop is that part of the whole. SHEAF_SEED
repeats the moments of a run.
"""
import json
import os
import time
import unittest

import farm
from one_image_case import OneImageCase

# A glass ball that focuses a small lamp onto a floor: a caustic for light paths, a mirror image of
# the lamp and a shadow for those of the camera.
SCENE = '''Film "rgb" "integer xresolution" 48 "integer yresolution" 40
PixelFilter "mitchell" "float xradius" 2 "float yradius" 2
Sampler "zsobol" "integer pixelsamples" 16
Integrator "volpath" "integer maxdepth" 8
LookAt 0 -5 3  0 0 0.5  0 0 1
Camera "perspective" "float fov" 35
WorldBegin
AttributeBegin
  Translate 0.5 0.5 4
  AreaLightSource "diffuse" "rgb L" [60 50 40]
  Shape "sphere" "float radius" 0.1
AttributeEnd
AttributeBegin
  Translate 0 0 1
  Material "dielectric" "float eta" 1.5
  Shape "sphere" "float radius" 0.7
AttributeEnd
Material "diffuse" "rgb reflectance" [0.6 0.6 0.6]
Shape "bilinearmesh" "point3 P" [-4 -4 0  4 -4 0  -4 4 0  4 4 0]
'''
BOTH = ("--techniques", "camera+light")
# Many small tasks of both kinds.
SMALL = ("--tile-size", 16, "--pass-samples", 4, "--lease-passes", 1)
SAMPLES = 42  # Not a multiple of 16: the last light passes are those of few replicates.
JOB = ("--samples", SAMPLES, *BOTH)
# Light paths that are merged with camera paths behind the ball.
MERGED = ("--samples", SAMPLES, "--techniques", "camera+light+merging")
KILLS = 3


class LightPathsTest(OneImageCase):
    SCENE_NAME, SCENE_TEXT, JOB = "caustic.pbrt", SCENE, JOB

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.merged = cls.rendered("merged", *MERGED)

    def check_nothing_was_done_twice(self, f):
        samples = farm.samples_by_tile(f.acknowledged())
        self.assertTrue(all(len(s) == SAMPLES for s in samples.values()))
        light = [key for key in samples if key[3] == farm.TASK_KIND_LIGHT]
        self.assertEqual(len(light), 1, "a frame has one light tile")

    def test_techniques_give_different_images(self):
        digests = {self.rendered("t", "--samples", SAMPLES, "--techniques", t)
                   for t in ("camera", "camera+light", "light", "camera+light+merging")}
        self.assertEqual(len(digests), 4)

    def test_in_one_process(self):
        for arguments in (SMALL, ("--tile-size", 64, "--pass-samples", 64), ("--threads", 3),
                          ("--generic",)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("p", *JOB, *arguments), self.expected)
                self.assertEqual(self.rendered("p", *MERGED, *arguments), self.merged)

    def test_one_worker(self):
        with farm.Farm() as f:
            f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *SMALL).stdout.strip()
            self.assertEqual(self.finished(f, job), self.expected)
            self.check_nothing_was_done_twice(f)
            job = f.sheaf("submit", self.scene, *MERGED, *SMALL).stdout.strip()
            self.assertEqual(self.finished(f, job), self.merged)

    def test_four_workers_of_which_one_is_killed(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(4):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *SMALL).stdout.strip()
            merged = f.sheaf("submit", self.scene, *MERGED, *SMALL).stdout.strip()
            farm.wait_until(f.acknowledged, 60, "the first result")
            f.kill(self.random.choice(f.workers))
            self.assertEqual(self.finished(f, job), self.expected)
            self.assertEqual(self.finished(f, merged), self.merged)
            # The workers that are left learn where light paths begin, once for all of them.
            guided = ("--samples", SAMPLES, "--techniques", "camera+light+emission-guiding")
            expected = self.rendered("guided", *guided)
            self.assertNotEqual(expected, self.expected)
            for passes in (SMALL, ("--tile-size", 16, "--pass-samples", 16)):
                with self.subTest(passes=passes):
                    job = f.sheaf("submit", self.scene, *guided, *passes).stdout.strip()
                    self.assertEqual(self.finished(f, job, "guided farmed"), expected)
            self.assertEqual(self.rendered("guided", *guided, *SMALL, "--threads", 3), expected)

    def test_killed_coordinators(self):
        samples = ("--samples", 8 * SAMPLES, *BOTH)
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

    def test_rounds(self):
        """Light passes follow the cells' samples, and decisions are data."""
        rule = ("--target-error", "3e-3", "--samples", 512, *BOTH)
        expected = self.rendered("rounds", *rule)
        self.assertEqual(self.rendered("rounds", *rule, "--threads", 2), expected)
        merged = ("--target-error", "3e-3", "--samples", 512, *MERGED[2:])
        self.assertEqual(self.rendered("rounds", *merged, "--threads", 2),
                         self.rendered("rounds", *merged))
        with farm.Farm() as f:
            for _ in range(2):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *rule).stdout.strip()
            self.assertEqual(self.finished(f, job), expected)

    def test_light_groups_and_layers(self):
        for outputs in (("--light-groups",), ("--light-paths", "--aov", "uv")):
            with self.subTest(outputs=outputs):
                expected = self.rendered("o", *JOB, *outputs)
                self.assertNotEqual(expected, self.expected)
                self.assertEqual(self.rendered("o", *JOB, *outputs, *SMALL), expected)

    def test_refinement_continues(self):
        """More samples on the parts that are there."""
        with farm.Farm() as f:
            f.start_worker()
            job = f.sheaf("submit", self.scene, "--samples", 16, *BOTH, *SMALL).stdout.strip()
            self.finished(f, job)
            before = f.acknowledged()
            f.sheaf("refine", job, "--samples", SAMPLES)
            self.assertEqual(self.finished(f, job), self.expected)
            self.assertLessEqual(before, f.acknowledged())

    def test_resumed_images_are_those_of_one_run(self):
        """From the image alone: the same but for rounding, and one SHA-256 for any workers."""
        scene = os.path.join(self.folder.name, "positive.pbrt")  # Filters with negative parts are
        with open(scene, "w", encoding="utf-8") as f:            # refused.
            f.write(SCENE.replace('"mitchell"', '"gaussian"').replace(
                '"diffuse" "rgb L"', '"diffuse" "string lightgroup" "light" "rgb L"'))
        outputs = (*BOTH, "--light-groups", "--aov", "uv")
        whole, first, more = (self.path(name) for name in ("whole", "first", "more"))
        farm.render(scene, whole, "--samples", 2 * SAMPLES, *outputs)
        farm.render(scene, first, "--samples", SAMPLES, *outputs)
        on = ("--samples", 2 * SAMPLES, *outputs, "--resume-from", first)
        farm.render(scene, more, *on)
        difference = json.loads(farm.compare(whole, more))
        self.assertLess(difference["relative_mse"], 1e-11)
        quoted = json.loads(farm.local("quote", scene, *outputs, "--local", "--json", "--targets",
                                       0.01, "--resume-from", first))
        self.assertAlmostEqual(quoted["start"]["samples"], SAMPLES)
        with farm.Farm() as f:
            for _ in range(2):
                f.start_worker()
            job = f.sheaf("submit", scene, *on, *SMALL).stdout.strip()
            self.assertEqual(self.finished(f, job), farm.image_digest(more))
            samples = farm.samples_by_tile(f.acknowledged())
            self.assertTrue(all(s == set(range(SAMPLES, 2 * SAMPLES)) for s in samples.values()))
            self.assertTrue(any(key[3] == farm.TASK_KIND_LIGHT for key in samples))


if __name__ == "__main__":
    unittest.main(verbosity=2)
