#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""One image on processors of all makers.

Processors of two makers round approximate reciprocals (rcpps) differently; all other results of one
instruction set are equal. QEMU's emulation computes them exactly, which is a third variant. The
image must be the same to the bit on this machine's processor and on the emulated one. Needs
qemu-x86_64.
"""
import os
import shutil
import subprocess
import tempfile
import unittest

import farm

QEMU = shutil.which("qemu-x86_64")
# Regions of our scenes that cover meshes, quadrics, curves, instances, textures and media.
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
    def test_emulated_processor_renders_the_same_image(self):
        program = os.path.join(farm.programs(), "sheaf")
        for name, crop in PARTS.items():
            with self.subTest(name), tempfile.TemporaryDirectory() as folder:
                digests = []
                for runner in ([], [QEMU, "-cpu", "max"]):
                    path = os.path.join(folder, f"image{len(digests)}.exr")
                    subprocess.run([*runner, program, "render",
                                    os.path.join(farm.ROOT, "scenes", name + ".pbrt"), "--samples",
                                    "4", "--crop", crop, "-o", path], check=True,
                                   capture_output=True, timeout=120 * farm.PATIENCE)
                    digests.append(farm.image_digest(path))
                self.assertEqual(*digests)


if __name__ == "__main__":
    unittest.main()
