#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Farms on machines whose clock is set or whose disk fills up during the work.

Usage: machine_faults_test.py FAULTS, the library of tests/support/machine_faults.cc.
"""
import errno
import json
import os
import sys
import time
import unittest
from urllib.error import HTTPError
from urllib.request import urlopen

import farm
from machine_faults import MachineFaults

SCENE = os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
JOB = ("--crop", "200,80,328,176", "--tile-size", "32", "--pass-samples", "16", "--lease-passes",
       "1", "--samples")
LEASE_SECONDS = 2
JUMP_SECONDS = 3 * 3600  # Longer than lost workers are remembered and than any lease may last.


class MachineFaultsTest(unittest.TestCase):
    def make_farm(self):
        f = farm.Farm(["--lease-seconds", str(LEASE_SECONDS)])
        self.faults = MachineFaults(FAULTS, f.path("faults"))
        f.environment.update(self.faults.environment)
        return f

    def submit(self, f, samples):
        submitted = f.sheaf("submit", SCENE, *JOB, samples, "--json").stdout
        return json.loads(submitted.splitlines()[-1])["name"]

    def show(self, f, job):
        return json.loads(f.sheaf("show", job, "--json").stdout)

    def accepted(self, f):
        return f.metrics()["sheaf_results_accepted_total"]

    def await_progress(self, f):
        before = self.accepted(f)
        farm.wait_until(lambda: self.accepted(f) > before + 3, 30, "more results")

    def test_clock_jumps_lose_no_worker_and_cause_no_delay(self):
        with self.make_farm() as f:
            begin = time.monotonic()
            for _ in range(2):
                f.start_worker()
            job = self.submit(f, 8192)  # More than this test renders.
            self.await_progress(f)
            for seconds in (JUMP_SECONDS, 0, -JUMP_SECONDS):
                self.faults.set(clock_offset_seconds=seconds)
                time.sleep(LEASE_SECONDS / 2)
                self.assertIsNone(f.coordinator.poll(), f"off by {seconds} s")
                self.await_progress(f)
                metrics = f.metrics()
                self.assertEqual(metrics["sheaf_workers_lost_total"], 0, f"off by {seconds} s")
                self.assertEqual(metrics["sheaf_lease_expired_total"], 0, f"off by {seconds} s")
            # Leases of a worker that dies after the jumps expire on time.
            f.kill(f.workers[0])
            farm.wait_until(lambda: f.metrics()["sheaf_workers_lost_total"] == 1,
                            5 * LEASE_SECONDS, "the dead worker is lost")
            wall_seconds = self.show(f, job)["progress"]["wall_duration_seconds"]
            self.assertGreater(wall_seconds, 0)
            self.assertLess(wall_seconds, time.monotonic() - begin)

    def is_ready(self, f):
        try:
            return urlopen(f"http://{f.http}/readyz", timeout=10 * farm.PATIENCE).status == 200
        except HTTPError:
            return False

    def test_full_disk_is_reported_and_nothing_is_lost(self):
        with self.make_farm() as f:
            f.start_worker()
            job = self.submit(f, 128)
            self.await_progress(f)
            self.faults.set(write_error=errno.ENOSPC)
            farm.wait_until(lambda: not self.is_ready(f), 30, "/readyz tells of the disk")
            self.assertIn("is not writable", self.show(f, job)["waiting_reason"])
            self.assertIn("is not writable", f.sheaf("show", job).stdout)
            farm.wait_until(lambda: "accepts no results" in f.log("worker1"), 10,
                            "the worker's log")
            self.assertIn("No space left on device", f.log("worker1"))
            at_rest = self.accepted(f)
            time.sleep(1)
            self.assertEqual(self.accepted(f), at_rest)
            self.faults.set()
            self.await_progress(f)
            farm.wait_until(lambda: self.is_ready(f), 30, "/readyz tells of the space")
            self.assertEqual(self.show(f, job)["waiting_reason"], "")
            # One upload brings several results, and its answer comes after them.
            farm.wait_until(lambda: "accepts results again" in f.log("worker1"), 10,
                            "the worker's log")
            f.sheaf("watch", job, "-o", f.path("out.exr"))
            expected = f.path("expected.exr")
            farm.render(SCENE, expected, *JOB, 128)
            self.assertEqual(farm.read_bytes(f.path("out.exr")), farm.read_bytes(expected))


if __name__ == "__main__":
    FAULTS = os.path.abspath(sys.argv.pop(1))
    unittest.main(verbosity=2)
