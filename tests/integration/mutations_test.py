#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Chains of mutations reach other pixels, and the image is still one.

A frame with `--techniques camera+mutations` is rendered in one process, and on workers of which one
is killed: one SHA-256. SHEAF_SEED repeats the moments of a run.
"""
import json
import unittest

import farm
from one_image_case import OneImageCase
from stereo_test import SCENE

MUTATIONS = ("--techniques", "camera+mutations")
SMALL = ("--pass-samples", 4, "--lease-passes", 1)
SAMPLES = 42  # Not a multiple of 16: the last passes are those of few replicates.
JOB = ("--samples", SAMPLES, *MUTATIONS)


class MutationsTest(OneImageCase):
    SCENE_NAME = "balls.pbrt"
    SCENE_TEXT = SCENE
    JOB = JOB

    def test_in_one_process(self):
        for arguments in (SMALL, ("--pass-samples", 64), ("--tile-size", 8, "--threads", 3)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("p", *JOB, *arguments), self.expected)

    def test_plan_and_image_name_it(self):
        plan = farm.local("plan", self.scene, *MUTATIONS)
        self.assertIn("techniques: camera+mutations, requested", plan)
        self.assertIn("start chains of 64 mutations", plan)
        shown = json.loads(farm.local("show", self.path("expected"), "--json"))
        self.assertEqual(shown["metadata"]["techniques"], "camera+mutations")
        self.assertNotIn("bias", shown["metadata"])

    def test_workers_of_which_one_is_killed(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(3):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *SMALL).stdout.strip()
            farm.wait_until(f.acknowledged, 60, "the first result")
            f.kill(self.random.choice(f.workers))
            self.assertEqual(self.finished(f, job), self.expected)
            samples = farm.samples_by_tile(f.acknowledged())
            self.assertEqual(len(samples), 1, "a frame with mutations has one tile")

    def test_other_frames_are_refused(self):
        for flags in ((*MUTATIONS, "--crop", "0,0,8,8"), (*MUTATIONS, "--aov", "uv"),
                      ("--techniques", "camera+light+mutations")):
            with self.subTest(flags=flags):
                with self.assertRaisesRegex(AssertionError, "--techniques camera"):
                    farm.render(self.scene, self.path("refused"), *flags)


if __name__ == "__main__":
    unittest.main(verbosity=2)
