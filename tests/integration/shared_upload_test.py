#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Two clients that upload one scene at the same time: both jobs run, one copy is stored, and
neither waits for a client that is gone.

One client's link stands still for a while, so that the other finds it in the middle of the file.
"""
import os
import re
import subprocess
import unittest

import content_scene
import farm
from slow_link import SlowLink

LINK_BYTES_PER_SECOND = 1 << 20
# By chunks, and in one piece.
SIZES_MIB = (6, 3)


class SharedUploadTest(unittest.TestCase):
    def setUp(self):
        self.farm = farm.Farm()
        self.farm.__enter__()
        self.addCleanup(self.farm.__exit__)
        self.farm.start_worker()
        self.link = SlowLink(self.farm.address, 0, bytes_per_second=LINK_BYTES_PER_SECOND)
        self.link.__enter__()
        self.addCleanup(self.link.__exit__)

    def start(self, scene, address, name):
        process = subprocess.Popen(
            [os.path.join(farm.programs(), "sheaf"), "submit", scene, "--samples", "1", "--title",
             name, "--wait", "-o", self.farm.path(name + ".exr")],
            env=dict(self.farm.environment, SHEAF_COORDINATOR=address, SHEAF_NO_QUOTE="1"),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def start_both(self, mib):
        """A client in the middle of its upload, and another one that waits for it."""
        folder = self.farm.path(f"{mib} MiB")
        os.makedirs(folder)
        scene, (digest,) = content_scene.write_scene(folder, [mib])
        partial = self.farm.path("state", "content", "partial", digest + ".part")
        slow = self.start(scene, self.link.address, f"slow{mib}")
        farm.wait_until(lambda: os.path.exists(partial) and os.path.getsize(partial) > 0, 20,
                        "the first bytes")
        self.link.hold()
        fast = self.start(scene, self.farm.address, f"fast{mib}")
        said = ""
        while "another client uploads the same file" not in said:
            line = fast.stderr.readline()
            self.assertTrue(line, said)
            said += line
        self.assertIsNone(slow.poll())
        return slow, fast, digest, said

    def check(self, process, name, said=""):
        said += process.stderr.read()
        self.assertEqual(process.wait(60 * farm.PATIENCE), 0, said)
        self.assertNotIn("does not answer", said)
        self.assertLessEqual(said.count("another client uploads the same file"), 1, said)
        self.assertTrue(os.path.exists(self.farm.path(name + ".exr")))

    def check_one_copy(self, digest):
        content = self.farm.path("state", "content")
        found = [os.path.join(folder, name) for folder, _, names in os.walk(content)
                 for name in names if digest in name and not folder.endswith("chunks")]
        self.assertEqual(found, [os.path.join(content, digest[:2], digest)])
        self.assertEqual(os.listdir(os.path.join(content, "partial")), [])

    def received_bytes(self):
        return next(value for name, value in self.farm.metrics().items()
                    if re.match(r"sheaf_content_received_bytes", name))

    def test_both_jobs_run_and_one_copy_is_stored(self):
        for mib in SIZES_MIB:
            with self.subTest(mib=mib):
                before = self.received_bytes()
                slow, fast, digest, said = self.start_both(mib)
                self.link.let_go()
                self.check(slow, f"slow{mib}")
                self.check(fast, f"fast{mib}", said)
                self.check_one_copy(digest)
                self.assertLess(self.received_bytes() - before, (mib << 20) + (64 << 10))

    def test_a_client_that_is_killed_is_not_waited_for(self):
        for mib in SIZES_MIB:
            with self.subTest(mib=mib):
                slow, fast, digest, said = self.start_both(mib)
                slow.kill()
                self.link.reset()
                self.link.let_go()
                self.check(fast, f"fast{mib}", said)
                self.check_one_copy(digest)


if __name__ == "__main__":
    unittest.main(verbosity=2)
