#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A scene that needs more memory than the workers have: its job fails with a clear message, other
jobs continue, and the workers survive.
"""
import json
import os
import resource
import signal
import tempfile
import time
import unittest

import farm

HUGE = """Camera "perspective"
Film "rgb" "integer xresolution" 32 "integer yresolution" 32
WorldBegin
LightSource "infinite"
Shape "loopsubdiv" "integer levels" %d "integer indices" [0 1 2 0 2 3 0 3 1 1 3 2]
  "point3 P" [-1 -1 5  1 -1 5  0 1 5  0 0 6]
"""
# By how much a running worker's address space may grow. A scene's process has the same limit, and
# begins smaller by what the worker's threads reserve, 200 to 400 MiB.
# Beyond what a worker that has started has; far less than the scene needs.
ROOM = 256 << 20


class MemoryTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def scene(self, levels):
        path = os.path.join(self.folder, f"levels{levels}.pbrt")
        with open(path, "w", encoding="utf-8") as file:
            file.write(HUGE % levels)
        return path

    def submit(self, f, scene):
        done = f.sheaf("submit", scene, "--samples", "1", "--json")
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def start_worker(self, f, *arguments):
        worker = f.start_worker(*arguments)
        name = f"worker{f.worker_count}"
        # Listed once it has spoken to the coordinator: it is as large as it is without work.
        farm.wait_until(lambda: f.sheaf("workers", "--json").stdout.count("\n") == f.worker_count,
                        30, "the worker")
        with open(f"/proc/{worker.pid}/statm", encoding="ascii") as file:
            limit = int(file.read().split()[0]) * resource.getpagesize() + ROOM
        resource.prlimit(worker.pid, resource.RLIMIT_AS, (limit, limit))
        return worker

    def failure(self, f, job):
        done = f.sheaf("watch", job, "--json", check=False)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        return json.loads(done.stdout.splitlines()[-1])["failure"]

    def phases(self, f):
        from urllib.request import urlopen
        text = urlopen(f"http://{f.http}/api/v1/workers", timeout=10 * farm.PATIENCE).read()
        return [lease["phase"] for worker in json.loads(text)["workers"]
                for lease in worker["leases"]]

    def test_scene_beyond_the_worker_memory_fails_without_killing_workers(self):
        with farm.Farm(["--lease-seconds", "2", "--poison-workers", "2"]) as f:
            workers = [self.start_worker(f) for _ in range(2)]
            huge = self.submit(f, self.scene(11))
            text = self.failure(f, huge)
            self.assertIn("levels11.pbrt:5:1", text)
            self.assertIn("11 levels make 16777216 triangles", text)
            self.assertIn("address space", text)
            small = self.submit(f, self.scene(3))
            self.assertEqual(f.sheaf("watch", small).returncode, 0)
            self.assertTrue(all(worker.poll() is None for worker in workers))
            from urllib.request import urlopen
            listed = urlopen(f"http://{f.http}/api/v1/{huge}/failures",
                             timeout=10 * farm.PATIENCE).read()
            self.assertIn('"kind":"memory"', listed.decode().replace(" ", ""))

    def test_crashing_scene_fails_after_a_few_workers(self):
        """The cause does not matter: the test kills each worker while it loads the scene."""
        with farm.Farm(["--lease-seconds", "1"]) as f:
            scene = self.scene(10)  # Takes seconds to load.
            job = self.submit(f, scene)
            killed = 0
            end = time.monotonic() + 90 * farm.PATIENCE
            while time.monotonic() < end:
                state = json.loads(f.sheaf("list", "--json").stdout.splitlines()[0])
                if state["state"] == "failed":
                    break
                worker = f.start_worker()
                name = f"worker{f.worker_count}"
                farm.wait_until(lambda: "loading" in self.phases(f), 30, "a worker that loads")
                self.assertNotIn("is ready", f.log(name), "it was to be killed while it loads")
                worker.send_signal(signal.SIGKILL)
                worker.wait()
                killed += 1
            self.assertEqual(state["state"], "failed")
            self.assertIn("while they loaded", self.failure(f, job))
            self.assertGreaterEqual(killed, 3)
            f.start_worker()
            small = self.submit(f, self.scene(3))
            self.assertEqual(f.sheaf("watch", small).returncode, 0)

    def test_plan_reports_costs(self):
        said = farm.local("plan", self.scene(9))
        self.assertIn("1048576 triangles", said)
        self.assertRegex(said, r"memory: about \d+ MiB")


if __name__ == "__main__":
    unittest.main(verbosity=2)
