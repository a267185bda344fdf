#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Large volumes are submitted as page files in parts, of which workers fetch what their tiles read.
The images are those of the volume itself, also where workers and the coordinator are killed.
"""
import os
import random
import sys
import unittest

import farm

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support",
                                "volume"))
from nanovdb_file import write_noise_layer  # noqa: E402

# Seen along the layer's thickness, and only absorbing: rays stay where they enter.
SCENE = """Film "rgb" "integer xresolution" 128 "integer yresolution" 128
Sampler "zsobol" "integer pixelsamples" 4
Integrator "volpath" "integer maxdepth" 1
LookAt 0 0 -40  0 0 0  0 1 0
Camera "perspective" "float fov" 3
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
MakeNamedMedium "cloud" "string type" "nanovdb" "string filename" "cloud.nvdb"
  "rgb sigma_a" [4 4 4] "rgb sigma_s" [0 0 0]
Material "interface"
MediumInterface "cloud" ""
Shape "trianglemesh"
  "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
  "integer indices" [0 2 1  0 3 2  4 5 6  4 6 7  0 1 5  0 5 4  3 7 6  3 6 2  0 4 7  0 7 3  1 2 6
                     1 6 5]
"""
# Light scatters near where it enters, and a lamp is in front of the crop. Where to sample
# lines beside it is decided by the mean of the grid.
LAMP = (SCENE.replace('"integer maxdepth" 1', '"integer maxdepth" 2')
        .replace('"infinite" "rgb L" [1 1 1]',
                 '"point" "rgb I" [1 1 1] "point3 from" [-0.52 0.52 -1.02]')
        .replace("[4 4 4]", "[60 60 60]").replace('"rgb sigma_s" [0 0 0]',
                                                  '"rgb sigma_s" [20 20 20]'))
PAGED = ("--page-volumes-from", "1M")
WHOLE = ("--page-volumes-from", "999G")
CROP = ("--crop", "28,28,36,36")
# A fetch happens once a worker has asked for it.
SECONDS_MAX = 30


class VolumePartsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.farm = farm.Farm()
        cls.farm.__enter__()
        cls.addClassCleanup(cls.farm.__exit__)
        cls.farm.environment["XDG_CACHE_HOME"] = cls.farm.path("client cache")
        cls.scene = cls.farm.path("scene.pbrt")
        with open(cls.scene, "w", encoding="ascii") as text:
            text.write(SCENE)
        cls.volume_bytes = write_noise_layer(cls.farm.path("cloud.nvdb"), 256, random.Random(1))

    def fetched(self):
        return self.farm.metrics().get('sheaf_content_bytes_total{source="coordinator"}', 0)

    def render(self, name, *arguments, scene=None):
        job = self.farm.sheaf("submit", scene or self.scene, *arguments).stdout.strip()
        self.farm.sheaf("watch", job, "-o", self.farm.path(name))
        return farm.image_digest(self.farm.path(name))

    def local(self, *arguments, scene=None):
        farm.render(scene or self.scene, self.farm.path("local.exr"), *WHOLE, *arguments)
        return farm.image_digest(self.farm.path("local.exr"))

    def parts_bytes(self):
        kept = self.farm.path("client cache", "sheaf-pages")
        folders = os.listdir(kept)
        self.assertEqual(len(folders), 1)
        folder = os.path.join(kept, folders[0])
        return sum(os.path.getsize(os.path.join(folder, name)) for name in os.listdir(folder))

    def test_a_worker_fetches_what_its_tiles_read(self):
        f = self.farm
        worker = f.start_worker(cache="cropping")
        before = self.fetched()
        cropped = self.render("crop.exr", *PAGED, *CROP)
        total = self.parts_bytes()
        self.assertGreater(total, self.volume_bytes / 2)

        def settled():
            return self.fetched() - before
        fetched = farm.wait_until(settled, SECONDS_MAX, "the worker's report")
        self.assertLess(fetched, total / 4)
        self.assertEqual(cropped, self.local(*CROP))
        # Most of the rest follows with the whole frame, once.
        self.render("whole.exr", *PAGED)
        farm.wait_until(lambda: self.fetched() - before > total * 0.9, SECONDS_MAX, "all parts")
        self.assertLess(self.fetched() - before, total * 1.05)
        metrics = f.metrics()
        self.assertGreater(metrics['sheaf_volume_pages_total{result="read"}'], 100)
        self.assertGreater(metrics["sheaf_volume_resident_bytes"], 0)
        self.assertGreater(metrics["sheaf_volume_part_bytes_total"], total * 0.9)
        print(f"crop: {fetched / 2 ** 20:.1f} MiB of {total / 2 ** 20:.1f} MiB fetched")
        f.kill(worker)

    def test_a_lamp_reads_no_more(self):
        f = self.farm
        scene = f.path("lamp.pbrt")
        with open(scene, "w", encoding="ascii") as text:
            text.write(LAMP)
        worker = f.start_worker(cache="lamp")
        before = self.fetched()
        cropped = self.render("lamp.exr", *PAGED, *CROP, scene=scene)
        total = self.parts_bytes()
        fetched = farm.wait_until(lambda: self.fetched() - before, SECONDS_MAX,
                                  "the worker's report")
        self.assertLess(fetched, total / 4)
        self.assertEqual(cropped, self.local(*CROP, scene=scene))
        print(f"lamp: {fetched / 2 ** 20:.1f} MiB of {total / 2 ** 20:.1f} MiB fetched")
        f.kill(worker)

    def test_kills_do_not_change_the_image(self):
        f = self.farm
        expected = self.local("--samples", "64")
        worker = f.start_worker("--volume-memory-max", "2M", cache="killed")
        before = self.fetched()
        job = f.sheaf("submit", self.scene, *PAGED, "--samples", "64").stdout.strip()
        farm.wait_until(lambda: self.fetched() > before, SECONDS_MAX, "a first part")
        f.kill(worker)
        f.start_worker("--volume-memory-max", "2M", cache="killed")
        done = len(f.acknowledged(job))
        farm.wait_until(lambda: len(f.acknowledged(job)) > done, SECONDS_MAX, "a result")
        f.kill(f.coordinator)
        f.start_coordinator()
        f.sheaf("watch", job, "-o", f.path("killed.exr"))
        self.assertEqual(farm.image_digest(f.path("killed.exr")), expected)


if __name__ == "__main__":
    unittest.main()
