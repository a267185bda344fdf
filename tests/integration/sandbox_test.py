#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes in processes of their own: the image is the same, and whatever ends such a process fails
a task, is told to the user, and leaves the worker to render the next job.
"""
import json
import os
import signal
import tempfile
import unittest
from urllib.request import urlopen

import farm

SCENE = os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
SMALL = ("--crop", "200,80,328,144", "--tile-size", "32", "--samples", "16")
ENDLESS = ("--crop", "200,80,232,112", "--tile-size", "32", "--samples", str(1 << 20),
           "--pass-samples", str(1 << 20), "--lease-passes", "1")
NO_IMAGE = """Camera "perspective"
Film "rgb" "integer xresolution" 16 "integer yresolution" 16
WorldBegin
LightSource "infinite"
Texture "file" "spectrum" "imagemap" "string filename" "/etc/passwd"
Material "diffuse" "texture reflectance" "file"
Shape "sphere"
"""


def children_of(pid):
    """The processes that the process has started, and theirs."""
    with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as file:
        direct = [int(child) for child in file.read().split()]
    for thread in os.listdir(f"/proc/{pid}/task"):
        if int(thread) != pid:
            try:
                with open(f"/proc/{pid}/task/{thread}/children", encoding="ascii") as file:
                    direct += [int(child) for child in file.read().split()]
            except FileNotFoundError:
                continue
    return direct + [below for child in direct for below in children_of(child)]


def is_running(pid):
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


class SandboxTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def submit(self, f, scene, *arguments):
        done = f.sheaf("submit", scene, *arguments, "--json")
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def failure(self, f, job):
        """The message and the classes of failure of a job that fails."""
        done = f.sheaf("watch", job, "--json", check=False)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        listed = json.load(urlopen(f"http://{f.http}/api/v1/{job}/failures",
                                   timeout=10 * farm.PATIENCE))
        message = json.loads(done.stdout.splitlines()[-1])["failure"]
        return message, {failure["kind"] for failure in listed["failures"]}

    def expect_next_job_renders(self, f, worker):
        self.assertEqual(f.sheaf("watch", self.submit(f, SCENE, *SMALL)).returncode, 0)
        self.assertIsNone(worker.poll(), "the worker lives")

    def scene_processes(self, worker):
        return farm.wait_until(lambda: children_of(worker.pid), 30, "a scene's process")

    def await_rendering(self, f):
        farm.wait_until(lambda: "is ready" in f.log("worker1"), 60, "the scene")

    def test_image_is_the_same_in_every_mode(self):
        expected = os.path.join(self.folder, "expected.exr")
        farm.render(SCENE, expected, *SMALL)
        for mode in ("none", "best", "required"):
            with self.subTest(mode), farm.Farm() as f:
                worker = f.start_worker("--sandbox", mode, threads=2)
                farm.wait_until(lambda: "works for" in f.log("worker1") or
                                worker.poll() is not None, 30, "the worker")
                if mode == "required" and worker.poll() is not None:
                    self.assertIn("--sandbox=best", f.log("worker1"))
                    self.skipTest("this system does not permit all protections")
                self.assertEqual("protections:" in f.log("worker1"), mode != "none")
                f.sheaf("submit", SCENE, *SMALL, "--wait", "-o", f.path("out.exr"))
                self.assertEqual(farm.image_digest(f.path("out.exr")),
                                 farm.image_digest(expected))

    def test_file_that_is_no_image_fails_the_job_with_a_reason(self):
        scene = os.path.join(self.folder, "no-image.pbrt")
        with open(scene, "w", encoding="utf-8") as file:
            file.write(NO_IMAGE)
        with farm.Farm() as f:
            worker = f.start_worker()
            done = f.sheaf("submit", scene, "--samples", "1", "--wait", "-o", f.path("out.exr"),
                           check=False)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("/etc/passwd", done.stdout + done.stderr)
            self.expect_next_job_renders(f, worker)

    def test_task_that_never_ends_is_stopped(self):
        with farm.Farm(["--poison-workers", "1"]) as f:
            worker = f.start_worker("--task-seconds-max", "1")
            message, kinds = self.failure(f, self.submit(f, SCENE, *ENDLESS))
            self.assertIn("did not finish within 1s", message)
            self.assertEqual(kinds, {"internal"})
            self.expect_next_job_renders(f, worker)

    def test_killed_process_counts_as_lack_of_memory_and_is_started_again(self):
        expected = os.path.join(self.folder, "expected.exr")
        farm.render(SCENE, expected, *SMALL)
        with farm.Farm() as f:
            worker = f.start_worker()
            job = self.submit(f, SCENE, *SMALL[:-1], "1024")
            self.await_rendering(f)
            before = f.metrics()["sheaf_results_accepted_total"]
            os.kill(self.scene_processes(worker)[-1], signal.SIGKILL)
            farm.wait_until(lambda: "when memory runs out" in f.log("worker1"), 30, "the failure")
            farm.wait_until(lambda: f.metrics()["sheaf_results_accepted_total"] > before + 1, 60,
                            "results of another process")
            f.sheaf("cancel", job)
            self.expect_next_job_renders(f, worker)

    def test_processes_end_with_the_worker(self):
        for kill in (signal.SIGKILL, signal.SIGTERM):
            with self.subTest(kill.name), farm.Farm() as f:
                worker = f.start_worker("--grace-seconds", "0")
                self.submit(f, SCENE, *ENDLESS[:-1], "1")
                self.await_rendering(f)
                processes = self.scene_processes(worker)
                worker.send_signal(kill)
                farm.wait_until(lambda: not any(is_running(pid) for pid in processes), 60,
                                "the end of the scene's processes")
                worker.wait(timeout=60 * farm.PATIENCE)


if __name__ == "__main__":
    unittest.main(verbosity=2)
