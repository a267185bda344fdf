#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Quotes compared with actual costs, on a farm and on one machine.

Their accuracy over many scenes and targets is measured by tests/accuracy/quote_accuracy.py.
"""
import json
import os
import signal
import subprocess
import tempfile
import unittest

import farm

LARGE_ROOM = os.path.join(farm.ROOT, "scenes", "cornell-box.pbrt")
FOLDER = tempfile.TemporaryDirectory()
ROOM = os.path.join(FOLDER.name, "room.pbrt")
with open(LARGE_ROOM, encoding="utf-8") as room, open(ROOM, "w", encoding="utf-8") as smaller:
    # The short form has fewer pixels.
    smaller.write(room.read().replace('resolution" 400',
                                      f'resolution" {400 if farm.ALL_TESTS else 120}'))
TURNTABLE = os.path.join(farm.ROOT, "scenes", "turntable", "turntable.####.pbrt")
# An emitter of one pixel in front of a wall lit by a distant light.
LAMP_WIDTH_PX = 240
SMALL_LAMP = f"""
Film "rgb" "integer xresolution" {LAMP_WIDTH_PX} "integer yresolution" 180
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 45
WorldBegin
LightSource "distant" "rgb L" [0.6 0.6 0.6] "point3 from" [0 0 0] "point3 to" [0.2 0.1 1]
Shape "bilinearmesh" "point3 P" [-9 -9 5  9 -9 5  -9 9 5  9 9 5]
AttributeBegin
  Translate 0.43 0.31 4
  AreaLightSource "diffuse" "rgb L" [900 900 900]
  Shape "sphere" "float radius" 0.01
