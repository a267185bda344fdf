#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The client's reports of workers that have ended and of black images."""
import json
import os
import tempfile
import unittest

import farm
from client_case import SCENE, run


class ToldTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def write(self, name, text):
        path = os.path.join(self.folder.name, name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def test_orderly_worker_shutdown_is_no_loss(self):
        with farm.Farm(["--lease-seconds", "1"]) as f:
            def states():
                return [json.loads(line)["state"]
                        for line in f.sheaf("workers", "--json").stdout.splitlines()]

            worker = f.start_worker()
            farm.wait_until(lambda: states() == ["idle"], 30, "the worker")
            worker.terminate()
            worker.wait()
            self.assertEqual(states(), ["stopped"])
            killed = f.start_worker()
            farm.wait_until(lambda: "idle" in states(), 30, "the other worker")
            f.kill(killed)
            farm.wait_until(lambda: sorted(states()) == ["lost", "stopped"], 30, "the loss")
            metrics = f.metrics()
            self.assertEqual(metrics["sheaf_workers_lost_total"], 1)
            self.assertEqual(metrics['sheaf_workers{state="stopped"}'], 1)

    def test_black_images_are_reported_before_and_after(self):
        sky = 'LightSource "infinite" "rgb L" [0.5 0.6 0.7]'
        behind = 'LightSource "distant" "point3 from" [0 0 1] "point3 to" [0 0 0]'
        dark = self.write("dark.pbrt", SCENE.replace(sky, ""))
        behind = self.write("behind.pbrt", SCENE.replace(sky, behind))
        missing = "dark.pbrt: nothing in the scene emits light"
        self.assertIn(missing, run("plan", dark).stderr)
        with farm.Farm() as f:
            self.assertIn(missing, f.sheaf("submit", dark, "--samples", 1).stderr)
        exr = os.path.join(self.folder.name, "dark.exr")
        for scene, told in ((dark, True), (behind, False), (self.write("lit.pbrt", SCENE), False)):
            said = farm.render(scene, exr, "--samples", 1).stderr
            self.assertEqual(missing in said, told, said)
            self.assertEqual("every pixel is black" in said, "lit.pbrt" not in scene, said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
