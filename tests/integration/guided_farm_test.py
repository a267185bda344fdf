#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A guided frame is one image: what its paths learn depends on the frame alone.

scenes/ajar.pbrt, small and guided, in one process, on 1 and 4 workers of which one is killed, and
by coordinators that are killed, gives one SHA-256; so do other tiles and passes, and a refinement.
A crop is that part of the whole. SHEAF_SEED repeats the moments of a run.
"""
import os
import re
import struct
import time
import unittest
import zlib

import farm
from one_image_case import OneImageCase

AJAR = os.path.join(farm.ROOT, "scenes", "ajar.pbrt")
WIDTH, HEIGHT = 48, 32
GUIDED = ("--techniques", "camera+guiding")
SMALL = ("--tile-size", 16, "--pass-samples", 4, "--lease-passes", 1)
SAMPLES = 20
JOB = ("--samples", SAMPLES, *GUIDED)
CROP = (11, 5, 30, 26)
KILLS = 2
TRAINING = 2  # TaskKind::kTraining.


def scene_text():
    """The scene with fewer pixels."""
    with open(AJAR, encoding="utf-8") as f:
        text = f.read()
    for name, size in (("xresolution", WIDTH), ("yresolution", HEIGHT)):
        text, count = re.subn(rf'"integer {name}" \d+', f'"integer {name}" {size}', text)
        assert count == 1, name
    return text


def png_rows(path):
    """The rows of a PNG of three bytes a pixel, as bytes. Source: ISO/IEC 15948."""
    data = farm.read_bytes(path)
    at, packed, width = 8, b"", 0
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        content = data[at + 8:at + 8 + length]
        at += length + 12
        if kind == b"IHDR":
            width, _, depth, color = struct.unpack(">IIBB", content[:10])
            assert (depth, color) == (8, 2), "not three bytes a pixel"
        elif kind == b"IDAT":
            packed += content
    raw, stride = zlib.decompress(packed), 3 * width + 1
    rows, above = [], bytes(stride - 1)
    for start in range(0, len(raw), stride):
        method, row = raw[start], bytearray(raw[start + 1:start + stride])
        for i, value in enumerate(row):
            a, b, c = (row[i - 3], above[i], above[i - 3]) if i >= 3 else (0, above[i], 0)
            near = min((a, b, c), key=lambda v, p=a + b - c: abs(p - v))
            row[i] = value + (0, a, b, (a + b) // 2, near)[method] & 0xff
        rows.append(bytes(row))
        above = row
    return rows


class GuidedFarmTest(OneImageCase):
    SCENE_NAME, SCENE_TEXT, JOB = "ajar.pbrt", scene_text(), JOB
    ASSETS = [os.path.join(farm.ROOT, "scenes", name) for name in ("showroom", "turntable")]

    def test_guiding_is_another_technique(self):
        self.assertNotEqual(self.rendered("camera", "--samples", SAMPLES), self.expected)

    def test_in_one_process(self):
        for arguments in (SMALL, ("--tile-size", 64, "--pass-samples", 64, "--threads", 1),
                          ("--generic",)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("p", *JOB, *arguments), self.expected)

    def test_crop_is_that_part_of_the_whole(self):
        crop = ("--crop", ",".join(map(str, CROP)))
        whole, cropped = (self.path(name, ".png") for name in ("whole", "crop"))
        farm.render(self.scene, whole, *JOB)
        farm.render(self.scene, cropped, *JOB, *crop)
        x0, y0, x1, y1 = CROP
        part = [row[3 * x0:3 * x1] for row in png_rows(whole)[y0:y1]]
        self.assertEqual(png_rows(cropped), part)
        self.assertGreater(len(set(part)), 1)
        with farm.Farm() as f:
            f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *crop, *SMALL).stdout.strip()
            self.assertEqual(self.finished(f, job), farm.image_digest(self.path("crop")))

    def test_one_worker_and_a_refinement(self):
        with farm.Farm() as f:
            f.start_worker()
            job = f.sheaf("submit", self.scene, "--samples", 8, *GUIDED, *SMALL).stdout.strip()
            self.assertNotEqual(self.finished(f, job), self.expected)
            before = f.acknowledged()
            f.sheaf("refine", job, "--samples", SAMPLES)
            self.assertEqual(self.finished(f, job), self.expected)
            self.assertLessEqual(before, f.acknowledged())
            trainings = 0
            for (*_, kind), samples in farm.samples_by_tile(f.acknowledged()).items():
                trainings += kind == TRAINING
                self.assertEqual(len(samples), 1 if kind == TRAINING else SAMPLES)
            self.assertEqual(trainings, 1)

    def test_four_workers_of_which_one_is_killed(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(4):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *SMALL).stdout.strip()
            farm.wait_until(f.acknowledged, 60, "the first result")
            f.kill(self.random.choice(f.workers))
            self.assertEqual(self.finished(f, job), self.expected)

    def test_split_paths(self):
        split = ("--samples", 8, "--techniques", "camera+guiding+splitting")
        expected = self.rendered("split", *split)
        self.assertNotEqual(self.rendered("unsplit", "--samples", 8, *GUIDED), expected)
        with farm.Farm() as f:
            for _ in range(4):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *split, *SMALL).stdout.strip()
            self.assertEqual(self.finished(f, job), expected)

    def test_killed_coordinators(self):
        with farm.Farm(["--lease-seconds", "2"]) as f:
            for _ in range(2):
                f.start_worker()
            job = f.sheaf("submit", self.scene, *JOB, *SMALL).stdout.strip()
            farm.wait_until(f.acknowledged, 60, "the first result")
            for _ in range(KILLS):
                f.kill(f.coordinator)
                before = f.acknowledged()
                f.start_coordinator()
                self.assertLessEqual(before, f.acknowledged(), "an acknowledged result is gone")
                time.sleep(self.random.uniform(0.1, 0.5))
            self.assertEqual(self.finished(f, job), self.expected)


if __name__ == "__main__":
    unittest.main(verbosity=2)
