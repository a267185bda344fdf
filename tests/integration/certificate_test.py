#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Certified errors: a frame stops at a certified bound, with equal samples in all pixels and the
same image and bound on any farm; files and messages have the bound; jobs without one are refused.
"""
import json
import os
import tempfile
import unittest

import farm

SCENE = os.path.join(farm.ROOT, "scenes", "cornell-box.pbrt")
WINDOW = ("--crop", "100,100,196,164", "--tile-size", "16")
BOUNDED = ("--clamp", "1", "--color", "rgb", "--techniques", "camera")
TARGET = 0.8
JOB = (*WINDOW, *BOUNDED, "--target-error", TARGET, "--certified")


def last_json(text):
    return json.loads(text.splitlines()[-1])


class CertificateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = os.path.join(cls.folder.name, "certified.exr")
        cls.done = farm.render(SCENE, path, *JOB, "--json")
        cls.frame = last_json(cls.done.stdout)["frames"][0]
        cls.expected = farm.image_digest(path)
        cls.metadata = last_json(farm.local("show", path, "--json"))["metadata"]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_the_frame_ends_at_the_first_bound_below_the_target(self):
        self.assertEqual(self.frame["stop_reason"], "target-error")
        *before, last = self.frame["rounds"]
        self.assertGreater(last["certified_relative_mse"], last["relative_mse"])
        self.assertLessEqual(last["certified_relative_mse"], TARGET)
        for earlier in before:
            self.assertGreater(earlier["certified_relative_mse"], TARGET)
        self.assertEqual(last["sample_count"] % (96 * 64 * 16), 0, "unequal samples")
        self.assertEqual(self.frame["certificate"], "X, Y and Z of a sample are at most 1")
        self.assertIn("certified to be at most", self.done.stderr)

    def test_the_file_has_the_bound(self):
        bound = self.frame["rounds"][-1]["certified_relative_mse"]
        self.assertAlmostEqual(float(self.metadata["certifiedError"]) / bound, 1, delta=1e-5)
        self.assertEqual(self.metadata["certificate"], "X, Y and Z of a sample are at most 1")

    def test_a_frame_of_as_many_samples_has_the_same_bound(self):
        last = self.frame["rounds"][-1]
        done = farm.render(SCENE, self.path("fixed.exr"), *WINDOW, *BOUNDED, "--samples",
                           last["sample_count"] // (96 * 64), "--json")
        frame = last_json(done.stdout)["frames"][0]
        self.assertEqual(farm.image_digest(self.path("fixed.exr")), self.expected)
        self.assertEqual(frame["rounds"][-1]["certified_relative_mse"],
                         last["certified_relative_mse"])

    def test_a_farm_that_loses_a_worker_and_its_coordinator(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(2):
                f.start_worker()
            job = last_json(f.sheaf("submit", SCENE, *JOB, "--pass-samples", 4, "--lease-passes",
                                    1, "--json").stdout)["name"]
            f.kill(f.workers[0])
            f.kill(f.coordinator)
            f.start_coordinator()
            watched = f.sheaf("watch", job, "-o", f.path("farm.exr"), "--json").stdout
            rounds = last_json(watched)["frames"][0]["rounds"]
            self.assertEqual(farm.image_digest(f.path("farm.exr")), self.expected)
            self.assertEqual([r["certified_relative_mse"] for r in rounds],
                             [r["certified_relative_mse"] for r in self.frame["rounds"]])
            refused = f.sheaf("submit", SCENE, *WINDOW, "--target-error", 0.1, "--certified",
                              check=False)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("cannot be certified: no maximum of a sample is known", refused.stderr)

    def test_plans_have_the_proof_or_the_reason(self):
        self.assertIn("certificate: X, Y and Z of a sample are at most 1",
                      farm.local("plan", SCENE, "--clamp", "1", "--color", "rgb"))
        self.assertIn("certificate: none, because samples of wavelengths can be negative",
                      farm.local("plan", SCENE, "--clamp", "1"))

    def test_an_estimate_says_why_it_is_one(self):
        done = farm.render(SCENE, self.path("free.exr"), *WINDOW, "--samples", 16, "--json")
        frame = last_json(done.stdout)["frames"][0]
        self.assertEqual(frame["rounds"][-1]["certified_relative_mse"], 0)
        self.assertIn("--clamp gives one", frame["certificate"])


if __name__ == "__main__":
    unittest.main()
