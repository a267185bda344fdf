#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A coordinator keeps its disk within a limit while jobs come whose parts exceed it many times
over; a kill interrupts removals; and kept files that are damaged on disk are made again.
"""
import contextlib
import json
import os
import sqlite3
import tempfile
import time
import unittest

import client_case
import farm
from damaged_files import alter, blob_path

JOB = ("--tile-size", "16", "--pass-samples", "16")
JOBS = 8
# So many pixels that a job's parts are larger than the database with its log.
SCENE = client_case.SCENE.replace('"integer xresolution" 48 "integer yresolution" 32',
                                  '"integer xresolution" 144 "integer yresolution" 96')
DATABASE_BYTES_MAX = 6 << 20


def bytes_below(folder):
    size = 0
    for directory, _, names in os.walk(folder):
        for name in names:
            with contextlib.suppress(FileNotFoundError):
                size += os.path.getsize(os.path.join(directory, name))
    return size


class RetentionTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.scene = os.path.join(folder.name, "scene.pbrt")
        with open(self.scene, "w", encoding="utf-8") as file:
            file.write(SCENE)
        self.images = {}
        for samples in (32, 64):
            self.images[samples] = os.path.join(folder.name, f"{samples}.exr")
            farm.render(self.scene, self.images[samples], *JOB, "--samples", samples)
        self.expected = farm.image_digest(self.images[32])

    def restart(self, f, *arguments):
        if f.coordinator.poll() is None:
            f.kill(f.coordinator)
        f.coordinator_arguments = list(arguments)
        f.start_coordinator()

    def finished_job(self, f):
        done = f.sheaf("submit", self.scene, *JOB, "--samples", 32, "--show", "film", "--wait",
                       "-o", f.path("out.exr"), "--json")
        self.assertEqual(farm.image_digest(f.path("out.exr")), self.expected)
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def show(self, f, job):
        return json.loads(f.sheaf("show", job, "--json").stdout)

    def jobs_with_rows(self, f):
        """The names of the jobs that have rows of parts."""
        path = f.path("state", "farm.db")
        with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as db:
            return {f"jobs/{id}" for id, in db.execute("SELECT DISTINCT job_id FROM parts")}

    def folders_with_parts(self, f):
        return {f"jobs/{name}" for name in os.listdir(f.path("state", "parts"))}

    def alter_first(self, f, folder):
        """Changes a byte of the first job's first image or part."""
        files = [os.path.join(d, n) for d, _, names in os.walk(f.path("state", folder, "1"))
                 for n in names if "thumbnail" not in n]
        alter(sorted(files)[0])

    def metric(self, f, name, kind):
        return f.metrics().get(f'sheaf_{name}{{kind="{kind}"}}', 0)

    def test_disk_stays_within_its_limit(self):
        # Only what is kept counts here.
        with farm.Farm(["--disk-reserve", "0"]) as f:
            f.start_worker()
            pinned = self.finished_job(f)
            f.sheaf("pin", pinned)
            f.sheaf("usage")  # Writes what was uploaded, which a kill may lose for some seconds.
            parts = bytes_below(f.path("state", "parts"))
            jobs = []
            limit = self.limit_for(f, parts)
            self.restart(f, "--disk-limit", str(limit), "--disk-reserve", "0")
            highest = 0
            for _ in range(JOBS):
                jobs.append(self.finished_job(f))
                highest = max(highest, bytes_below(f.path("state")))
                farm.wait_until(lambda: bytes_below(f.path("state")) <= limit, 20, "room")
            self.assertGreater(JOBS * parts, limit, "all parts would not fit")
            # A look each second: what a job writes meanwhile comes on top.
            self.assertLess(highest, limit + 2 * parts)
            kept = self.jobs_with_rows(f)
            self.assertIn(pinned, kept)
            removed = [job for job in jobs if self.show(f, job)["parts_removed_time"]]
            self.assertGreaterEqual(len(removed), JOBS // 2)
            self.assertEqual(removed, jobs[:len(removed)], "the oldest go first")
            self.assertIsNone(self.show(f, pinned)["parts_removed_time"])
            self.assertIn("parts removed on", f.sheaf("show", removed[0]).stdout)
            self.check_images(f, [pinned, *jobs])
            self.refine(f, removed[0])
            self.remove_jobs(f, pinned, jobs)

    def limit_for(self, f, parts):
        """Above what stays by two and a half jobs' parts: the pinned one's and others'."""
        state = bytes_below(f.path("state"))
        images = bytes_below(f.path("state", "outputs"))
        return state + JOBS * images + DATABASE_BYTES_MAX + parts + parts // 2

    def check_images(self, f, jobs):
        for job in jobs:
            f.sheaf("watch", job, "-o", f.path("again.exr"))
            self.assertEqual(farm.image_digest(f.path("again.exr")), self.expected, job)

    def refine(self, f, job):
        """A job without parts continues from its image."""
        f.sheaf("refine", job, "--samples", 64, "--wait", "-o", f.path("refined.exr"))
        difference = json.loads(farm.compare(self.images[64], f.path("refined.exr")))
        self.assertLess(difference["relative_mse"], 1e-11)
        shown = self.show(f, job)
        self.assertRegex(shown["frames"][0]["resumed_image"], "^[0-9a-f]{64}$")
        self.assertIsNone(shown["parts_removed_time"])

    def remove_jobs(self, f, pinned, jobs):
        """Far too little room: all goes but the pinned job; a dry run says so first."""
        self.restart(f)
        self.assertEqual(json.loads(f.sheaf("gc", "--dry-run", "--json").stdout)["removals"], [])
        self.restart(f, "--disk-limit", "1000", "--user-bytes-max", "2000")

        def left():
            lines = f.sheaf("list", "--json").stdout.splitlines()
            return [json.loads(line)["name"] for line in lines]
        farm.wait_until(lambda: left() == [pinned], 20, "all other jobs removed")
        self.assertEqual(os.listdir(f.path("state", "outputs")), [pinned.split("/")[1]])
        self.assertEqual(self.folders_with_parts(f), {pinned})
        self.check_usage(f, [pinned, *jobs])
        number = int(jobs[-1].split("/")[1])
        self.restart(f)
        self.assertEqual(self.finished_job(f), f"jobs/{number + 1}")
        self.check_images(f, [pinned])

    def check_usage(self, f, jobs):
        """Accounts outlive jobs; what the user still keeps is beyond the limit."""
        usage = json.loads(f.sheaf("usage", "--by", "job", "--json").stdout)
        rows = {row["job"]: row for row in usage["usage"]}
        self.assertEqual(set(jobs) - set(rows), set())
        for job in jobs:
            self.assertEqual(rows[job]["show"], "film")
            self.assertGreaterEqual(rows[job]["sample_count"], 32 * 144 * 96)
            self.assertGreater(rows[job]["cpu_seconds"], 0)
            self.assertGreater(rows[job]["image_bytes"], 0)
        self.assertGreater(rows["uploads"]["upload_bytes"], 0)
        csv = f.sheaf("usage", "--csv").stdout.splitlines()
        self.assertEqual(len(csv), 2, csv)
        self.assertIn("of 2.0 KiB: ", f.sheaf("usage").stdout)
        [stored] = usage["stored"]
        self.assertEqual((stored["user"], stored["bytes_max"]), ("local", 2000))
        self.assertGreater(stored["part_bytes"], 2000, "the pinned job's")
        refused = f.sheaf("submit", self.scene, *JOB, "--samples", 33, "--no-quote", check=False)
        self.assertNotEqual(refused.returncode, 0)
        for words in ("of parts", "sheaf unpin", "--user-bytes-max"):
            self.assertIn(words, refused.stderr)

    def test_kill_during_removal(self):
        with farm.Farm() as f:
            f.start_worker()
            jobs = [self.finished_job(f) for _ in range(4)]
            for _ in range(3):
                self.restart(f, "--keep-parts", "0s")
                before = self.folders_with_parts(f)
                end = time.monotonic() + 3
                while self.folders_with_parts(f) == before and time.monotonic() < end:
                    time.sleep(0.001)
                f.kill(f.coordinator)
            self.restart(f)
            # Jobs with rows have files, and others have none.
            self.assertEqual(self.folders_with_parts(f), self.jobs_with_rows(f))
            self.check_images(f, jobs)

    def test_scrubbing_finds_and_repairs_damage(self):
        with farm.Farm() as f:
            f.start_worker()
            job = self.finished_job(f)
            f.kill(f.coordinator)
            self.alter_first(f, "outputs")
            self.alter_first(f, "parts")
            alter(blob_path(f.path("state", "content"), os.path.getsize(self.scene)))
            self.restart(f, "--scrub-rate", "100M")
            for kind in ("blob", "part"):
                farm.wait_until(lambda kind=kind: self.metric(f, "scrub_damaged_total", kind) == 1,
                                20, f"a damaged {kind} found")
            self.finished_job(f)  # Brings the scene again.
            for kind in ("blob", "part"):
                farm.wait_until(lambda kind=kind: self.metric(f, "scrub_repaired_total", kind) == 1,
                                20, f"the {kind} repaired")
            self.check_images(f, [job])
            # The image, now that its frame is whole.
            f.kill(f.coordinator)
            self.alter_first(f, "outputs")
            f.start_coordinator()
            farm.wait_until(lambda: self.metric(f, "scrub_repaired_total", "image") == 1, 20,
                            "the image repaired")
            self.assertEqual(self.metric(f, "scrub_damaged_total", "image"), 1)
            self.check_images(f, [job])
            self.assertGreater(f.metrics()["sheaf_scrub_last_pass_seconds"], 0)


if __name__ == "__main__":
    unittest.main()
