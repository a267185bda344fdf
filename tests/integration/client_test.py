#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The client as people and scripts meet it: commands, JSON, exit codes, and what it says of errors.

One farm of one worker serves all tests; the scenes are the turntable's first frames and a few lines
of text.
"""
import base64
import json
import math
import os
import re
import signal
import socket
import subprocess
import unittest
from unittest import mock
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import farm

TURNTABLE = os.path.join(farm.ROOT, "scenes", "turntable", "turntable.####.pbrt")
SMALL = ("--crop", "120,60,200,120", "--samples", "4")
OK, FAILED, USAGE, UNREACHABLE, BAD_SCENE, CANCELLED, FILE, INTERRUPTED = 0, 1, 2, 3, 4, 5, 6, 130

# A square under a sky. What is broken is added below it.
SCENE = """LookAt 0 0 -3  0 0 0  0 1 0
Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 48 "integer yresolution" 32
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
  "point3 P" [-1 -1 0  1 -1 0  1 1 0  -1 1 0]
"""
# A floor under a lamp that is not in view.
SMOOTH = """LookAt 0 1.5 -4  0 0.3 0  0 1 0
Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 128 "integer yresolution" 80
WorldBegin
AttributeBegin
  Translate 0 2.5 0
  AreaLightSource "diffuse" "rgb L" [4 4 4]
  Shape "disk" "float radius" 0.8
AttributeEnd
Material "diffuse" "rgb reflectance" [0.6 0.5 0.4]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
  "point3 P" [-9 0 -9  9 0 -9  9 0 9  -9 0 9]
"""
TRUNCATED_PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
"""


