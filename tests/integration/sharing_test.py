#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Pixels share paths, and the image is still one.

A frame with `--techniques camera+sharing+views` is rendered in one process, and on workers of
which one is killed: one SHA-256. SHEAF_SEED repeats the moments of a run.
"""
import json
import subprocess
import unittest

import farm
from one_image_case import OneImageCase
from stereo_test import SCENE, quoted, rendered_cpu_seconds

SHARING = ("--techniques", "camera+sharing+views")
SMALL = ("--pass-samples", 4, "--lease-passes", 1)
SAMPLES = 42  # Not a multiple of 16: the last passes are those of few replicates.
JOB = ("--samples", SAMPLES, *SHARING)


class SharingTest(OneImageCase):
    SCENE_NAME = "balls.pbrt"
    SCENE_TEXT = SCENE.replace('"float lensradius" 0.03', '"float lensradius" 0.4')
    JOB = JOB

    def test_in_one_process(self):
        for arguments in (SMALL, ("--pass-samples", 64), ("--tile-size", 8, "--threads", 3)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("p", *JOB, *arguments), self.expected)
        by_filter = self.rendered("p", "--samples", SAMPLES, "--techniques", "camera+sharing")
        self.assertNotEqual(by_filter, self.expected)

    def test_plan_and_image_name_it(self):
        plan = farm.local("plan", self.scene, *SHARING)
        self.assertIn("techniques: camera+sharing+views, requested", plan)
        self.assertIn("views: up to 8 points of the lens share the paths that begin at rough "
                      "surfaces; those with two rough surfaces or more behind up to 4 "
                      "mirrors", plan)
        shown = json.loads(farm.local("show", self.path("expected"), "--json"))
        self.assertEqual(shown["metadata"]["techniques"], "camera+sharing+views")
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
            self.assertEqual(len(samples), 1, "a frame of shared paths has one tile")

    def test_both_eyes_share_them(self):
        eyes = (*JOB, "--stereo", "0.2,5")
        expected = self.rendered("eyes", *eyes)
        self.assertEqual(self.rendered("eyes", *eyes, *SMALL), expected)

    def test_rounds_end_the_frame_as_a_whole(self):
        rule = ("--target-error", "3e-3", "--samples", 512, *SHARING)
        expected = self.rendered("rounds", *rule)
        self.assertEqual(self.rendered("rounds", *rule, "--threads", 2), expected)

    def test_a_quote_is_right(self):
        price = quoted(self.scene, 1e-3, *SHARING)
        cpu = rendered_cpu_seconds(self.scene, self.path("q"), 1e-3, *SHARING)
        self.assertLess(price["low"] / 2, cpu)
        self.assertLess(cpu, 2 * price["high"])

    def test_other_commands_refuse_it(self):
        for command in (("study",), ("plan", "--measure")):
            with self.subTest(command=command):
                with self.assertRaises(subprocess.CalledProcessError) as refused:
                    farm.local(command[0], self.scene, *SHARING, *command[1:])
                self.assertRegex(refused.exception.stderr, "paths of one pixel")

    def test_what_shares_no_paths_is_refused(self):
        for flags in ((*SHARING, "--crop", "0,0,8,8"), (*SHARING, "--aov", "uv"),
                      (*SHARING, "--light-samples", 4), (*SHARING, "--denoise"),
                      (*SHARING, "--resume-from", self.path("expected")),
                      ("--techniques", "camera+light+sharing")):
            with self.subTest(flags=flags):
                with self.assertRaisesRegex(AssertionError, "--techniques camera"):
                    farm.render(self.scene, self.path("refused"), *flags)


if __name__ == "__main__":
    unittest.main(verbosity=2)
