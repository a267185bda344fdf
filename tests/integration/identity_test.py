#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Names and keys that outlive what they named: numbers of jobs that are given again when the
coordinator's state is replaced, and the key by which `sheaf render --keep-state` finds its job.
"""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest
from urllib.request import Request, urlopen

import farm
from client_case import CANCELLED, FAILED, OK, SCENE
from package_build import build_package

sys.dont_write_bytecode = True
sys.path.append(os.path.join(farm.ROOT, "blender"))
from sheaf_blender import jobs
from sheaf_blender.farm.program import SheafError

ENDLESS = 1 << 20
LARGE = SCENE + """Shape "loopsubdiv" "integer levels" 8 "integer indices" [0 1 2 0 2 3 0 3 1 1 3 2]
  "point3 P" [-1 -1 5  1 -1 5  0 1 5  0 0 6]
"""


def setUpModule():
    global sheaf
    sys.path.insert(0, build_package())
    import sheaf


class IdentityTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="sheaf identity ")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def scene(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(text)
        return self.path(name)

    def start(self, *arguments):
        process = subprocess.Popen(
            [os.path.join(farm.programs(), "sheaf"), *map(str, arguments)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        return process

    def wait_in_python(self, address, job, seen, errors):
        with sheaf.connect(address) as client:
            try:
                client.wait(job, images=self.path("python.exr"), on_change=lambda _: seen.set())
            except sheaf.SheafError as error:
                errors.append(error)

    def test_a_number_is_not_a_job(self):
        """Regression: a client that waited for jobs/1 saved the image of another job under its own
        name, with exit code 0.
        """
        mine = self.scene("mine.pbrt", SCENE)
        other = self.scene("other.pbrt", SCENE.replace("48", "96"))
        with farm.Farm() as replaced:  # Its jobs/1 is another job, which has succeeded.
            replaced.start_worker()
            replaced.sheaf("submit", other, "--samples", 1, "--wait", "-o", self.path("other.exr"))
            replaced.coordinator.terminate()
            replaced.coordinator.wait()
            state = self.path("state")
            shutil.copytree(replaced.path("state"), state)
        with farm.Farm() as f:
            at = ("--coordinator", f.address)
            waiting = self.start("submit", mine, "--samples", ENDLESS, "--wait", "-o",
                                 self.path("mine.exr"), "--no-quote", *at)
            farm.wait_until(lambda: "jobs/1" in f.sheaf("list").stdout, 30, "the job")
            watching = self.start("watch", 1, "-o", self.path("watched.exr"), *at)
            with sheaf.connect(f.address) as client:
                job = client.get_job(1)
            own = jobs.job_state(os.path.join(farm.programs(), "sheaf"), "jobs/1", f.address, False)
            seen, failures = threading.Event(), []
            python = threading.Thread(target=self.wait_in_python,
                                      args=(f.address, job, seen, failures))
            python.start()
            for process in (waiting, watching):  # The first message has come.
                self.assertIn("jobs/1: ", process.stderr.readline())
            self.assertTrue(seen.wait(30 * farm.PATIENCE))
            f.kill(f.coordinator)
            shutil.rmtree(f.path("state"))
            shutil.copytree(state, f.path("state"))
            f.start_coordinator()
            for process in (waiting, watching):
                _, text = process.communicate(timeout=60 * farm.PATIENCE)
                self.assertEqual(process.returncode, FAILED, text)
                self.assertIn("jobs/1: is another job now", text)
            python.join()
            self.assertIn("jobs/1: is another job now", str(failures[0]))
            self.assertIsInstance(failures[0], sheaf.NotFoundError)
            self.check_python(f.address, job)
            self.check_blender(f.address, own)
        self.assertEqual([name for name in os.listdir(self.folder) if name.endswith(".exr")],
                         ["other.exr"])

    def check_python(self, address, job):
        with sheaf.connect(address) as client:
            for call in (client.get_job, client.cancel, client.wait,
                         lambda j: client.download(j, self.path("download.exr"))):
                with self.assertRaisesRegex(sheaf.NotFoundError, "is another job now"):
                    call(job)
            self.assertEqual(client.get_job(1).state, sheaf.JobState.SUCCEEDED)

    def check_blender(self, address, own):
        program = os.path.join(farm.programs(), "sheaf")
        self.assertEqual(jobs.job_state(program, "jobs/1", address, False)["state"], "succeeded")
        with self.assertRaisesRegex(SheafError, "is another job now"):
            jobs.job_state(program, "jobs/1", address, False, own["create_time"])
        with self.assertRaisesRegex(SheafError, "is another job now"):
            jobs.download(program, "jobs/1", self.path("blender.exr"), address, False,
                          own["create_time"])
        with self.assertRaisesRegex(SheafError, "is another job now"):
            jobs.cancel(program, "jobs/1", address, False, own["create_time"])

    def test_the_jobs_to_wait_for_are_checked_first(self):
        with farm.Farm() as f:
            done = f.sheaf("submit", self.scene("a.pbrt", SCENE), "--after", 7, check=False)
            self.assertIn("--after 7: ", done.stderr)
            self.assertEqual(f.sheaf("list", "--json").stdout, "")

    def render(self, scene, *arguments):
        return subprocess.run(
            [os.path.join(farm.programs(), "sheaf"), "render", scene, "--samples", "2",
             "--keep-state", self.path("kept"), "-o", self.path("image.exr"),
             *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True, text=True,
            check=False, timeout=60 * farm.PATIENCE)

    def test_kept_work_goes_on_after_a_failure(self):
        """Regression: the failed job was found again and reported at once, forever."""
        scene = self.scene("large.pbrt", LARGE)
        done = self.render(scene, "--scene-memory-max", "16M")
        self.assertEqual(done.returncode, FAILED, done.stderr)
        self.assertIn("16 MiB", done.stderr)
        done = self.render(scene, "--scene-memory-max", "1G")
        self.assertEqual(done.returncode, OK, done.stderr)
        self.assertIn("is tried again", done.stderr)
        whole = self.path("whole.exr")
        farm.render(scene, whole, "--samples", 2)
        self.assertEqual(farm.image_digest(self.path("image.exr")), farm.image_digest(whole))

    def test_kept_work_begins_anew_after_a_cancellation(self):
        """Regression: a render whose job was cancelled on its page ended with code 5 forever."""
        scene = self.scene("long.pbrt", SCENE)
        process = self.start("render", scene, "--samples", ENDLESS, "--keep-state",
                             self.path("kept"), "-o", self.path("image.exr"), "--http",
                             "127.0.0.1:0")
        page = re.search(r"watch at (http://[^/\s]+)", process.stderr.readline())[1]

        def cancel():
            request = Request(f"{page}/api/v1/jobs/1:cancel", method="POST", data=b"",
                              headers={"X-Sheaf-Request": "1",
                                       "Content-Type": "application/json"})
            try:
                return urlopen(request, timeout=10 * farm.PATIENCE).status == 200
            except OSError:  # There is no job yet, or the render has ended before it answered.
                return process.poll() is not None

        farm.wait_until(cancel, 30, "the job")
        _, text = process.communicate(timeout=60 * farm.PATIENCE)
        self.assertEqual(process.returncode, CANCELLED, text)
        again = self.start("render", scene, "--samples", ENDLESS, "--time", "1s", "--keep-state",
                           self.path("kept"), "-o", self.path("image.exr"))
        _, text = again.communicate(timeout=60 * farm.PATIENCE)
        self.assertEqual(again.returncode, OK, text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
