#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""sheaf plan --timings and --memory: they measure what a render does, and add up to what the system
says of the process.
"""
import json
import os
import subprocess
import tempfile
import unittest

import farm

SCENES = os.path.join(farm.ROOT, "scenes")
SMALL = ("--size", "64x64")
# The rest of the account, as a part of the memory that the process has.
OTHER_MAX = 0.1
# The part of the process' CPU time in no phase: gRPC's and the farm's threads, above all.
OTHER_CPU_MAX = 0.35
# The most memory that plan says may differ from that of a render by this part.
PEAK_OFF_MAX = 0.1
# Kinds that only some scenes have.
RARE = {"textures", "environment maps", "volumes", "volume pages", "guiding"}


class ProfileTest(unittest.TestCase):
    def plan(self, scene, *flags):
        return json.loads(farm.local("plan", os.path.join(SCENES, scene), "--json", *flags))

    def test_phases_add_up_to_the_process(self):
        times = self.plan("cornell-box.pbrt", "--timings")["timings"]
        phases = {phase["name"]: phase for phase in times["phases"]}
        for name in ("program", "read", "digests", "check", "farm", "store", "fetch", "geometry",
                     "lights", "ray tracer", "samples", "results", "delivery"):
            self.assertIn(name, phases)
        self.assertFalse({"media", "training", "techniques"} & set(phases), phases)
        self.assertEqual(phases["read"]["count"], 1, "a scene is read once")
        self.assertEqual(phases["ray tracer"]["count"], 1)
        cpu = sum(phase["cpu_seconds"] for phase in phases.values())
        self.assertAlmostEqual(cpu + times["other_cpu_seconds"], times["cpu_seconds"], places=6)
        self.assertLess(times["other_cpu_seconds"], OTHER_CPU_MAX * times["cpu_seconds"], times)
        wall = sum(phase["wall_seconds"] for phase in phases.values())
        self.assertAlmostEqual(wall + times["other_wall_seconds"] - times["overlap_wall_seconds"],
                               times["wall_seconds"], places=6)
        self.assertGreater(times["first_sample_wall_seconds"], phases["program"]["wall_seconds"])
        self.assertLess(times["first_sample_wall_seconds"], times["wall_seconds"])

    def test_a_size_of_the_user_has_the_scene_read_again(self):
        times = self.plan("cornell-box.pbrt", "--timings", *SMALL)["timings"]
        self.assertEqual([p["count"] for p in times["phases"] if p["name"] == "read"], [2])

    def test_memory_adds_up_to_what_the_system_says(self):
        for scene, rare in (("cornell-box.pbrt", set()), ("cloud.pbrt", {"volumes"}),
                            ("showroom.pbrt", {"environment maps", "textures"})):
            with self.subTest(scene):
                account = self.plan(scene, "--memory", *SMALL)["memory_account"]
                kinds = {kind["name"]: kind["bytes"] for kind in account["kinds"]}
                self.assertTrue(all(kinds.values()), kinds)
                self.assertEqual(RARE & set(kinds), rare)
                self.assertEqual(sum(kinds.values()) + account["other_bytes"],
                                 account["resident_bytes"])
                self.assertLess(abs(account["other_bytes"]),
                                OTHER_MAX * account["resident_bytes"], account)

    def test_memory_is_the_most_that_a_render_takes(self):
        # A light pass takes as much as the frame, and holds the most before its task ends.
        flags = (os.path.join(SCENES, "shop-window.pbrt"), "--size", "600x450", "--techniques",
                 "camera+light+merging")
        account = self.plan(*flags, "--memory")["memory_account"]
        self.assertIn("light passes", {kind["name"] for kind in account["kinds"]})
        with tempfile.TemporaryDirectory() as folder:
            out = os.path.join(folder, "image.exr")
            program = os.path.join(farm.programs(), "sheaf")
            render = subprocess.Popen([program, "render", *flags, "--samples", "1", "-o", out],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            _, status, usage = os.wait4(render.pid, 0)
            render.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(render.returncode, 0)
        most_bytes = usage.ru_maxrss * 1024
        self.assertLess(abs(account["resident_bytes"] - most_bytes), PEAK_OFF_MAX * most_bytes,
                        account)

    def test_text_has_both_tables(self):
        said = farm.local("plan", os.path.join(SCENES, "cornell-box.pbrt"), "--timings",
                          "--memory", *SMALL)
        self.assertRegex(said, r"(?m)^  process +\d+\.\d{3} +\d+\.\d{3}$")
        self.assertRegex(said, r"(?m)^first sample after \d+\.\d{3} s, \d+\.\d{3} CPU s$")
        self.assertRegex(said, r"(?m)^  ray tracer +\d+\.\d\d MiB$")
        self.assertRegex(said, r"(?m)^  resident +\d+\.\d\d MiB$")


if __name__ == "__main__":
    unittest.main(verbosity=2)
