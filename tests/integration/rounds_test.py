#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Frames that stop at a target error: the image, and with it the number of samples of every tile,
is the same to the bit on one worker or four, with a worker and the coordinator killed, and with
any assignment of tiles; and the target is reached. SHEAF_SEED repeats a run's kills.
"""
import json
import os
import random
import tempfile
import time
import unittest

import farm

SCENE = os.environ.get("SHEAF_SCENE", os.path.join(farm.ROOT, "scenes", "showroom.pbrt"))
WINDOW = ("--crop", "270,150,366,214", "--tile-size", "16")
TARGET = 0.008
JOB = WINDOW + ("--target-error", TARGET)


def last_json(text):
    return json.loads(text.splitlines()[-1])


class RoundsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = os.path.join(cls.folder.name, "expected.exr")
        done = farm.render(SCENE, path, *JOB, "--json")
        cls.frame = last_json(done.stdout)["frames"][0]
        cls.expected = farm.image_digest(path)
        cls.expected_file = farm.read_bytes(path)
        cls.metadata = last_json(farm.local("show", path, "--json"))["metadata"]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_error_curve_reaches_the_target(self):
        rounds = self.frame["rounds"]
        self.assertEqual(self.frame["stop_reason"], "target-error")
        self.assertGreater(len(rounds), 2)
        self.assertLessEqual(rounds[-1]["relative_mse_upper"], TARGET)
        for before, after in zip(rounds, rounds[1:]):
            self.assertGreater(before["relative_mse_upper"], TARGET)
            for sum_of in ("sample_count", "ray_count", "cpu_duration_seconds",
                           "wall_duration_seconds", "part_bytes"):
                self.assertGreater(after[sum_of], before[sum_of], sum_of)
        self.assertEqual(rounds[-1]["sample_count"],
                         self.frame["progress"]["sample_count_done"])

    def test_file_contains_the_error_curve(self):
        pixel_count = 96 * 64
        points = [[float(word) for word in point.split()]
                  for point in self.metadata["errorCurve"].split(", ")]
        self.assertEqual(len(points), len(self.frame["rounds"]))
        for (samples, error, upper), told in zip(points, self.frame["rounds"]):
            for value, key in ((samples * pixel_count, "sample_count"), (error, "relative_mse"),
                               (upper, "relative_mse_upper")):
                self.assertAlmostEqual(value / told[key], 1, delta=1e-5)
        self.assertEqual(self.metadata["stopReason"], "target-error")
        self.assertEqual(float(self.metadata["targetError"]), TARGET)

    def test_partition_and_threads_do_not_matter(self):
        for flags in (("--threads", 1), ("--pass-samples", 4, "--lease-passes", 1),
                      ("--pass-samples", 64)):
            with self.subTest(flags=flags):
                farm.render(SCENE, self.path("cut.exr"), *JOB, *flags)
                self.assertEqual(farm.image_digest(self.path("cut.exr")), self.expected)

    def test_one_worker_and_four_with_kills(self):
        seed = int(os.environ.get("SHEAF_SEED", time.time_ns() % 1_000_000))
        print(f"SHEAF_SEED={seed}", flush=True)
        chance = random.Random(seed)
        with farm.Farm() as f:
            f.start_worker()
            f.sheaf("submit", SCENE, "--wait", "-o", f.path("one.exr"), *JOB)
            self.assertEqual(farm.image_digest(f.path("one.exr")), self.expected)
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(4):
                f.start_worker()
            submitted = f.sheaf("submit", SCENE, *JOB, "--pass-samples", 4, "--lease-passes", 1,
                                "--json").stdout
            job = last_json(submitted)["name"]
            time.sleep(chance.uniform(0.2, 1))
            f.kill(f.workers[0])
            for _ in range(3):
                time.sleep(chance.uniform(0.2, 1))
                f.kill(f.coordinator)
                f.start_coordinator()
            watched = f.sheaf("watch", job, "-o", f.path("four.exr"), "--json").stdout
            self.assertEqual(farm.image_digest(f.path("four.exr")), self.expected)
            self.assertEqual(farm.read_bytes(f.path("four.exr")), self.expected_file,
                             "equal images in files that are not")
            rounds = last_json(watched)["frames"][0]["rounds"]
            self.assertEqual([r["sample_count"] for r in rounds],
                             [r["sample_count"] for r in self.frame["rounds"]])
            self.assertEqual([r["relative_mse_upper"] for r in rounds],
                             [r["relative_mse_upper"] for r in self.frame["rounds"]])

    def test_samples_limit_pixel_samples(self):
        done = farm.render(SCENE, self.path("few.exr"), *JOB, "--samples", 40, "--json")
        frame = last_json(done.stdout)["frames"][0]
        self.assertEqual(frame["stop_reason"], "samples")
        self.assertIn("before the target", done.stderr)
        farm.render(SCENE, self.path("forty.exr"), *WINDOW, "--samples", 40)
        self.assertEqual(farm.image_digest(self.path("few.exr")),
                         farm.image_digest(self.path("forty.exr")))

    def test_time_and_budget_end_a_frame(self):
        done = farm.render(SCENE, self.path("time.exr"), *WINDOW, "--time", "3s", "--json")
        frame = last_json(done.stdout)["frames"][0]
        self.assertEqual(frame["stop_reason"], "time")
        self.assertLess(frame["progress"]["wall_duration_seconds"], 3 * farm.PATIENCE)
        done = farm.render(SCENE, self.path("cpu.exr"), *WINDOW, "--budget", 2 / 3600, "--json")
        frame = last_json(done.stdout)["frames"][0]
        self.assertEqual(frame["stop_reason"], "cpu")
        self.assertLess(frame["progress"]["cpu_duration_seconds"], 3 * farm.TIME_SCALE)

    def refined(self, first, then, coordinator_arguments=()):
        """Submits a job with some options and refines it with others. Returns its last JSON and its
        digest.
        """
        with farm.Farm(coordinator_arguments) as f:
            f.start_worker()
            f.start_worker()
            f.sheaf("submit", SCENE, "--wait", "-o", f.path("first.exr"), *WINDOW, *first)
            refined = f.sheaf("refine", "jobs/1", *then, "-o", f.path("then.exr"), "--json").stdout
            return last_json(refined)["frames"][0], farm.image_digest(f.path("then.exr"))

    def test_refining_matches_an_uninterrupted_run(self):
        done = farm.render(SCENE, self.path("many.exr"), *WINDOW, "--samples", 192, "--json")
        at_once = last_json(done.stdout)["frames"][0]
        frame, digest = self.refined(("--samples", 48), ("--samples", 192))
        self.assertEqual(digest, farm.image_digest(self.path("many.exr")))
        # Existing samples were not rendered again: the ray count equals that of a single run.
        self.assertEqual(frame["progress"]["ray_count"], at_once["progress"]["ray_count"])
        frame, digest = self.refined(("--target-error", 4 * TARGET), ("--target-error", TARGET))
        self.assertEqual(digest, self.expected)
        self.assertEqual(frame["progress"]["ray_count"], self.frame["progress"]["ray_count"])
        self.assertEqual([r["sample_count"] for r in frame["rounds"]],
                         [r["sample_count"] for r in self.frame["rounds"]])

    def test_frame_of_uniform_samples_is_refined_to_an_error(self):
        frame, _ = self.refined(("--samples", 24), ("--target-error", TARGET))
        self.assertEqual(frame["stop_reason"], "target-error")
        self.assertLessEqual(frame["rounds"][-1]["relative_mse_upper"], TARGET)
        pixels = 96 * 64
        self.assertEqual(frame["rounds"][0]["sample_count"], 24 * pixels)

    def test_removed_parts_are_rendered_again(self):
        frame, digest = self.refined(("--target-error", 4 * TARGET), ("--target-error", TARGET),
                                     ("--kept-parts-max", "0"))
        self.assertEqual(digest, self.expected)
        self.assertEqual(frame["stop_reason"], "target-error")

    def test_only_finished_jobs_are_refined_and_only_forward(self):
        with farm.Farm() as f:
            job = f.sheaf("submit", SCENE, *WINDOW, "--samples", 16).stdout.strip()
            refused = f.sheaf("refine", job, "--samples", 32, check=False)
            self.assertIn("is not finished yet", refused.stderr)
            f.start_worker()
            f.sheaf("watch", job)
            self.assertIn("already has 16 samples",
                          f.sheaf("refine", job, "--samples", 8, check=False).stderr)
            self.assertIn("a refinement needs a limit", f.sheaf("refine", job, check=False).stderr)
            self.assertIn("no such job",
                          f.sheaf("refine", "jobs/9", "--samples", 32, check=False).stderr)
            # The target is already reached, so the refinement changes nothing.
            before = last_json(f.sheaf("show", job, "--json").stdout)
            f.sheaf("refine", job, "--samples", 16, "--wait")
            self.assertEqual(last_json(f.sheaf("show", job, "--json").stdout), before)

    def test_refined_job_survives_kills(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            f.start_worker()
            f.sheaf("submit", SCENE, "--wait", "-o", f.path("first.exr"), *WINDOW,
                    "--target-error", 4 * TARGET)
            f.sheaf("refine", "jobs/1", "--target-error", TARGET)
            time.sleep(0.3)
            f.kill(f.coordinator)
            f.start_coordinator()
            f.kill(f.workers[0])
            f.start_worker()
            f.sheaf("watch", "jobs/1", "-o", f.path("then.exr"))
            self.assertEqual(farm.image_digest(f.path("then.exr")), self.expected)

    def test_invalid_arguments_are_refused(self):
        for flags in (("--target-error", 0), ("--target-error", "nan"), ("--time", "10"),
                      ("--time", "-3s"), ("--time", "inf"), ("--budget", 0)):
            with self.subTest(flags=flags), self.assertRaisesRegex(AssertionError, flags[0]):
                farm.render(SCENE, self.path("no.exr"), *flags)


if __name__ == "__main__":
    unittest.main(verbosity=2)
