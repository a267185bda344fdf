#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Tasks that fail, by class: which workers get them again, what users are told, and what they can
do about it. The causes are real: tasks that do not end, scenes beyond a worker's memory.
"""
import json
import os
import tempfile
import unittest

import farm

SCENE = os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
# One task, which no worker finishes within a second.
ENDLESS = ("--crop", "192,64,224,96", "--tile-size", "32", "--samples", str(1 << 20),
           "--pass-samples", str(1 << 20), "--lease-passes", "1")
LARGE = """Camera "perspective"
Film "rgb" "integer xresolution" 16 "integer yresolution" 16
WorldBegin
LightSource "infinite"
Shape "loopsubdiv" "integer levels" 8 "integer indices" [0 1 2 0 2 3 0 3 1 1 3 2]
  "point3 P" [-1 -1 5  1 -1 5  0 1 5  0 0 6]
"""
FAILURES = 'sheaf_lease_failures_total{kind="%s"}'


class FailureClassesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def scene(self, text):
        path = os.path.join(self.folder, "scene.pbrt")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def submit(self, f, scene, *arguments):
        done = f.sheaf("submit", scene, *arguments, "--json")
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def show(self, f, job):
        return f.sheaf("show", job).stdout

    def await_words(self, f, job, words):
        return farm.wait_until(lambda: words in self.show(f, job) and self.show(f, job), 60, words)

    def state(self, f, job):
        return json.loads(f.sheaf("show", job, "--json").stdout)["state"]

    def test_crashes_go_to_other_workers_until_three_have_failed(self):
        with farm.Farm() as f:
            f.start_worker("--task-seconds-max", "1")
            job = self.submit(f, SCENE, *ENDLESS)
            shown = self.await_words(f, job, "waiting for another worker: ")
            self.assertIn("failed this task by a crash (frame ", shown)
            # The failed-by set is durable.
            f.kill(f.coordinator)
            f.start_coordinator()
            farm.wait_until(lambda: f.metrics().get('sheaf_workers{state="idle"}') == 1, 60,
                            "the worker")
            self.await_words(f, job, "waiting for another worker: ")
            self.assertEqual(f.metrics()[FAILURES % "internal"], 0, "it did not get it again")
            for _ in range(2):
                f.start_worker("--task-seconds-max", "1")
            shown = self.await_words(f, job, "state      failed")
            self.assertIn("1 of 1 frame is incomplete", shown)
            self.assertIn("did not finish within 1s", shown)
            self.assertEqual(shown.count(" by a crash"), 2 * 3, shown)
            metrics = f.metrics()
            self.assertEqual(metrics[FAILURES % "internal"], 2)
            self.assertEqual(metrics["sheaf_tasks_poisoned_total"], 1)
            self.assertEqual(metrics["sheaf_frames_incomplete_total"], 1)

            for worker in list(f.workers):
                f.kill(worker)  # So that none fails it again meanwhile.
            f.sheaf("retry", job)
            self.assertIn(self.state(f, job), ("queued", "running"))
            frame = json.loads(f.sheaf("show", job, "--json").stdout)["frames"][0]["frame_number"]
            f.sheaf("kill", job, "--frame", frame, "--task", "0")
            shown = self.await_words(f, job, "state      failed")
            self.assertIn("killed by local", shown)
            self.assertEqual(f.metrics()["sheaf_tasks_retried_total"], 1)
            self.assertEqual(f.metrics()["sheaf_tasks_killed_total"], 1)
            refused = f.sheaf("kill", job, "--frame", frame, check=False)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("has ended", refused.stdout + refused.stderr)

    def test_scenes_beyond_the_memory_of_three_workers_leave_frames_incomplete(self):
        with farm.Farm() as f:
            for _ in range(3):
                f.start_worker("--scene-memory-max", "16M")
            farm.wait_until(lambda: f.metrics().get('sheaf_workers{state="idle"}') == 3, 60,
                            "the workers")
            job = self.submit(f, self.scene(LARGE), "--samples", "1")
            shown = self.await_words(f, job, "state      failed")
            self.assertIn("lack the memory to load its scene", shown)
            self.assertGreaterEqual(f.metrics()[FAILURES % "memory"], 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