def run(*arguments, seconds=30, environment=None):
    """`sheaf` without a farm."""
    return subprocess.run([os.path.join(farm.programs(), "sheaf"), *map(str, arguments)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=seconds * farm.TIME_SCALE,
                          env=dict(os.environ, **(environment or {})))


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class ClientTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.farm = farm.Farm(["--allow-host", "farm.example", "--allow-host", "other.example"])
        cls.farm.__enter__()
        cls.addClassCleanup(cls.farm.__exit__)
        cls.farm.start_worker()

    def write(self, name, text):
        path = self.farm.path(name)
        with open(path, "w", encoding="utf-8") as f:
            f.write(text)
        return path

    def expect(self, done, code):
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def test_help_is_text(self):
        for command in ("render", "submit", "quote", "refine", "plan"):
            text = self.farm.sheaf(command, "--help").stdout
            self.assertTrue(all(c.isprintable() or c == "\n" for c in text), command)

    def test_frames_of_a_pattern(self):
        os.makedirs(self.farm.path("out"), exist_ok=True)
        done = self.farm.sheaf("submit", TURNTABLE, "--frames", "1-3", *SMALL, "--wait", "--json",
                               "-o", self.farm.path("out", "t.####.exr"))
        job = [json.loads(line) for line in done.stdout.splitlines()][-1]
        self.assertEqual(job["state"], "succeeded")
        self.assertIsNotNone(job["end_time"])
        digests = [frame["picture_digest"] for frame in job["frames"]]
        self.assertEqual(len(set(digests)), 3, "each frame is another picture")
        for number, digest in enumerate(digests, start=1):
            path = self.farm.path("out", f"t.{number:04d}.exr")
            self.assertEqual(farm.picture_digest(path), digest)
            # "t.0001.exr: 80x60, 4 samples, 0.3 s, 60 k samples/s, 200 k rays/s, relMSE 1e-2, ..."
            self.assertRegex(done.stderr, re.escape(path) + r": 80x60, 4 samples, \d+\.\d s, "
                             r"\S+ \w?\s?samples/s, \S+ \w?\s?rays/s, relMSE \S+, "
                             r"FLIP \S+, 0 non-finite")
        self.assertRegex(done.stderr, r"sheaf: jobs/\d+: 3 frames, \d+\.\d s")

        name = job["name"]
        self.assertEqual(json.loads(self.farm.sheaf("show", name, "--json").stdout)["frames"],
                         job["frames"])
        text = self.farm.sheaf("show", name.removeprefix("jobs/")).stdout
        self.assertIn("succeeded", text)
        for digest in digests:
            self.assertIn(digest[:16], text)
        listed = [json.loads(line) for line in
                  self.farm.sheaf("list", "--json").stdout.splitlines()]
        self.assertIn(name, [entry["name"] for entry in listed])
        self.assertIn(name, self.farm.sheaf("list").stdout)

        again = self.farm.path("out", "again.#.exr")
        self.farm.sheaf("watch", name, "-o", again)
        self.assertEqual(farm.picture_digest(self.farm.path("out", "again.2.exr")), digests[1])
        self.expect(self.farm.sheaf("watch", name, "-o", "one.exr", check=False), USAGE)

    def test_views(self):
        scene = self.write("view.pbrt", SCENE)
        exr, png = self.farm.path("view.exr"), self.farm.path("view.png")
        for wrong in (("--view", "Filmic"), ("--display", "TV"), ("--ocio", "/nowhere.ocio")):
            done = self.expect(run("render", scene, "-o", exr, "--png", png, *wrong), USAGE)
            self.assertIn(wrong[1], done.stderr)
            self.assertFalse(os.path.exists(exr), "checked before rendering")
        self.assertIn("it has: sRGB, ACES 1.0 SDR, Raw",
                      run("watch", "1", "--view", "Filmic").stderr)

        shown = {}
        for view in ("sRGB", "ACES 1.0 SDR", "Raw"):
            self.expect(run("render", scene, "--samples", 4, "-o", exr, "--png", png,
                            "--view", view.lower()), OK)
            with open(png, "rb") as f:
                shown[view] = f.read()
            self.assertIn(b"tEXtView\0" + view.encode(), shown[view])
        self.assertEqual(len(set(shown.values())), 3)
        self.expect(run("render", scene, "--samples", 4, "-o", exr, "--png", png,
                        environment={"OCIO": ""}), OK)
        with open(png, "rb") as f:
            self.assertEqual(f.read(), shown["sRGB"], "the default")
        self.expect(run("render", scene, "--samples", 4, "-o", exr, "--png", png,
                        environment={"OCIO": "/nowhere.ocio"}), USAGE)
        self.expect(run("render", scene, "--samples", 4, "-o", exr, "--png", png, "--ocio", "",
                        environment={"OCIO": "/nowhere.ocio"}), OK)

    def test_pictures_in_the_terminal(self):
        scene, exr = self.write("shown.pbrt", SCENE), self.farm.path("shown.exr")
        self.farm.sheaf("submit", scene, "--samples", 4, "--wait", "-o", exr)
        job = json.loads(self.farm.sheaf("list", "--json", "--limit", 1).stdout)["name"]
        half_block = "\u2580"
        for target, command in ((job, self.farm.sheaf), (exr, run)):
            self.assertNotIn("\x1b", command("show", target).stdout, "no terminal")
            text = command("show", target, "--picture").stdout
            self.assertEqual(text.count(half_block), 48 * 32 / 2)
            self.assertIn("\x1b[38;2;", text)
            self.assertIn("\x1b[38;5;", command("show", target, "--picture=blocks256").stdout)
            kitty = command("show", target, "--picture=kitty").stdout
            payload = "".join(re.findall(r"\x1b_G[^;]*;([^\x1b]*)\x1b", kitty))
            self.assertTrue(base64.b64decode(payload).startswith(b"\x89PNG"))
            samples = command("show", target, "--picture", "--layer", "samples").stdout
            self.assertIn("samples per pixel: dark blue 4, yellow 4", samples)
            self.assertIn("relative error: ",
                          command("show", target, "--picture", "--layer", "error").stdout)
        self.expect(run("show", exr, "--picture=sixel"), USAGE)
        self.expect(run("show", exr, "--picture", "--view", "Filmic"), USAGE)
        self.expect(run("show", self.farm.path("none.exr")), FILE)
        self.assertEqual(json.loads(run("show", exr, "--json").stdout)["width_px"], 48)
        narrow = run("show", exr, "--picture", environment={"COLUMNS": "20"}).stdout
        self.assertEqual(narrow.count(half_block), 20 * 7, "20 x 13 pixels")

    def test_workers(self):
        worker = json.loads(self.farm.sheaf("workers", "--json").stdout)
        self.assertEqual(worker["thread_count"], 1)
        self.assertIn(worker["state"], ("idle", "busy"))
        self.assertIn(worker["name"].removeprefix("workers/"), self.farm.sheaf("workers").stdout)

    def test_cancel(self):
        scene = self.write("long.pbrt", SCENE)
        name = self.farm.sheaf("submit", scene, "--samples", 1 << 24).stdout.strip()
        self.assertRegex(name, r"^jobs/\d+$")
        self.assertIn("cancelled", self.farm.sheaf("cancel", name).stdout)
        self.assertIn("was cancelled",
                      self.expect(self.farm.sheaf("watch", name, check=False), CANCELLED).stderr)
        job = json.loads(self.farm.sheaf("cancel", name, "--json").stdout)  # Again: no harm.
        self.assertEqual(job["state"], "cancelled")
        self.assertIsNotNone(job["end_time"])
        unknown = self.farm.sheaf("cancel", "jobs/999999", check=False)
        self.assertIn("jobs/999999", self.expect(unknown, FAILED).stderr)

    def test_pause_resume_and_priority(self):
        scene = self.write("paused.pbrt", SCENE)
        sheaf = self.farm.sheaf
        name = sheaf("submit", scene, "--samples", 1 << 24).stdout.strip()
        self.assertEqual(sheaf("pause", name).stdout, f"{name} paused\n")
        self.assertIn("paused", sheaf("list", "--limit", 1).stdout)
        self.assertIn("; paused", sheaf("show", name).stdout)
        again = json.loads(sheaf("pause", name, "--json").stdout)  # No harm.
        self.assertEqual(again["state"], "paused")
        self.assertIn("is paused", sheaf("refine", name, "--samples", 8, check=False).stderr)
        # Others go before it, and it waits for as long as one likes.
        sheaf("submit", scene, "--samples", 4, "--wait", "-o", self.farm.path("other.exr"))
        self.assertEqual(json.loads(sheaf("show", name, "--json").stdout)["state"], "paused")
        self.assertEqual(sheaf("priority", name, "-5").stdout, f"{name} priority -5\n")
        self.assertEqual(json.loads(sheaf("priority", name, 7, "--json").stdout)["priority"], 7)
        self.expect(sheaf("priority", name, 1001, check=False), USAGE)
        self.assertRegex(sheaf("resume", name).stdout, f"^{name} (queued|running)\n$")
        sheaf("pause", name)
        self.assertEqual(sheaf("cancel", name).stdout, f"{name} cancelled\n")
        self.assertEqual(sheaf("resume", name).stdout, f"{name} cancelled\n")
        unknown = sheaf("pause", "jobs/999999", check=False)
        self.assertIn("jobs/999999", self.expect(unknown, FAILED).stderr)

    def test_wrong_usage(self):
        scene = self.write("usage.pbrt", SCENE)
        for arguments in ([], ["nonsense"], ["render"], ["render", scene, "--crop", "1,2"],
                          ["render", scene, "--pass-samples", "3"],
                          ["submit", TURNTABLE, "--frames", "1-x"],
                          ["submit", TURNTABLE, "--frames", "1-3", "-o", "one.exr"]):
            with self.subTest(arguments=arguments):
                self.assertNotEqual(self.expect(run(*arguments), USAGE).stderr, "")

    def test_nobody_answers(self):
        address = f"127.0.0.1:{free_port()}"
        done = self.expect(run("list", "--coordinator", address), UNREACHABLE)
        self.assertIn(address, done.stderr)
        self.assertIn("sheaf-coordinator", done.stderr)

    def test_missing_files(self):
        for command in ("render", "submit", "plan"):
            with self.subTest(command=command):
                done = self.expect(run(command, self.farm.path("none.pbrt")), FILE)
                self.assertIn("none.pbrt", done.stderr)
        self.expect(run("compare", self.farm.path("none.exr"), self.farm.path("none.exr")), FILE)
        scene = self.write("unwritable.pbrt", SCENE)
        self.expect(run("render", scene, "--samples", 1, "-o", "/proc/none/out.exr"), FILE)

    def test_broken_scenes_say_where(self):
        self.write("short.ply", TRUNCATED_PLY)
        self.write("circle.pbrt", 'Include "circle.pbrt"\n')
        line = SCENE.count("\n") + 1
        here = rf"broken\.pbrt:{line}:\d+: "
        cases = (('Shape "plymesh" "string filename" "none.ply"', here + r".*none\.ply"),
                 ('Shape "plymesh" "string filename" "short.ply"', r"short\.ply"),
                 ('Include "circle.pbrt"', r"circle\.pbrt:1:\d+: "),
                 ('Shape "sphere" "float radius" "wide"', here),
                 ('Shape "sphere" "float radius" [', rf"broken\.pbrt:{line + 1}:1: "),
                 ("Nonsense", here))
        for text, expected in cases:
            scene = self.write("broken.pbrt", SCENE + text + "\n")
            for command in ("render", "submit", "plan"):
                with self.subTest(text=text, command=command):
                    done = self.farm.sheaf(command, scene, check=False, seconds=30)
                    self.assertRegex(self.expect(done, BAD_SCENE).stderr, expected)

    def test_plan(self):
        plan = json.loads(self.expect(run("plan", "--json", TURNTABLE.replace("####", "0001")),
                                      OK).stdout)
        self.assertTrue(plan["variant"])
        self.assertTrue(plan["effects"])

    def test_plan_says_what_is_biased(self):
        scene = self.write("milk.pbrt", SCENE + 'MakeNamedMedium "milk" "float g" 0.75\n'
                           '"string type" "homogeneous"\nMediumInterface "milk" ""\n'
                           'Shape "sphere"\n')
        self.assertEqual(json.loads(self.expect(run("plan", "--json", scene), OK).stdout)["notes"],
                         [])
        said = self.expect(run("plan", scene, "--similarity", 4), OK).stdout
        self.assertIn("BIASED after 4 scatterings", said)
        self.assertIn('medium "milk", g 0.75', said)
        notes = json.loads(self.expect(run("plan", "--json", scene, "--similarity", 4), OK).stdout)
        self.assertIn("BIASED", notes["notes"][0])
        self.expect(run("plan", scene, "--similarity", -1), USAGE)

    def test_completion(self):
        for shell, check in (("bash", ["bash", "-n"]), ("zsh", None), ("fish", None)):
            script = self.expect(run("completion", shell), OK).stdout
            self.assertIn("--pass-samples", script if shell != "fish" else
                          script.replace("-l pass-samples", "--pass-samples"))
            if check:
                path = self.write("completion", script)
                self.assertEqual(subprocess.run([*check, path], capture_output=True,
                                                text=True).stderr, "")
                subprocess.run(["bash", "-ec", f"source '{path}'; complete -p sheaf"], check=True,
                               stdout=subprocess.DEVNULL)

    def test_render_goes_on_where_it_was_interrupted(self):
        scene = self.write("kept.pbrt", SCENE)
        job = ("--samples", 2048, "--pass-samples", 64, "--lease-passes", 1, "--tile-size", 16,
               "--threads", 1)
        whole, kept = self.farm.path("whole.exr"), self.farm.path("kept.exr")
        done = farm.render(scene, whole, *job)
        self.assertNotIn("no worker", done.stderr)
        self.assertNotIn("uploading", done.stderr)
        self.assertRegex(done.stderr, re.escape(whole) + r": 48x32, 2048 samples, ")

        command = [os.path.join(farm.programs(), "sheaf"), "render", scene, "-o", kept,
                   "--keep-state", self.farm.path("kept state"), *map(str, job)]
        parts = self.farm.path("kept state", "parts")
        first = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                 text=True)
        farm.wait_until(lambda: sum(len(files) for _, _, files in os.walk(parts)) > 3, 30,
                        "a few finished parts")
        first.send_signal(signal.SIGINT)
        _, text = first.communicate(timeout=30 * farm.TIME_SCALE)
        self.assertEqual(first.returncode, INTERRUPTED, text)
        self.assertIn("goes on from here", text)
        self.assertFalse(os.path.exists(kept))
        for _ in range(2):  # The rest; then nothing is left to do.
            farm.render(scene, kept, "--keep-state", self.farm.path("kept state"), *job)
            self.assertEqual(farm.picture_digest(kept), farm.picture_digest(whole))
            os.remove(kept)

    def test_unreliable_tiles_and_what_makes_them_so(self):
        """The room's glass ball throws light on its floor, by way of few samples."""
        scene = os.path.join(farm.ROOT, "scenes/cornell-box.pbrt")
        size = ("--crop", "120,240,320,400", "--samples", 16)
        plain = farm.render(scene, self.farm.path("plain.exr"), *size)
        self.assertIn("--light-paths and sheaf study say which paths", plain.stderr)
        done = farm.render(scene, self.farm.path("paths.exr"), *size, "--light-paths", "--json")
        self.assertRegex(done.stderr, r"not reliable yet \(.*caustic in [0-9]+.*\)")
        frame = json.loads(done.stdout.splitlines()[-1])["frames"][0]
        tiles = [layer["tile_count"] for layer in frame["unreliable_layers"]]
        self.assertEqual(sum(tiles), frame["unreliable_tile_count"])
        self.assertEqual(tiles, sorted(tiles, reverse=True))

    def test_smooth_pictures_say_what_one_sequence_would_save(self):
        """It saves something, and no more than if errors went on falling as they did. The room with
        the glass ball has nothing to save."""
        scene = self.write("smooth.pbrt", SMOOTH)

        def render(name, *how):
            return farm.render(scene, self.farm.path(name), "--pass-samples", 16, *how, "--json")

        def error(name):
            done = run("compare", self.farm.path("true.exr"), self.farm.path(name), "--json")
            return json.loads(self.expect(done, OK).stdout)["relative_mse"]

        def gain(done):
            return json.loads(done.stdout.splitlines()[-1])["frames"][0]["one_sequence_gain"]
        render("true.exr", "--samples", 2048, "--one-sequence", "--seed", 9)
        apart = render("apart.exr", "--samples", 128)
        whole = render("whole.exr", "--samples", 128, "--one-sequence")
        measured = error("apart.exr") / error("whole.exr")
        self.assertGreater(measured, 1.1)
        self.assertGreater(gain(apart), measured)
        self.assertIn("the picture is smooth", apart.stderr)
        self.assertIsNone(gain(whole))
        rough = farm.render(os.path.join(farm.ROOT, "scenes/cornell-box.pbrt"),
                            self.farm.path("rough.exr"), "--crop", "120,240,320,400",
                            "--samples", 64, "--json")
        self.assertIsNone(gain(rough))

    def test_compare(self):
        scene = self.write("compared.pbrt", SCENE)
        few, more = self.farm.path("few.exr"), self.farm.path("more.png")
        farm.render(scene, few, "--samples", 4)
        farm.render(scene, more, "--samples", 16)
        more = self.farm.path("more.exr")  # Beside the PNG.
        difference = self.farm.path("d.png")
        result = json.loads(self.expect(run("compare", more, few, "--json", "--diff", difference,
                                            "--tiles", "--reference-samples", 16), OK).stdout)
        self.assertEqual(result["tiles_beyond"], 0)
        self.assertGreater(result["relative_mse"], 0)
        self.assertGreater(result["flip"], 0)
        self.assertLess(result["flip"], 0.2)
        self.assertNotIn("hdr_flip", result)
        hdr = json.loads(self.expect(run("compare", more, few, "--json", "--hdr-flip"), OK).stdout)
        self.assertEqual(hdr["flip"], result["flip"])
        self.assertGreater(hdr["hdr_flip"], 0)
        shown = json.loads(self.expect(run("show", more, "--json"), OK).stdout)
        self.assertGreater(float(shown["metadata"]["flip"]), 0)
        self.assertNotEqual(result["image_digest"], result["reference_digest"])
        with open(difference, "rb") as f:
            self.assertEqual(f.read(8), b"\x89PNG\r\n\x1a\n")
        self.expect(run("compare", few, few, "--tolerance", 0), OK)
        self.expect(run("compare", more, few, "--tolerance", 0), FAILED)

    def test_names_of_the_page(self):
        def status(host):
            request = Request(f"http://{self.farm.http}/", headers={"Host": host})
            try:
                return urlopen(request, timeout=10).status
            except HTTPError as error:
                return error.code
        self.assertEqual(status("farm.example"), 200)
        self.assertEqual(status("other.example:80"), 200)
        self.assertEqual(status("evil.example"), 403)

    def test_a_farm_that_does_not_start_leaves_nothing_running(self):
        late = farm.Farm()
        with mock.patch.object(farm, "START_SECONDS_MAX", 0), self.assertRaises(AssertionError):
            late.__enter__()
        self.assertIsNotNone(late.coordinator.poll())
        self.assertFalse(os.path.exists(late.folder))


if __name__ == "__main__":
    unittest.main(verbosity=2)
