#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Workers with caches of their own fetch a scene from each other, and one that lies about it costs
retries only: the image is right, and the coordinator sends the scene at most twice.

Usage: content_peers_test.py LYING_PEER
"""
import subprocess
import sys
import unittest

import farm
from content_scene import write_scene

LYING_PEER = sys.argv.pop(1) if len(sys.argv) > 1 else ""
WORKERS = 4
JOB = ("--samples", "1024", "--tile-size", "16", "--pass-samples", "64")
FILE_MIB = (12, 12, 3, 3, 2)
SECONDS_MAX = 60


def content(f, what, source):
    return f.metrics().get(f'sheaf_content_{what}_total{{source="{source}"}}', 0)


class ContentPeersTest(unittest.TestCase):
    def test_workers_fetch_from_each_other_and_never_believe_a_liar(self):
        with farm.Farm() as f:
            scene, digests = write_scene(f.folder, FILE_MIB)
            farm.render(scene, f.path("local.exr"), *JOB)
            job = f.sheaf("submit", scene, *JOB).stdout.strip()
            liar = subprocess.Popen([LYING_PEER, f.address, *digests], stdout=subprocess.PIPE)
            try:
                self.assertEqual(liar.stdout.readline(), b"reported\n")
                for number in range(WORKERS):
                    f.start_worker(cache=f"cache{number}")
                f.sheaf("watch", job, "-o", f.path("farm.exr"))
                farm.wait_until(lambda: self.all_loaded(f), SECONDS_MAX, "all loads reported")
            finally:
                liar.kill()
                liar.wait()
                liar.stdout.close()
            self.assertEqual(farm.image_digest(f.path("farm.exr")),
                             farm.image_digest(f.path("local.exr")))
            scene_bytes = sum(FILE_MIB) << 20
            metrics = f.metrics()
            sent = metrics["sheaf_content_sent_bytes_total"]
            self.assertLessEqual(sent, 2 * scene_bytes)
            self.assertGreaterEqual(sent, 0.9 * scene_bytes)
            self.assertGreaterEqual(content(f, "bytes", "peer") + sent,
                                    0.9 * WORKERS * scene_bytes)
            troubles = 'sheaf_content_peer_troubles_total{kind="wrong_bytes"}'
            self.assertGreaterEqual(metrics[troubles], 1)
            self.assertIn("a-liar sent wrong bytes", f.log("coordinator"))

    def all_loaded(self, f):
        blobs = sum(content(f, "blobs", source) for source in ("peer", "coordinator"))
        return blobs >= WORKERS * (len(FILE_MIB) + 2)  # The main file and the manifest too.


if __name__ == "__main__":
    unittest.main()
