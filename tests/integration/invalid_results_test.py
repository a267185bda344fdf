#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Results that are no parts: refused, told, set aside, and bundled with a task that renders well.

Runs with the interpreter of python_package_test.py, whose stubs the broken workers use.
"""
import json
import os
import tempfile
import unittest

import farm
from client_case import SCENE
from python_package_test import setUpModule  # noqa: F401  unittest calls it.

WORKERS_MAX = 2  # invalid_workers_max of coordinator/core/job/limits.h.
JOB = ("--samples", "16", "--pass-samples", "16", "--tile-size", "32", "--crop", "0,0,32,32",
       "--lease-passes", "1")


class InvalidResultsTest(unittest.TestCase):
    def test_tasks_with_refused_results_are_set_aside_and_bundled(self):
        import grpc
        from broken_worker import BrokenWorker
        with farm.Farm() as f, tempfile.TemporaryDirectory() as folder:
            scene = os.path.join(folder, "scene.pbrt")
            with open(scene, "w", encoding="utf-8") as file:
                file.write(SCENE)
            submitted = f.sheaf("submit", scene, *JOB, "--json").stdout
            job = json.loads(submitted.splitlines()[-1])
            for number in range(WORKERS_MAX):
                worker = BrokenWorker(f.address, f"broken-{number}", job["numeric_profile"])
                self.addCleanup(worker.close)
                # A worker's results are refused once; then it no longer has the task.
                self.assertEqual(farm.wait_until(worker.deliver, 30, "a lease"),
                                 grpc.StatusCode.INVALID_ARGUMENT)
                self.assertIsNone(worker.deliver())
            self.check_told(f, job["name"])
            bundle = os.path.join(folder, "task.tar")
            f.sheaf("bundle", job["name"] + ":1:0", "-o", bundle)
            # The fault is the workers', so the task renders here, and elsewhere on the farm.
            found = json.loads(f.sheaf("repro", bundle, "--json").stdout)
            self.assertEqual(found["ending"], "rendered")
            self.assertEqual([failure["kind"] for failure in found["recorded"]],
                             WORKERS_MAX * ["invalid"])
            f.start_worker()
            f.sheaf("retry", job["name"])
            self.await_state(f, job["name"], "succeeded")

    def show(self, f, job):
        return json.loads(f.sheaf("show", job, "--json").stdout)

    def await_state(self, f, job, state):
        farm.wait_until(lambda: self.show(f, job)["state"] == state, 60, f"{job} {state}")

    def check_told(self, f, job):
        self.await_state(f, job, "failed")
        text = f.sheaf("show", job).stdout
        self.assertIn("invalid", text)
        for number in range(WORKERS_MAX):
            self.assertIn(f"broken-{number}", text)
        failures = f.metrics()
        self.assertEqual(failures['sheaf_lease_failures_total{kind="invalid"}'], WORKERS_MAX)


if __name__ == "__main__":
    unittest.main(verbosity=2)
