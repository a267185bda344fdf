#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""sheaf view as another program meets it (docs/viewing.md): answers, pixels, ends.

Run: view_test.py (SHEAF_BIN: the folder of sheaf, by default build/release/bin).
"""
import array
import json
import os
import pathlib
import subprocess
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SHEAF = pathlib.Path(os.environ.get("SHEAF_BIN", ROOT / "build" / "release" / "bin")) / "sheaf"
SCENE = str(ROOT / "scenes" / "cornell-box.pbrt")
CAMERA = ('Film "rgb" "integer xresolution" 30 "integer yresolution" 20 '
          '"integer pixelbounds" [ 6 30 0 20 ]\n'
          'Sampler "zsobol" "integer pixelsamples" 4\n'
          'LookAt 0 1 -5  0 1 0  0 1 0\nCamera "perspective" "float fov" 50')
REQUEST_BYTES_MAX = 1 << 20  # kRequestBytesMax of command_view.cc.
SECONDS_MAX = 60


class Viewer:
    def __init__(self):
        self.process = subprocess.Popen([SHEAF, "view", "--json", "--threads", "2"],
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE)

    def ask(self, **request):
        self.say(json.dumps(request))

    def say(self, line):
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def answer(self):
        """(the next answer, its pixels)."""
        found = json.loads(self.process.stdout.readline())
        pixels = array.array("f")
        if "image" in found:
            pixels.frombytes(self.process.stdout.read(found["image"]["byte_count"]))
        return found, pixels

    def last_image(self):
        while True:
            found, pixels = self.answer()
            if "error" in found:
                raise AssertionError(found)
            if "image" in found and found["image"]["complete"]:
                return found, pixels

    def end(self):
        """Its exit code and what it said on standard error."""
        said = self.process.communicate(timeout=SECONDS_MAX)[1].decode()
        return self.process.returncode, said


class ViewTest(unittest.TestCase):
    def test_a_conversation(self):
        viewer = Viewer()
        viewer.ask(id=1, scene=SCENE, camera=CAMERA)
        self.assertEqual(sorted(viewer.answer()[0]), ["id", "loaded"])
        found, pixels = viewer.last_image()
        image = found["image"]
        self.assertEqual((found["id"], image["width"], image["height"], image["samples"]),
                         (1, 24, 20, 4))
        self.assertEqual([image[name] for name in ("x0", "y0", "x1", "y1", "film_width",
                                                   "film_height")], [6, 0, 30, 20, 30, 20])
        self.assertEqual(len(pixels), 4 * 24 * 20)
        self.assertTrue(all(0 <= x <= 1 for x in pixels[3::4]))
        self.assertGreater(sum(pixels), 0)
        viewer.ask(id=2, camera=CAMERA.replace("fov\" 50", "fov\" 20"))
        other, zoomed = viewer.last_image()
        self.assertEqual(other["id"], 2)
        self.assertNotEqual(pixels, zoomed)
        viewer.ask(id=3, camera="Camera \"none\"")
        self.assertIn("camera:1:1", viewer.answer()[0]["error"])
        viewer.ask(id=4, scene="missing.pbrt")
        self.assertIn("missing.pbrt", viewer.answer()[0]["error"])
        viewer.ask(id=5, scene=SCENE)
        self.assertEqual(viewer.last_image()[0]["id"], 5)
        self.assertEqual(viewer.end(), (0, ""))

    def test_it_ends_with_its_input_while_it_renders(self):
        viewer = Viewer()
        viewer.ask(id=1, scene=SCENE, camera=CAMERA.replace("pixelsamples\" 4",
                                                            "pixelsamples\" 1000000"))
        viewer.answer()
        self.assertEqual(viewer.end()[0], 0)

    def test_a_line_that_is_no_request(self):
        viewer = Viewer()
        viewer.say("hello")
        code, said = viewer.end()
        self.assertEqual(code, 2)
        self.assertIn("docs/viewing.md", said)

    def test_a_line_that_is_too_long(self):
        viewer = Viewer()
        viewer.say("x" * (REQUEST_BYTES_MAX + 1))
        code, said = viewer.end()
        self.assertEqual(code, 2)
        self.assertIn("too long", said)

    def test_it_ends_where_answers_are_not_read(self):
        viewer = Viewer()
        viewer.process.stdout.close()
        viewer.ask(id=1, scene=SCENE, camera=CAMERA)
        viewer.process.wait(SECONDS_MAX)
        self.assertNotEqual(viewer.process.returncode, 0)
        viewer.process.stdin.close()
        viewer.process.stderr.close()


if __name__ == "__main__":
    unittest.main(verbosity=2)
