#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The denoised output is the same for any division of the work, and leaves the image as it is."""
import json
import os
import subprocess
import tempfile
import unittest

import farm

SCENE = '''Film "rgb" "integer xresolution" 40 "integer yresolution" 32
Sampler "zsobol" "integer pixelsamples" 24
Integrator "volpath" "integer maxdepth" 4
LookAt 0 -5 3  0 0 0.5  0 0 1
Camera "perspective" "float fov" 35
WorldBegin
AttributeBegin
  Translate 1 -1 4
  AreaLightSource "diffuse" "rgb L" [6 5 4]
  Shape "sphere" "float radius" 0.8
AttributeEnd
AttributeBegin
  Translate 0 0 1
  Material "diffuse" "rgb reflectance" [0.7 0.3 0.2]
  Shape "sphere" "float radius" 0.7
AttributeEnd
Material "diffuse" "rgb reflectance" [0.6 0.6 0.6]
Shape "bilinearmesh" "point3 P" [-4 -4 0  4 -4 0  -4 4 0  4 4 0]
'''
SMALL = ("--tile-size", 16, "--pass-samples", 4, "--lease-passes", 1)


class DenoiseTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.scene = os.path.join(cls.folder.name, "ball.pbrt")
        with open(cls.scene, "w", encoding="utf-8") as f:
            f.write(SCENE)
        cls.expected = cls.rendered("expected", "--denoise")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def path(cls, name):
        return os.path.join(cls.folder.name, name + ".exr")

    @classmethod
    def rendered(cls, name, *arguments):
        farm.render(cls.scene, cls.path(name), *arguments)
        return farm.image_digest(cls.path(name))

    def test_layers_are_beside_the_image(self):
        header = farm.read_bytes(self.path("expected"))[:4096]
        for channel in (b"R\0", b"denoised.R\0", b"denoisedError.B\0",
                        b"sheaf:denoisedMse\0float\0"):
            self.assertIn(channel, header)
        self.assertNotIn(b"even.", header)
        self.rendered("plain")
        self.assertNotIn(b"denoised", farm.read_bytes(self.path("plain"))[:4096])
        compared = json.loads(farm.compare(self.path("plain"), self.path("expected")))
        self.assertEqual(compared["verdict"], "identical")

    def test_pngs_show_the_denoised_layer(self):
        pngs = {}
        for layer in ("", "denoised", "image", "denoised_external"):
            png = self.path(layer or "unasked") + ".png"
            asked = ("--png-layer", layer) if layer else ()
            done = subprocess.run([os.path.join(farm.programs(), "sheaf"), "render", self.scene,
                                   "--denoise", "-o", self.path("shown"), "--png", png, *asked],
                                  capture_output=True, text=True, check=False)
            if layer == "denoised_external":
                self.assertEqual(done.returncode, 6, done.stderr)
                self.assertIn("no layer denoised_external; --denoise-with adds it", done.stderr)
                self.assertEqual(farm.image_digest(self.path("shown")), self.expected)
            else:
                self.assertEqual(done.returncode, 0, done.stderr)
                pngs[layer] = farm.read_bytes(png)
        self.assertEqual(pngs[""], pngs["denoised"])
        self.assertNotEqual(pngs[""], pngs["image"])

    def test_depth_from_the_plane_of_the_camera(self):
        self.rendered("ray")
        self.rendered("plane", "--exr-depth", "plane")
        header = farm.read_bytes(self.path("plane"))[:4096]
        self.assertIn(b"sheaf:depth\0string\0", header)
        self.assertNotIn(b"sheaf:depth\0", farm.read_bytes(self.path("ray"))[:4096])
        self.assertNotEqual(farm.image_digest(self.path("plane")),
                            farm.image_digest(self.path("ray")))

    def test_in_one_process(self):
        for arguments in (SMALL, ("--threads", 3)):
            with self.subTest(arguments=arguments):
                self.assertEqual(self.rendered("p", "--denoise", *arguments), self.expected)

    def test_one_and_four_workers(self):
        for count in (1, 4):
            with self.subTest(workers=count), farm.Farm() as f:
                for _ in range(count):
                    f.start_worker()
                job = f.sheaf("submit", self.scene, "--denoise", *SMALL).stdout.strip()
                f.sheaf("watch", job, "-o", self.path("farmed"))
                self.assertEqual(farm.image_digest(self.path("farmed")), self.expected)

    def script(self, body):
        path = self.path("a denoiser") + ".sh"
        with open(path, "w", encoding="utf-8") as file:
            file.write("#!/bin/sh\n" + body + "\n")
        os.chmod(path, 0o700)
        return path

    def test_a_command_of_the_user_adds_a_layer(self):
        self.rendered("plain", "--seed", 5)
        copy = self.script('cp "$1" "$2"')
        self.rendered("external", "--seed", 5, "--denoise-with", copy)
        header = farm.read_bytes(self.path("external"))[:4096]
        for word in (b"denoised_external.R\0", b"sheaf:externalDenoiser\0"):
            self.assertIn(word, header)
        compared = json.loads(farm.compare(self.path("plain"), self.path("external")))
        self.assertEqual(compared["verdict"], "identical")
        # The layer is no part of the image that was delivered.
        for name in ("plain", "external"):
            self.rendered("from " + name, "--seed", 5, "--samples", 32, "--resume-from",
                          self.path(name))
        self.assertEqual(farm.image_digest(self.path("from external")),
                         farm.image_digest(self.path("from plain")))
        shown = [farm.local("show", self.path(name), "--image=blocks", "--layer", layer)
                 for name, layer in (("plain", "image"), ("external", "denoised_external"))]
        self.assertEqual(*(text.partition("\x1b")[2] for text in shown))

    def test_a_command_that_fails_costs_no_image(self):
        expected = self.rendered("plain", "--seed", 6)
        failed = self.script("echo no model >&2; exit 3")
        with self.assertRaisesRegex(AssertionError, "(?s)exit code 6\n.*without the layer "
                                    "denoised_external: .*ended with exit status 3; it says \"no "
                                    "model\""):
            self.rendered("failed", "--seed", 6, "--denoise-with", failed)
        self.assertEqual(farm.image_digest(self.path("failed")), expected)
        with self.assertRaisesRegex(AssertionError, "exit code 2\n.*no such program"):
            self.rendered("none", "--denoise-with", self.path("none"))
        self.assertFalse(os.path.exists(self.path("none")))

    def test_layers_are_shown(self):
        for layer in ("denoised", "denoisedError"):
            shown = farm.local("show", self.path("expected"), "--image=blocks", "--layer", layer)
            self.assertIn("\x1b[38;2;", shown)
        self.assertIn("relative error: ", shown)
        self.rendered("plain")
        done = subprocess.run([os.path.join(farm.programs(), "sheaf"), "show", self.path("plain"),
                               "--image", "--layer", "denoised"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("--denoise of render and submit adds it", done.stderr)

    def test_studies_are_not_denoised(self):
        done = subprocess.run([os.path.join(farm.programs(), "sheaf"), "study", self.scene,
                               "--denoise"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("remove --denoise", done.stderr)

    def test_needs_independent_replicates(self):
        with self.assertRaisesRegex(AssertionError, "--one-sequence"):
            self.rendered("one", "--denoise", "--one-sequence")


if __name__ == "__main__":
    unittest.main()