AttributeEnd
"""
# Tolerance for a single run, since the quoted band contains only 8 of 10 runs.
FACTOR_MAX = 2.5


def quote_rows(text):
    quote = json.loads(text)
    return quote, {row["target_error"]: row for row in quote["rows"]}


class QuoteHereTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.quote, cls.rows = quote_rows(farm.local("quote", ROOM, "--local", "--json"))

    def test_quote_is_cheap_and_reports_its_cost(self):
        cheapest = min(row["cpu_hours"]["value"] for row in self.rows.values())
        # The limit is 3 % of the samples; in so small an image the start and end of tiles count as
        # well.
        self.assertLess(self.quote["pilot_cpu_hours"], 0.06 * cheapest)
        self.assertGreater(self.quote["pilot_cpu_hours"], 0)

    def test_smaller_errors_cost_more_and_intervals_hold(self):
        targets = sorted((t for t in self.rows if t is not None), reverse=True)
        self.assertEqual(targets, [0.1, 0.05, 0.02, 0.01])
        for looser, tighter in zip(targets, targets[1:]):
            self.assertLessEqual(self.rows[looser]["cpu_hours"]["value"],
                                 self.rows[tighter]["cpu_hours"]["value"])
        for row in self.rows.values():
            self.assertTrue(row["reached"])
            for name in ("cpu_hours", "wall_seconds"):
                band = row[name]
                self.assertLess(band["low"], band["value"])
                self.assertLess(band["value"], band["high"])

    def test_measured_cost_is_near_the_quote(self):
        with tempfile.TemporaryDirectory() as folder:
            for target in (0.05, 0.02):
                out = farm.local("render", ROOM, "--target-error", target, "--json", "-o",
                            os.path.join(folder, "room.exr"))
                frame = json.loads(out.splitlines()[-1])["frames"][0]
                hours = frame["progress"]["cpu_duration_seconds"] / 3600
                ratio = hours / self.rows[target]["cpu_hours"]["value"]
                self.assertLess(ratio, FACTOR_MAX, target)
                self.assertGreater(ratio, 1 / FACTOR_MAX, target)

    def test_sample_count_has_a_row(self):
        _, rows = quote_rows(farm.local("quote", ROOM, "--local", "--json", "--samples", 64,
                                   "--targets", 0.5))
        row = rows[None]
        self.assertEqual(row["sample_count"], 64)
        with tempfile.TemporaryDirectory() as folder:
            out = farm.local("render", ROOM, "--samples", 64, "--json", "-o",
                        os.path.join(folder, "room.exr"))
            error = json.loads(out.splitlines()[-1])["frames"][0]["progress"]["relative_mse"]
            self.assertLess(error / row["relative_mse"]["value"], FACTOR_MAX)
            self.assertGreater(error / row["relative_mse"]["value"], 1 / FACTOR_MAX)


class QuotedTechniquesTest(unittest.TestCase):
    def test_light_passes_and_trainings_are_in_the_price(self):
        """The room at 240 x 240 pixels, with a target that takes several rounds."""
        with tempfile.TemporaryDirectory() as folder:
            scene = os.path.join(folder, "room.pbrt")
            with open(LARGE_ROOM, encoding="utf-8") as file:
                text = file.read().replace("resolution\" 400", "resolution\" 240")
            with open(scene, "w", encoding="utf-8") as file:
                file.write(text)
            for techniques in ("camera+light", "camera+light+guiding"):
                flags = (scene, "--techniques", techniques, "--json")
                quote, rows = quote_rows(farm.local("quote", *flags, "--local",
                                                    "--targets", "20%,0.025"))
                out = farm.local("render", *flags, "--target-error", 0.025, "-o",
                                 os.path.join(folder, "room.exr"))
                frame = json.loads(out.splitlines()[-1])["frames"][0]
                hours = frame["progress"]["cpu_duration_seconds"] / 3600
                ratio = hours / rows[0.025]["cpu_hours"]["value"]
                self.assertLess(ratio, FACTOR_MAX, techniques)
                self.assertGreater(ratio, 1 / FACTOR_MAX, techniques)
                training = quote["training_cpu_hours"]
                self.assertEqual(training > 0, "guiding" in techniques)
                self.assertLess(training, rows[0.04]["cpu_hours"]["value"])


class QuoteOnFarmTest(unittest.TestCase):
    def test_pilots_run_before_other_jobs_on_all_threads(self):
        with farm.Farm() as f:
            f.start_worker(threads=2)
            busy = f.sheaf("submit", ROOM, "--samples", 1 << 20).stdout.strip()
            quote, rows = quote_rows(f.sheaf("quote", ROOM, "--json").stdout)
            self.assertEqual(quote["thread_count"], 2)
            self.assertEqual(quote["jobs_before"], 1)
            # Both jobs get samples at the same rate until the smaller one is done; their pixels
            # cost the same.
            for row in rows.values():
                alone = 3600 * row["cpu_hours"]["value"] / 2
                self.assertGreater(row["wall_seconds"]["value"], 1.6 * alone)
                self.assertLess(row["wall_seconds"]["value"], 2.7 * alone)
            text = f.sheaf("quote", ROOM).stdout
            self.assertIn("2 threads, including the time of 1 other job", text)
            _, first = quote_rows(f.sheaf("quote", ROOM, "--json", "--priority", 1).stdout)
            for row in first.values():
                alone = 3600 * row["cpu_hours"]["value"] / 2
                self.assertLess(row["wall_seconds"]["value"], 1.2 * alone)
            job = json.loads(f.sheaf("show", busy, "--json").stdout)
            self.assertEqual(job["state"], "running")

    def test_one_pixel_emitter_has_a_zoomed_pilot(self):
        with farm.Farm() as f, tempfile.TemporaryDirectory() as folder:
            f.start_worker()
            scene = os.path.join(folder, "lamp.pbrt")
            with open(scene, "w", encoding="utf-8") as file:
                file.write(SMALL_LAMP)
            f.sheaf("quote", scene)
            frames = [frame for line in f.sheaf("list", "--all", "--json").stdout.splitlines()
                      for name in [json.loads(line)["name"]]
                      for frame in json.loads(f.sheaf("show", name, "--json").stdout)["frames"]]
            zoomed_pilots = [frame for frame in frames if frame["width_px"] == 4 * LAMP_WIDTH_PX]
            self.assertEqual(len(zoomed_pilots), 1, frames)
            window = zoomed_pilots[0]["window"]
            # The emitter is 0.43 to the right and 0.31 up at a distance of 4: .1075 and .0775 times
            # 90 / tan(22.5 degrees) pixels from the center.
            for key, emitter_px in (("x", 120 + 23.4), ("y", 90 - 16.8)):
                self.assertLess(window[f"{key}0_px"] / 4, emitter_px - 1)
                self.assertGreater(window[f"{key}1_px"] / 4, emitter_px + 1)
                self.assertLess(window[f"{key}1_px"] - window[f"{key}0_px"], 4 * 6)

    def test_interrupted_quote_leaves_no_pilot(self):
        with farm.Farm() as f:  # Without workers the pilot waits forever.
            def states():
                lines = f.sheaf("list", "--all", "--json").stdout.splitlines()
                return [json.loads(line)["state"] for line in lines]

            for sent in (signal.SIGINT, signal.SIGTERM):
                count = len(states())
                quote = subprocess.Popen([os.path.join(farm.programs(), "sheaf"), "quote", ROOM],
                                         env=dict(os.environ, SHEAF_COORDINATOR=f.address),
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                try:
                    farm.wait_until(lambda: len(states()) > count, 30, "a pilot")
                    quote.send_signal(sent)
                    self.assertEqual(quote.wait(30 * farm.PATIENCE), 130)
                finally:
                    quote.kill()
                    quote.wait()
                self.assertEqual(set(states()), {"cancelled"})

    def test_killed_quote_leaves_no_pilot_and_reports_what_it_waits_for(self):
        with farm.Farm() as f, tempfile.TemporaryFile("w+") as said:
            quote = subprocess.Popen([os.path.join(farm.programs(), "sheaf"), "quote", ROOM],
                                     env=dict(os.environ, SHEAF_COORDINATOR=f.address),
                                     stdout=subprocess.DEVNULL, stderr=said)
            def text():
                said.seek(0)
                return said.read()

            def pilots():
                lines = f.sheaf("list", "--all", "--json").stdout.splitlines()
                return [(job["name"], job["state"]) for job in map(json.loads, lines)]

            try:
                farm.wait_until(lambda: "waiting: no worker is connected" in text(), 30, "words")
            finally:
                quote.kill()
                quote.wait()
            self.assertEqual(pilots(), [("jobs/1000000001", "queued")])
            farm.wait_until(lambda: pilots() == [("jobs/1000000001", "cancelled")], 60, "the end")

    def test_pilots_are_not_listed(self):
        with farm.Farm() as f:
            f.start_worker()
            f.sheaf("quote", ROOM)
            self.assertEqual(f.sheaf("list", "--json").stdout, "")
            self.assertEqual(f.sheaf("submit", ROOM, "--samples", 1).stdout.strip(), "jobs/1")
            names = [json.loads(line)["name"]
                     for line in f.sheaf("list", "--all", "--json").stdout.splitlines()]
            self.assertEqual(names[0], "jobs/1", "the newest first")
            self.assertIn("jobs/1000000001", names)
            self.assertIn("quote of", f.sheaf("list", "--all").stdout)
            self.assertGreater(f.metrics()["sheaf_frames_delivered_total"], 0)

    def test_ranges_are_quoted_from_sampled_frames(self):
        with farm.Farm() as f:
            f.start_worker()
            quote, rows = quote_rows(f.sheaf("quote", TURNTABLE, "--frames", "1-9", "--crop",
                                             "100,60,164,124", "--json").stdout)
            one, of_one = quote_rows(f.sheaf("quote", TURNTABLE, "--frames", "5", "--crop",
                                             "100,60,164,124", "--json").stdout)
            self.assertEqual((quote["frame_count"], quote["pilot_frame_count"]), (9, 3))
            self.assertEqual((one["frame_count"], one["pilot_frame_count"]), (1, 1))
            ratio = rows[0.1]["cpu_hours"]["value"] / of_one[0.1]["cpu_hours"]["value"]
            self.assertGreater(ratio, 9 / FACTOR_MAX)
            self.assertLess(ratio, 9 * FACTOR_MAX)

    def test_submit_reports_the_quote_by_default(self):
        with farm.Farm() as f:
            nobody = f.sheaf("submit", ROOM, "--samples", 1, quote=True)
            self.assertIn("no quote: no worker is connected", nobody.stderr)
            self.assertEqual(nobody.stdout.strip(), "jobs/1")
            f.start_worker()
            farm.wait_until(lambda: f.sheaf("workers").stdout.count("\n") > 1, 30, "a worker")
            quoted = f.sheaf("submit", ROOM, "--target-error", 0.05, quote=True)
            self.assertRegex(quoted.stderr, r" to .* \(relMSE 0\.05\)")
            self.assertNotIn("(relMSE 0.1)", quoted.stderr)
            silent = f.sheaf("submit", ROOM, "--target-error", 0.05, "--no-quote", quote=True)
            self.assertNotIn("pilot", silent.stderr)


if __name__ == "__main__":
    unittest.main()
