#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Bundles reproduce real failures in their class, and render good tasks as the farm did."""
import glob
import hashlib
import json
import os
import tarfile
import tempfile
import unittest

import farm
from failure_classes_test import ENDLESS, LARGE, SCENE

SMALL = """Camera "perspective"
Film "rgb" "integer xresolution" 32 "integer yresolution" 32
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Translate 0 0 3
Shape "sphere"
"""
SAMPLES = 16
RENDERED, AS_RECORDED, OTHERWISE, UNREADABLE = 0, 1, 7, 6


class ReproTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def scene(self, text):
        path = self.path("scene.pbrt")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def submit(self, f, scene, *arguments):
        done = f.sheaf("submit", scene, *arguments, "--json")
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def await_state(self, f, job, state):
        return farm.wait_until(
            lambda: (found := json.loads(f.sheaf("show", job, "--json").stdout))["state"] == state
            and found, 60, f"{job} {state}")

    def repro(self, f, bundle, *arguments):
        done = f.sheaf("repro", bundle, "--json", *arguments, check=False)
        self.assertIn(done.returncode, (RENDERED, AS_RECORDED, OTHERWISE), done.stderr)
        return done.returncode, json.loads(done.stdout)

    def bundle_of(self, f, job, kind):
        """Fails where the command that sheaf show prints does not write it."""
        self.await_state(f, job, "failed")
        command = next(line.split("to reproduce: sheaf ")[1] for line in
                       f.sheaf("show", job).stdout.splitlines() if "to reproduce: " in line)
        path = self.path(kind + ".tar")
        f.sheaf(*command.split(), "-o", path)
        return path

    def check_failure(self, f, job, kind, *arguments):
        path = self.bundle_of(f, job, kind)
        code, found = self.repro(f, path, *arguments)
        self.assertEqual((code, found["kind"]), (AS_RECORDED, kind), found)
        self.assertTrue(found["same_message"], found)
        return path

    def test_failures_are_reproduced_and_good_tasks_rendered(self):
        with farm.Farm(["--poison-workers", "1"]) as f:
            worker = f.start_worker("--task-seconds-max", "1")
            crash = self.submit(f, SCENE, *ENDLESS)
            path = self.check_failure(f, crash, "internal", "--task-seconds-max", "1")
            self.check_broken(f, path)
            f.kill(worker)
            f.start_worker("--scene-memory-max", "16M")
            large = self.submit(f, self.scene(LARGE), "--samples", "1")
            path = self.check_failure(f, large, "memory", "--memory-limit", "16M")
            code, found = self.repro(f, path)
            self.assertEqual((code, found["ending"]), (RENDERED, "rendered"), "with more memory")
            # This comes last: once a worker has delivered results, failures of other workers alone
            # are not believed.
            self.check_good(f, self.submit(f, self.scene(SMALL), "--samples", SAMPLES,
                                           "--pass-samples", SAMPLES, "--lease-passes", "1"))

    def check_good(self, f, job):
        self.await_state(f, job, "succeeded")
        bundle, part = self.path("good.tar"), self.path("part.exr")
        f.sheaf("bundle", job + ":1:0", "-o", bundle)
        for sandbox in ((), ("--no-sandbox",)):
            code, found = self.repro(f, bundle, "-o", part, *sandbox)
            self.assertEqual(code, RENDERED, found)
            digest = hashlib.sha256(farm.read_bytes(part)).hexdigest()
            self.assertEqual(digest, found["part_sha256"])
            kept = {hashlib.sha256(farm.read_bytes(path)).hexdigest()
                    for path in glob.glob(f.path("state", "parts", "**"), recursive=True)
                    if os.path.isfile(path)}
            self.assertIn(digest, kept, "the farm's part is another one")
        with tarfile.open(bundle) as tar:
            names = tar.getnames()
            task = json.load(tar.extractfile("task.json"))
        self.assertEqual((names[0], names[-1]), ("task.json", "SHA256SUMS"))
        self.assertEqual(task["frame_name"], job + "/frames/1")

    def check_broken(self, f, path):
        """Cut or altered files are refused with a message, and so are tasks that do not exist."""
        whole = farm.read_bytes(path)
        flipped = bytearray(whole)
        flipped[len(whole) // 2] ^= 1
        broken = self.path("broken.tar")
        for data, words in ((whole[:-700], "ends too early"), (bytes(flipped), "altered"),
                            (b"not a bundle", "ends too early")):
            with open(broken, "wb") as file:
                file.write(data)
            done = f.sheaf("repro", broken, check=False)
            self.assertEqual(done.returncode, UNREADABLE, done.stdout)
            self.assertIn(words, done.stderr)
        self.assertIn("is not of the form", f.sheaf("bundle", "1:x", check=False).stderr)
        done = f.sheaf("bundle", "jobs/1:1:999", "-o", broken, check=False)
        self.assertIn("has no task 999", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
