#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Jobs wait for jobs and frames for frames, also over restarts of the coordinator; a job that waits
in vain says so and is released; approved images have the bits of others; workers are drained.
"""
import hashlib
import json
import os
import tempfile
import unittest

import client_case
import farm

JOB = ("--tile-size", "16", "--pass-samples", "16")
SAMPLES = 64
SECONDS_MAX = 20


def sha256(path):
    return hashlib.sha256(farm.read_bytes(path)).hexdigest()


class SchedulingHoldsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.scene = os.path.join(folder.name, "scene.pbrt")
        with open(self.scene, "w", encoding="utf-8") as file:
            file.write(client_case.SCENE)
        pattern = os.path.join(folder.name, "shot.##.pbrt")
        for number in (1, 2):
            with open(pattern.replace("##", f"{number:02}"), "w", encoding="utf-8") as file:
                file.write(client_case.SCENE)
        self.shot = ("submit", pattern, "--frames", "1-2", *JOB, "--samples", SAMPLES)

    def submit(self, f, *arguments):
        return f.sheaf("submit", self.scene, *JOB, *arguments).stdout.strip()

    def show(self, f, job):
        return json.loads(f.sheaf("show", job, "--json").stdout)

    def await_state(self, f, job, state):
        return farm.wait_until(lambda: (found := self.show(f, job))["state"] == state and found,
                               SECONDS_MAX, f"{job} {state}")

    def restart(self, f):
        f.kill(f.coordinator)
        f.start_coordinator()

    def worker_id(self, f):
        """The name of the only worker that works."""
        def find():
            lines = f.sheaf("workers", "--json").stdout.splitlines()
            workers = [json.loads(line) for line in lines]
            there = [w["name"] for w in workers if w["state"] in ("idle", "busy")]
            return there[0] if len(there) == 1 else None
        return farm.wait_until(find, SECONDS_MAX, "one worker")

    def test_deadlines_are_kept(self):
        with farm.Farm() as f:
            job = self.submit(f, "--deadline", "2100-01-02 10:30")
            refused = f.sheaf("submit", self.scene, "--deadline", "2001-01-01 10:00", check=False)
            self.assertEqual(refused.returncode, client_case.USAGE)
            self.assertIn("has passed", refused.stderr)
            self.assertIsNone(self.show(f, self.submit(f))["deadline_time"])
            stated = self.show(f, job)["deadline_time"]
            self.assertTrue(stated.startswith("2100-01-0"), stated)
            self.assertFalse(self.show(f, job)["held"])
            self.assertGreater(f.metrics()['sheaf_work_left_cpu_seconds{pool="default"}'], 0)
            f.sheaf("pause", job)
            self.assertTrue(self.show(f, job)["held"])
            self.restart(f)
            self.assertEqual(self.show(f, job)["deadline_time"], stated)
            self.assertIn("deadline   2100-01-0", f.sheaf("show", job).stdout)

    def test_jobs_wait_for_jobs_and_frames_for_frames(self):
        with farm.Farm() as f:
            first = f.sheaf(*self.shot).stdout.strip()
            whole = self.submit(f, "--after", first)
            frames = f.sheaf(*self.shot, "--after", first + ":frames").stdout.strip()
            vain = self.submit(f, "--after", first.removeprefix("jobs/"))
            refused = f.sheaf("submit", self.scene, *JOB, "--after", "99", check=False)
            self.assertIn("--after 99: jobs/99: there is no such job", refused.stderr)
            refused = f.sheaf("submit", self.scene, *JOB, "--after", whole + ":frames",
                              "--frames", "7", check=False)
            self.assertNotEqual(refused.returncode, 0)
            self.restart(f)
            self.assertEqual(self.show(f, whole)["waiting_reason"], f"waiting for {first}")
            waiting = self.show(f, frames)
            self.assertEqual(waiting["dependencies"],
                             [{"job_name": first, "by_frame": True, "state": "waits"}])
            self.assertIn(f"waits for frame 2 of {first}", waiting["frames"][1]["waiting_reason"])
            self.assertIn(f"waiting for {first}", f.sheaf("list").stdout)
            f.sheaf("kill", first, "--frame", 2)
            f.start_worker()
            farm.wait_until(lambda: self.show(f, frames)["frames"][0]["complete"], SECONDS_MAX,
                            "the frame whose dependency is delivered")
            self.await_state(f, first, "failed")
            for job in (whole, frames, vain):
                held = self.show(f, job)
                self.assertIn(held["state"], ("queued", "running"))
                self.assertIn(f"has failed: sheaf release {job} starts this job anyway",
                              held["waiting_reason"])
            self.assertFalse(self.show(f, frames)["frames"][1]["complete"])
            f.sheaf("cancel", vain)
            self.assertIn("released", f.sheaf("release", frames).stdout)
            self.restart(f)
            self.await_state(f, frames, "succeeded")
            self.assertEqual(self.show(f, frames)["dependencies"][0]["state"], "released")
            self.assertEqual(self.show(f, whole)["progress"]["sample_count_done"], 0)
            f.sheaf("retry", first)
            self.await_state(f, first, "succeeded")
            self.await_state(f, whole, "succeeded")
            self.assertEqual(self.show(f, vain)["state"], "cancelled")

    def test_approved_images_have_the_same_bits(self):
        with farm.Farm() as f:
            f.start_worker()
            plain, approved = f.path("plain.exr"), f.path("approved.##.exr")
            f.sheaf("submit", self.scene, *JOB, "--samples", SAMPLES, "--wait", "-o", plain)
            job = f.sheaf(*self.shot, "--approve-after", 16).stdout.strip()
            held = farm.wait_until(
                lambda: (found := self.show(f, job))["unapproved_frame_count"] == 2 and found,
                SECONDS_MAX, "frames that wait")
            self.assertIn(f"waiting for approval: sheaf approve {job}", held["waiting_reason"])
            self.assertEqual(held["state"], "running")
            self.assertTrue(held["frames"][0]["complete"], "there is an image to look at")
            self.assertNotEqual(held["frames"][0]["image_digest"], farm.image_digest(plain))
            self.restart(f)
            self.assertIn("1 frame still waits",
                          f.sheaf("approve", job, "--frames", 2).stdout)
            farm.wait_until(lambda: self.show(f, job)["frames"][1]["complete"], SECONDS_MAX,
                            "the approved frame")
            self.assertEqual(self.show(f, job)["unapproved_frame_count"], 1)
            self.restart(f)
            f.sheaf("approve", job)
            f.sheaf("approve", job)  # Again changes nothing.
            f.sheaf("watch", job, "-o", approved)
            one, two = (f.path(f"approved.{n:02}.exr") for n in (1, 2))
            self.assertEqual(farm.image_digest(one), farm.image_digest(plain))
            self.assertEqual(farm.image_digest(two), farm.image_digest(plain))
            straight = f.path("straight.##.exr")
            f.sheaf(*self.shot, "--wait", "-o", straight)
            for n in (1, 2):
                self.assertEqual(sha256(f.path(f"approved.{n:02}.exr")),
                                 sha256(f.path(f"straight.{n:02}.exr")))
            refused = f.sheaf("approve", job, "--frames", 9, check=False)
            self.assertIn("has no frame 9", refused.stderr)
            refused = f.sheaf(*self.shot, "--approve-after", 12, check=False)
            self.assertIn("not a power of two; choose 8", refused.stderr)
            rejected = self.submit(f, "--samples", SAMPLES, "--approve-after", 16)
            farm.wait_until(lambda: self.show(f, rejected)["unapproved_frame_count"] == 1,
                            SECONDS_MAX, "a frame that waits")
            f.sheaf("cancel", rejected)
            refused = f.sheaf("approve", rejected, check=False)
            self.assertIn("was cancelled", refused.stderr)

    def test_workers_are_drained(self):
        with farm.Farm() as f:
            process = f.start_worker()
            worker = self.worker_id(f)
            self.assertIn("draining", f.sheaf("drain", worker.removeprefix("workers/")).stdout)
            job = self.submit(f, "--samples", SAMPLES)
            self.restart(f)
            farm.wait_until(lambda: "sheaf undrain" in self.show(f, job)["waiting_reason"],
                            SECONDS_MAX, "a job that waits for a drained worker")
            self.assertIn("drained", f.sheaf("workers").stdout)
            f.sheaf("undrain", worker)
            self.await_state(f, job, "succeeded")
            self.assertIsNone(process.poll())
            host = json.loads(f.sheaf("workers", "--json").stdout.splitlines()[0])["host"]
            f.sheaf("drain", "--all-of-host", host, "--then-exit")
            self.assertEqual(process.wait(SECONDS_MAX * farm.PATIENCE), 0)
            f.start_worker()
            self.submit(f, "--samples", SAMPLES, "--wait", "-o", f.path("after.exr"))
            refused = f.sheaf("drain", "nobody", check=False)
            self.assertIn("no such worker", refused.stderr)


if __name__ == "__main__":
    unittest.main()
