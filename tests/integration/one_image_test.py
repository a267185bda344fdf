#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""One image: its bits depend neither on the partition of a job nor on the workers.

The same job on 1, 2 and 4 workers (short form: 3), with tiles of 16, 32 and 64 pixels, passes of 4,
16 and 64 samples, leases of 1 and 8 passes, in one process and over gRPC, gives one SHA-256 of the
pixels.
SHEAF_SCENE selects another scene.
"""
import itertools
import json
import os
import tempfile
import unittest

import farm

SCENE = os.environ.get("SHEAF_SCENE", os.path.join(farm.ROOT, "scenes", "showroom.pbrt"))
# 70 x 34 pixels and 76 samples: more than the largest tile and pass, in both directions more than a
# tile of 32 pixels, not a multiple of the tile size, and not a power of two.
JOB = ("--crop", "270,150,340,184", "--samples", "76")
OUTPUTS = ("--aov", "position,normal-geometric,normal-shading,uv,motion,object-id",
           "--cryptomatte", "object,material,asset", "--light-groups")
FOG = '''Film "rgb" "integer xresolution" 16 "integer yresolution" 12
Sampler "zsobol" "integer pixelsamples" 4
Integrator "volpath" "integer maxdepth" 50
LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 30
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
MakeNamedMedium "milk" "string type" "homogeneous" "rgb sigma_s" [9 8 7] "rgb sigma_a" [0 0.1 0.2]
  "float g" 0.8
Material "interface"
MediumInterface "milk" ""
Shape "sphere" "float radius" 1
'''
# The short form has each tile, each pass and each lease.
PARTITIONS = (list(itertools.product((16, 32, 64), (4, 16, 64), (1, 8))) if farm.ALL_TESTS else
              [(16, 64, 1), (32, 4, 8), (64, 16, 1)])
WORKERS = (1, 2, 4) if farm.ALL_TESTS else (3,)


def partition_flags(tile, samples, passes):
    return ("--tile-size", tile, "--pass-samples", samples, "--lease-passes", passes)


class OneImageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.expected = cls.rendered("reference")

        cls.farm = farm.Farm()
        cls.farm.__enter__()
        for _ in range(2):
            cls.farm.start_worker()

    @classmethod
    def tearDownClass(cls):
        cls.farm.__exit__()
        cls.folder.cleanup()

    @classmethod
    def rendered(cls, name, *arguments):
        path = os.path.join(cls.folder.name, name + ".exr")
        farm.render(SCENE, path, *JOB, *arguments)
        return farm.image_digest(path)

    def test_in_one_process(self):
        for partition in PARTITIONS:
            with self.subTest(partition=partition):
                self.assertEqual(self.rendered("p", *partition_flags(*partition)), self.expected)

    def test_threads_and_variant(self):
        for arguments in (("--threads", 1), ("--threads", 3), ("--generic",)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("t", *arguments), self.expected)

    def test_over_grpc(self):
        """All jobs at once, so that the workers also mix their leases."""
        for workers in WORKERS:
            with farm.Farm() as f:
                for _ in range(workers):
                    f.start_worker()
                jobs = [f.sheaf("submit", SCENE, *JOB, *partition_flags(*partition)).stdout.strip()
                        for partition in PARTITIONS]
                for partition, job in zip(PARTITIONS, jobs):
                    with self.subTest(workers=workers, partition=partition):
                        output = f.path("out.exr")
                        f.sheaf("watch", job, "-o", output)
                        self.assertEqual(farm.image_digest(output), self.expected)
                        os.remove(output)

    def farmed(self, *flags):
        """Digest of the image rendered by a farm with two workers."""
        output = self.farm.path("out.exr")
        self.farm.sheaf("submit", SCENE, "--wait", "-o", output, *JOB, *flags)
        return farm.image_digest(output)

    def test_color_and_scattering_settings_are_transmitted(self):
        for flags in (("--color", "spectral"), ("--single-scattering",), ("--one-sequence",)):
            with self.subTest(flags=flags):
                expected = self.rendered("c", *flags)
                self.assertNotEqual(expected, self.expected)
                if farm.ALL_TESTS:
                    self.assertEqual(self.rendered("c", *flags, "--generic"), expected)
                self.assertEqual(self.farmed(*flags, *partition_flags(*PARTITIONS[0])), expected)

    def test_similarity_is_transmitted(self):
        fog = os.path.join(self.folder.name, "fog.pbrt")
        with open(fog, "w", encoding="utf-8") as f:
            f.write(FOG)
        images = {}
        for after in (0, 1, 3):
            path = os.path.join(self.folder.name, "fog.exr")
            farm.render(fog, path, "--similarity", after)
            images[after] = farm.image_digest(path)
            output = self.farm.path("fog.exr")
            self.farm.sheaf("submit", fog, "--wait", "-o", output, "--similarity", after)
            self.assertEqual(farm.image_digest(output), images[after])
        self.assertEqual(len(set(images.values())), 3)

    def test_outputs(self):
        expected = self.rendered("o", *OUTPUTS)
        self.assertNotEqual(expected, self.expected)
        for partition in PARTITIONS[:2]:
            with self.subTest(partition=partition):
                flags = OUTPUTS + partition_flags(*partition)
                self.assertEqual(self.rendered("o", *flags), expected)
        self.assertEqual(self.farmed(*OUTPUTS, *partition_flags(*PARTITIONS[-1])), expected)

    def test_primaries(self):
        flags = ("--primaries", "acescg", "--light-groups")
        expected = self.rendered("a", *flags)
        self.assertNotEqual(expected, self.rendered("g", "--light-groups"))
        for partition in PARTITIONS[:2]:
            with self.subTest(partition=partition):
                self.assertEqual(self.rendered("a", *flags, *partition_flags(*partition)),
                                 expected)
        self.assertEqual(self.farmed(*flags, *partition_flags(*PARTITIONS[-1])), expected)
        # The colors are equal: compare converts one image, and only rounding remains.
        report = json.loads(farm.compare(os.path.join(self.folder.name, "reference.exr"),
                                         os.path.join(self.folder.name, "a.exr")))
        self.assertTrue(report["reference_converted"])
        self.assertLess(report["relative_mse"], 1e-12)

    def test_another_seed_gives_another_image(self):
        self.assertNotEqual(self.rendered("s", "--seed", 1), self.expected)


if __name__ == "__main__":
    unittest.main(verbosity=2)
