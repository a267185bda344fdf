#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""No acknowledged result is lost: kill -9 at random moments changes no bit and repeats no work.

A worker is killed five times, then the coordinator five times, at random moments of one job.
SHEAF_SEED repeats a run.
"""
import json
import os
import random
import tempfile
import time
import unittest

import farm

SCENE = os.environ.get("SHEAF_SCENE", os.path.join(farm.ROOT, "scenes", "showroom.pbrt"))
JOB = ("--crop", "200,80,456,272", "--samples", "256", "--tile-size", "32", "--pass-samples", "16",
       "--lease-passes", "1")
KILLS = 5
PARTS = (256 // 32) * (192 // 32) * (256 // 16)


class KillTest(unittest.TestCase):
    def setUp(self):
        seed = int(os.environ.get("SHEAF_SEED", time.time_ns() % 1_000_000))
        print(f"SHEAF_SEED={seed}", flush=True)
        self.random = random.Random(seed)
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        expected = os.path.join(self.folder.name, "expected.exr")
        farm.render(SCENE, expected, *JOB)
        self.expected = farm.image_digest(expected)
        self.expected_file = farm.read_bytes(expected)

    def test_kill_workers_then_coordinator(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(2):
                f.start_worker("--log-level", "debug")
            submitted = f.sheaf("submit", SCENE, *JOB, "--json").stdout
            job = json.loads(submitted.splitlines()[-1])["name"]
            for _ in range(KILLS):
                time.sleep(self.random.uniform(0.1, 0.6))
                f.kill(self.random.choice(f.workers))
                f.start_worker("--log-level", "debug")
            for _ in range(KILLS):
                time.sleep(self.random.uniform(0.1, 0.6))
                f.kill(f.coordinator)
                before = f.acknowledged()
                self.assertLess(len(before), PARTS, "the job ended before the last kill")
                f.start_coordinator()
                self.assertLessEqual(before, f.acknowledged(), "an acknowledged result is gone")
            output = f.path("out.exr")
            f.sheaf("watch", job, "-o", output)
            self.assertEqual(farm.image_digest(output), self.expected)
            self.assertEqual(farm.read_bytes(output), self.expected_file,
                             "equal images in files that are not")
            self.check_nothing_was_done_twice(f)

    def check_nothing_was_done_twice(self, f):
        """Checks that every sample of every tile was acknowledged exactly once."""
        samples = farm.samples_by_tile(f.acknowledged())
        self.assertTrue(all(len(s) == 256 for s in samples.values()))


if __name__ == "__main__":
    unittest.main(verbosity=2)
