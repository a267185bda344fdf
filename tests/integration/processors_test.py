#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""One picture, whoever made the processor.

Processors of two makers round approximate reciprocals (rcpps) differently, and nothing else of one
instruction set. QEMU's emulation has them exact, which is a third way: a picture that is rendered
by this machine's processor and by an emulated one is the same to the bit. Needs qemu-x86_64.
"""
import os
import shutil
import subprocess
import tempfile
import unittest

import farm

QEMU = shutil.which("qemu-x86_64")
# A part of each of our scenes: meshes, quadrics, curves, placed groups, textures, media.
PARTS = {
    "cornell-box": "160,160,240,240",
    "showroom": "260,150,340,210",
    "insides": "200,140,260,190",
    "fog-room": "200,140,260,190",
    "cloud": "220,130,260,160",
    "fire": "140,180,180,220",
    "lens": "200,140,260,190",
}


@unittest.skipUnless(QEMU, "qemu-x86_64 is not there (Debian's qemu-user)")
class ProcessorsTest(unittest.TestCase):
    def test_an_emulated_processor_renders_the_same_picture(self):
        program = os.path.join(farm.programs(), "sheaf")
        for name, crop in PARTS.items():
            with self.subTest(name), tempfile.TemporaryDirectory() as folder:
                digests = []
                for runner in ([], [QEMU, "-cpu", "max"]):
                    path = os.path.join(folder, f"picture{len(digests)}.exr")
                    subprocess.run([*runner, program, "render",
                                    os.path.join(farm.ROOT, "scenes", name + ".pbrt"), "--samples",
                                    "4", "--crop", crop, "-o", path], check=True,
                                   capture_output=True, timeout=120 * farm.TIME_SCALE)
                    digests.append(farm.picture_digest(path))
                self.assertEqual(*digests)


if __name__ == "__main__":
    unittest.main()
