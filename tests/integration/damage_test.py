#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Files altered on disk under a running farm: the image stays the same, and the damage is reported.

One byte of a texture is changed in a worker's cache and in the coordinator's store, and one byte of
a delivered EXR; each file keeps its size.
"""
import json
import os
import tempfile
import unittest

import farm
from damaged_files import alter, blob_path, write_scene

JOB = ("--tile-size", "32", "--pass-samples", "16", "--lease-passes", "1")


class DamageTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.scene, self.texture = write_scene(folder.name)
        expected = os.path.join(folder.name, "expected.exr")
        farm.render(self.scene, expected, *JOB, "--samples", 64)
        self.expected = farm.image_digest(expected)

    def submit(self, f, samples=64):
        done = f.sheaf("submit", self.scene, *JOB, "--json", "--samples", samples)
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def image(self, f, job):
        """Follows the job, saves its image and returns the digest."""
        output = f.path("out.exr")

        def saved():
            return f.sheaf("watch", job, "-o", output, check=False).returncode == 0
        farm.wait_until(saved, 60, f"the image of {job}")
        return farm.image_digest(output)

    def failures(self, f, job):
        from urllib.request import urlopen
        url = f"http://{f.http}/api/v1/{job}/failures"
        return json.loads(urlopen(url, timeout=10 * farm.PATIENCE).read())

    def test_texture_altered_in_the_cache_of_a_running_worker(self):
        with farm.Farm() as f:
            f.start_worker()
            job = self.submit(f)
            self.assertEqual(self.image(f, job), self.expected)
            # The scene is compiled in the worker, and tiles of its texture are in memory.
            alter(blob_path(f.path("cache", "blobs"), os.path.getsize(self.texture)), whole=True)
            again = self.submit(f)
            self.assertEqual(self.image(f, again), self.expected)
            self.assertIn("wood.png", json.dumps(self.failures(f, again)))
            self.assertTrue(os.listdir(f.path("cache", "blobs", "damaged")))

    def test_texture_altered_during_rendering(self):
        with farm.Farm() as f:
            f.start_worker()
            job = self.submit(f, samples=4096)
            farm.wait_until(lambda: f.metrics()["sheaf_results_accepted_total"] > 20, 60, "parts")
            alter(blob_path(f.path("cache", "blobs"), os.path.getsize(self.texture)), whole=True)
            expected = f.path("expected.exr")
            farm.render(self.scene, expected, *JOB, "--samples", 4096)
            self.assertEqual(self.image(f, job), farm.image_digest(expected))
            self.assertIn("wood.png", json.dumps(self.failures(f, job)))

    def test_blob_altered_in_the_coordinator_store(self):
        with farm.Farm() as f:
            job = self.submit(f)
            alter(blob_path(f.path("state", "content"), os.path.getsize(self.texture)))
            f.start_worker()

            def waiting_reason():
                listed = json.loads(f.sheaf("list", "--json").stdout.splitlines()[0])
                return listed.get("waiting_reason", "")
            # The job waits until the worker starts.
            farm.wait_until(lambda: "wood.png" in waiting_reason(), 30, "what the job waits for")
            self.assertIn("submit the scene again", waiting_reason())
            again = self.submit(f)
            for name in (job, again):
                self.assertEqual(self.image(f, name), self.expected)

    def test_manifest_altered_in_the_coordinator_store(self):
        with farm.Farm() as f:
            job = self.submit(f)
            sizes = {os.path.getsize(self.scene), os.path.getsize(self.texture)}
            folder = f.path("state", "content")
            manifest = [os.path.join(d, n) for d, _, names in os.walk(folder) for n in names
                        if len(n) == 64 and os.path.getsize(os.path.join(d, n)) not in sizes]
            self.assertEqual(len(manifest), 1)
            alter(manifest[0])
            again = self.submit(f)  # The client must send it again.
            f.start_worker()
            for name in (job, again):
                self.assertEqual(self.image(f, name), self.expected)

    def test_delivered_image_altered_or_removed(self):
        with farm.Farm() as f:
            f.start_worker()
            job = self.submit(f)
            self.assertEqual(self.image(f, job), self.expected)
            delivered = [os.path.join(d, n) for d, _, names in os.walk(f.path("state", "outputs"))
                         for n in names if n.endswith(".exr") and "thumbnail" not in n]
            self.assertEqual(len(delivered), 1)
            whole = farm.read_bytes(delivered[0])
            for spoil in (alter, os.remove):
                spoil(delivered[0])
                said = f.sheaf("watch", job, "-o", f.path("spoilt.exr"), check=False)
                self.assertNotEqual(said.returncode, 0)
                self.assertIn("being recreated", said.stderr)
                self.assertEqual(self.image(f, job), self.expected)
                self.assertEqual(farm.read_bytes(delivered[0]), whole, "to the bit")
            self.assertEqual(f.metrics()["sheaf_images_damaged_total"], 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
