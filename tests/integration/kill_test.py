#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""No acknowledged result is lost: kill -9 at random moments changes no bit and repeats no work.

A worker is killed some times, then the coordinator, at random moments of one job: after a random
number of results. SHEAF_SEED repeats a run.
"""
import json
import os
import random
import tempfile
import time
import unittest

import farm

SCENE = os.environ.get("SHEAF_SCENE", os.path.join(farm.ROOT, "scenes", "showroom.pbrt"))
# Tiles of 32 x 32 pixels.
TILES = 48 if farm.ALL_TESTS else 12
KILLS = 5 if farm.ALL_TESTS else 2
SAMPLES = 256 if farm.ALL_TESTS else 64
JOB = ("--crop", f"200,80,{200 + 32 * TILES // 6},272", "--samples", SAMPLES, "--tile-size", 32,
       "--pass-samples", SAMPLES // 16, "--lease-passes", 1)
PARTS = TILES * 16


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
            # All in the first half, so that the job has not ended before the last.
            moments = sorted(self.random.sample(range(1, PARTS // 2), 2 * KILLS))
            for moment in moments[:KILLS]:
                self.wait_for_parts(f, moment)
                f.kill(self.random.choice(f.workers))
                f.start_worker("--log-level", "debug")
            for moment in moments[KILLS:]:
                self.wait_for_parts(f, moment)
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

    def wait_for_parts(self, f, count):
        farm.wait_until(lambda: len(f.acknowledged()) >= count, 60, f"{count} results")

    def check_nothing_was_done_twice(self, f):
        """Checks that every sample of every tile was acknowledged exactly once."""
        samples = farm.samples_by_tile(f.acknowledged())
        self.assertTrue(all(len(s) == SAMPLES for s in samples.values()))


if __name__ == "__main__":
    unittest.main(verbosity=2)
