#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Frames that continue from delivered images: the result equals that of a single run except for
rounding, also with another coordinator, after a stop at a target error, and with a killed
coordinator. Mismatched images are refused with a reason.
"""
import json
import os
import subprocess
import tempfile
import time
import unittest

import farm

SCENE = os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
OTHER = os.path.join(farm.ROOT, "scenes", "cornell-box.pbrt")
WINDOW = ("--crop", "270,150,334,198", "--tile-size", "16")


def render(path, *arguments, scene=SCENE):
    done = farm.render(scene, path, *WINDOW, *arguments, "--json")
    return json.loads(done.stdout.splitlines()[-1])["frames"][0]


class ResumeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        render(cls.path("first.exr"), "--samples", 64)
        cls.whole = render(cls.path("whole.exr"), "--samples", 256)

    @classmethod
    def path(cls, name):
        return os.path.join(cls.folder.name, name)

    def expect_as(self, whole, path):
        difference = json.loads(farm.compare(whole, path))
        self.assertLess(difference["relative_mse"], 1e-11)
        self.assertLess(difference["flip"], 1e-3)

    def test_resuming_matches_one_run(self):
        frame = render(self.path("more.exr"), "--samples", 256, "--resume-from",
                       self.path("first.exr"))
        self.expect_as(self.path("whole.exr"), self.path("more.exr"))
        self.assertAlmostEqual(
            frame["progress"]["relative_mse"] / self.whole["progress"]["relative_mse"], 1,
            delta=0.15)
        self.assertAlmostEqual(frame["flip"] / self.whole["flip"], 1, delta=0.1)
        # Only missing samples were rendered.
        self.assertLess(frame["progress"]["ray_count"],
                        0.8 * self.whole["progress"]["ray_count"])

    def test_after_a_stop_at_an_error_and_to_another(self):
        stopped = render(self.path("stopped.exr"), "--target-error", 0.02)
        frame = render(self.path("on.exr"), "--target-error", 0.01, "--resume-from",
                       self.path("stopped.exr"))
        self.assertEqual(frame["stop_reason"], "target-error")
        self.assertEqual(frame["rounds"][0]["sample_count"],
                         stopped["progress"]["sample_count_done"])
        self.assertLessEqual(frame["rounds"][-1]["relative_mse_upper"], 0.01)

    def test_file_reports_the_error_if_known(self):
        def curve(path):
            return json.loads(farm.local("show", path, "--json"))["metadata"].get("errorCurve")

        [samples, error, upper] = map(float, curve(self.path("whole.exr")).split())
        self.assertEqual(samples, 256)
        self.assertAlmostEqual(error / self.whole["progress"]["relative_mse"], 1, delta=0.01)
        self.assertGreater(upper, error)
        render(self.path("single.exr"), "--samples", 1)
        self.assertIsNone(curve(self.path("single.exr")), "one sample tells no error")

    def test_cost_counts_missing_samples(self):
        """Compares the quote with one run; its band contains only 8 of 10 runs."""
        def quote(*arguments):
            return json.loads(farm.local("quote", SCENE, *WINDOW, "--local", "--json", *arguments))

        stopped = render(self.path("stopped.exr"), "--target-error", 0.02)
        asked = ("--targets", "0.02,0.004", "--resume-from", self.path("stopped.exr"))
        there = quote(*asked)
        met, missing = there["rows"][:2]
        self.assertEqual(met["cpu_hours"]["value"], 0)
        self.assertAlmostEqual(there["start"]["relative_mse"] /
                               stopped["rounds"][-1]["relative_mse"], 1, delta=0.1)
        self.assertIsNone(quote("--targets", 0.02)["start"])
        on = render(self.path("priced.exr"), "--target-error", 0.004, "--resume-from",
                    self.path("stopped.exr"))
        hours = on["progress"]["cpu_duration_seconds"] / 3600
        self.assertLess(max(hours / missing["cpu_hours"]["value"],
                            missing["cpu_hours"]["value"] / hours), 2.5)

    def test_submission_reports_its_cost(self):
        with farm.Farm() as f:
            f.start_worker()
            farm.wait_until(lambda: f.sheaf("workers").stdout.count("\n") > 1, 30, "a worker")
            done = f.sheaf("submit", SCENE, *WINDOW, "--samples", 256, "--resume-from",
                           self.path("first.exr"), quote=True)
            self.assertIn("additional CPU time", done.stderr)
            self.assertIn("64.0 samples exist already", done.stderr)
            job = json.loads(f.sheaf("show", done.stdout.strip(), "--json").stdout)
            self.assertRegex(job["frames"][0]["resumed_image"], "^[0-9a-f]{64}$")

    def test_killed_second_coordinator(self):
        with farm.Farm() as f:
            f.start_worker()
            job = json.loads(f.sheaf("submit", SCENE, *WINDOW, "--samples", 256, "--resume-from",
                                     self.path("first.exr"), "--pass-samples", 4, "--json"
                                     ).stdout.splitlines()[-1])["name"]
            time.sleep(0.5)
            f.kill(f.coordinator)
            f.start_coordinator()
            f.sheaf("watch", job, "-o", f.path("more.exr"))
            self.expect_as(self.path("whole.exr"), f.path("more.exr"))

    def test_filters_with_negative_parts_are_refused(self):
        scene = self.path("mitchell.pbrt")
        with open(scene, "w", encoding="utf-8") as f:
            f.write('Film "rgb" "integer xresolution" 16 "integer yresolution" 16\n'
                    'PixelFilter "mitchell"\nCamera "perspective"\nWorldBegin\n'
                    'LightSource "infinite"\nTranslate 0 0 3\nShape "sphere"\n')
        farm.render(scene, self.path("mitchell.exr"), "--samples", 16)
        done = subprocess.run(
            [os.path.join(farm.programs(), "sheaf"), "render", scene, "--samples", "32", "-o",
             self.path("never.exr"), "--resume-from", self.path("mitchell.exr")],
            capture_output=True, text=True, timeout=60 * farm.PATIENCE)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("its filter is negative in places", done.stderr)

    def test_mismatches_are_refused(self):
        def refused(*arguments, scene=SCENE):
            done = subprocess.run(
                [os.path.join(farm.programs(), "sheaf"), "render", scene, "-o",
                 self.path("never.exr"), "--resume-from", self.path("first.exr"),
                 *map(str, arguments)], capture_output=True, text=True,
                timeout=60 * farm.PATIENCE)
            self.assertNotEqual(done.returncode, 0)
            self.assertFalse(os.path.exists(self.path("never.exr")))
            return done.stderr

        self.assertIn("--samples", refused(*WINDOW, "--samples", 32))
        self.assertIn("another seed", refused(*WINDOW, "--samples", 128, "--seed", 4))
        self.assertIn("another crop", refused("--samples", 128))
        self.assertIn("cryptomattes cannot",
                      refused(*WINDOW, "--samples", 128, "--cryptomatte", "object"))
        self.assertIn("from the image", refused("--samples", 128, scene=OTHER))
        done = subprocess.run(
            [os.path.join(farm.programs(), "sheaf"), "quote", OTHER, "--local", "--resume-from",
             self.path("first.exr")], capture_output=True, text=True,
            timeout=60 * farm.PATIENCE)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("cannot continue from " + self.path("first.exr"), done.stderr)


if __name__ == "__main__":
    unittest.main()
