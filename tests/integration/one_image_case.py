# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The shared part of tests that one scene has one image, however a farm divides the work."""
import os
import random
import shutil
import tempfile
import time
import unittest

import farm


class OneImageCase(unittest.TestCase):
    """Renders the scene once in one process. Subclasses set SCENE_NAME, SCENE_TEXT and JOB.
    Methods: rendered() and finished() return digests of images, and leave the images at path()."""
    ASSETS = ()  # Folders that the scene names, copied beside it.

    @classmethod
    def setUpClass(cls):
        seed = int(os.environ.get("SHEAF_SEED", time.time_ns() % 1_000_000))
        print(f"SHEAF_SEED={seed}", flush=True)
        cls.random = random.Random(seed)
        cls.folder = tempfile.TemporaryDirectory()
        cls.scene = os.path.join(cls.folder.name, cls.SCENE_NAME)
        with open(cls.scene, "w", encoding="utf-8") as f:
            f.write(cls.SCENE_TEXT)
        for assets in cls.ASSETS:
            shutil.copytree(assets, os.path.join(cls.folder.name, os.path.basename(assets)))
        cls.expected = cls.rendered("expected", *cls.JOB)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def path(cls, name, ending=".exr"):
        return os.path.join(cls.folder.name, name + ending)

    @classmethod
    def rendered(cls, name, *arguments):
        farm.render(cls.scene, cls.path(name), *arguments)
        return farm.image_digest(cls.path(name))

    def finished(self, f, job, name="farmed"):
        """Waits for the job of farm `f`."""
        f.sheaf("watch", job, "-o", self.path(name))
        return farm.image_digest(self.path(name))
