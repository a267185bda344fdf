#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Every client delivers finished frames, however the other frames end.

One of twelve frames cannot be rendered and one is killed; the last three never end, until the job
is cancelled.
"""
import json
import os
import re
import subprocess
import sys
import threading
import unittest

import farm
from client_case import CANCELLED, FAILED, SCENE, ClientCase
from package_build import build_package

sys.dont_write_bytecode = True
sys.path.append(os.path.join(farm.ROOT, "blender"))
from sheaf_blender import jobs
from sheaf_blender.farm.program import SheafError

BAD, KILLED, ENDLESS = 3, 5, (10, 11, 12)
GOOD = sorted(set(range(1, 13)) - {BAD, KILLED, *ENDLESS})
MEMORY = ("--scene-memory-max", "16M")
# Beyond that memory.
TOO_LARGE = """Shape "loopsubdiv" "integer levels" 8 "integer indices" [0 1 2 0 2 3 0 3 1 1 3 2]
  "point3 P" [-1 -1 5  1 -1 5  0 1 5  0 0 6]
"""
SAMPLES = 'Sampler "independent" "integer pixelsamples" {}\n'


def setUpModule():
    global sheaf
    sys.path.insert(0, build_package())
    import sheaf


def names(folder):
    return sorted(os.listdir(folder))


def expected(ending=".exr"):
    return [f"f.{number:04d}{ending}" for number in GOOD]


class DeliveryTest(ClientCase):
    worker_arguments = MEMORY

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for _ in range(2):  # A frame fails when three workers lack the memory for its scene.
            cls.farm.start_worker(*MEMORY)

    def folder(self, name):
        path = self.farm.path(name)
        os.makedirs(path)
        return path

    def frames(self, count):
        """Scene files of that many frames; their pattern."""
        folder = self.folder(f"scenes {self.id()}")
        for number in range(1, count + 1):
            text = SCENE.replace("0.5 0.6 0.7", f"0.5 0.6 0.{number}")
            if number == BAD:
                text += TOO_LARGE
            endless = number == KILLED or number in ENDLESS
            with open(os.path.join(folder, f"f.{number:04d}.pbrt"), "w", encoding="utf-8") as file:
                file.write(SAMPLES.format(1 << 20 if endless else 2) + text)
        return os.path.join(folder, "f.####.pbrt")

    def start(self, *arguments):
        environment = dict(self.farm.environment, SHEAF_COORDINATOR=self.farm.address,
                           SHEAF_NO_QUOTE="1")
        process = subprocess.Popen(
            [os.path.join(farm.programs(), "sheaf"), *map(str, arguments)], env=environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        return process

    def test_render_writes_the_finished_frames(self):
        """Regression: an error in one frame threw away all the others."""
        out = self.folder("rendered")
        done = self.farm.sheaf("render", self.frames(4), "--frames", "1-4", *MEMORY, "-o",
                               os.path.join(out, "f.####.exr"), check=False)
        self.expect(done, FAILED)
        self.assertEqual(names(out), ["f.0001.exr", "f.0002.exr", "f.0004.exr"])
        self.assertIn("frame 3 of 4 has no image", done.stderr)
        self.assertIn("--frames 3", done.stderr)

    def test_each_client_has_each_finished_frame(self):
        """Regression: images came only after the last frame, and not at all where one failed."""
        pattern = self.frames(12)
        out = {name: self.folder(name) for name in ("waited", "watched", "python", "later",
                                                    "blender", "png")}
        waiting = self.start("submit", pattern, "--frames", "1-12", "--wait", "--title", "twelve",
                             "-o", os.path.join(out["waited"], "f.####.exr"))

        def find():
            jobs = map(json.loads, self.farm.sheaf("list", "--json").stdout.splitlines())
            return next((job["name"] for job in jobs if job["title"] == "twelve"), None)

        name = farm.wait_until(find, 30, "the job")
        watching = self.start("watch", name, "-o", os.path.join(out["watched"], "f.####.exr"),
                              "--png", os.path.join(out["png"], "f.####.png"))
        python = threading.Thread(target=self.wait_in_python, args=(name, out["python"]))
        python.start()
        self.farm.sheaf("kill", name, "--frame", KILLED)
        for folder in ("waited", "watched", "python"):  # While the job runs.
            farm.wait_until(lambda f=folder: names(out[f]) == expected(), 60, folder)
        self.assertEqual(self.state(name), "running")
        self.farm.sheaf("cancel", name)
        for process in (waiting, watching):
            _, text = process.communicate(timeout=30 * farm.PATIENCE)
            self.assertEqual(process.returncode, CANCELLED, text)
            self.assertIn("frames 3,5,10-12 of 12 have no image", text)
            self.assertIn("--frames 3,5,10-12", text)
        python.join()
        self.assertIsInstance(self.python_error, sheaf.JobCancelledError)
        self.assertIn("frames 3, 5, 10, 11, 12 of 12 have no image", str(self.python_error))
        self.assertEqual(names(out["png"]), expected(".png"))
        done = self.farm.sheaf("watch", name, "-o", os.path.join(out["later"], "f.####.exr"),
                               check=False)
        self.expect(done, CANCELLED)
        self.fetch_as_blender(name, out["blender"])
        digests = self.digests(name)
        for folder in ("waited", "watched", "python", "later", "blender"):
            self.assertEqual(names(out[folder]), expected(), folder)
            for number in GOOD:
                path = os.path.join(out[folder], f"f.{number:04d}.exr")
                self.assertEqual(farm.image_digest(path), digests[number], folder)

    def test_failed_job_goes_on_by_the_commands_that_are_named(self):
        out = os.path.join(self.folder("killed"), "f.####.exr")
        with farm.Farm() as own:  # Without a worker, until a frame is killed.
            waiting = self.start("submit", self.frames(2), "--frames", "1-2", "--wait", "-o", out,
                                 "--coordinator", own.address)
            name = farm.wait_until(lambda: own.sheaf("list", "--json").stdout, 30, "the job")
            name = json.loads(name)["name"]
            own.sheaf("kill", name, "--frame", 2)
            own.start_worker()
            _, text = waiting.communicate(timeout=60 * farm.PATIENCE)
            self.assertEqual(waiting.returncode, FAILED, text)
            self.assertEqual(names(os.path.dirname(out)), ["f.0001.exr"])
            self.assertIn("frame 2 of 2 has no image", text)
            own.sheaf(*re.search(rf"sheaf (retry {name}),", text)[1].split())
            fetch = re.search(rf"then sheaf (watch {name}) --coordinator {own.address} -o '(.*)'",
                              text)
            own.sheaf(*fetch[1].split(), "-o", fetch[2])
            self.assertEqual(names(os.path.dirname(out)), ["f.0001.exr", "f.0002.exr"])

    def test_an_image_that_cannot_be_written_keeps_none_back_in_python(self):
        folder = self.folder("not all")
        name = self.farm.sheaf("submit", self.frames(2), "--frames", "1-2").stdout.strip()
        os.makedirs(os.path.join(folder, "f.0001.exr"))
        with sheaf.connect(self.farm.address) as client:
            with self.assertRaisesRegex(sheaf.FileError, "f.0001.exr"):
                client.wait(name, images=os.path.join(folder, "f.####.exr"))
            with self.assertRaisesRegex(sheaf.InvalidRequestError, "####"):
                client.wait(name, images=os.path.join(folder, "one.exr"))
        self.assertEqual(names(folder), ["f.0001.exr", "f.0002.exr"])

    def state(self, name):
        return json.loads(self.farm.sheaf("show", name, "--json").stdout)["state"]

    def digests(self, name):
        shown = json.loads(self.farm.sheaf("show", name, "--json").stdout)
        return {frame["frame_number"]: frame["image_digest"] for frame in shown["frames"]}

    def wait_in_python(self, name, folder):
        with sheaf.connect(self.farm.address) as client:
            try:
                client.wait(name, images=os.path.join(folder, "f.####.exr"))
            except sheaf.SheafError as error:
                self.python_error = error

    def fetch_as_blender(self, name, folder):
        with self.assertRaisesRegex(SheafError, "frames 3,5,10-12 of 12 have no image"):
            jobs.download(os.path.join(farm.programs(), "sheaf"), name,
                          os.path.join(folder, "f.####.exr"), self.farm.address, False)


if __name__ == "__main__":
    unittest.main(verbosity=2)
