#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The client as people and scripts use it: commands, JSON, exit codes and error messages.

One farm with one worker serves all tests. The scenes are the first frames of the turntable and a
few lines of text.
"""
import base64
import json
import os
import re
import shutil
import subprocess
import unittest
from unittest import mock
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import farm
from client_case import (BAD_SCENE, CANCELLED, FAILED, FILE, OK, SCENE, UNREACHABLE, USAGE,
                         ClientCase, run)

TURNTABLE = os.path.join(farm.ROOT, "scenes", "turntable", "turntable.####.pbrt")
SMALL = ("--crop", "120,60,200,120", "--samples", "4")

# A floor lit by an emitter outside the view.
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


class ClientTest(ClientCase):
    def test_help_is_in_plain_words(self):
        """Regression: help showed `ENUM:value in {auto->0,...}`, and the 35 flags of `render` in
        one list.
        """
        notation = ("ENUM", "->", "UINT", "INT:", "TEXT:", "FLOAT:", "[b, kb", "REQUIRED", "Env:")
        listed = self.expect(run("--help"), OK).stdout
        for command in re.findall(r"^  ([a-z]+)  ", listed, re.M):
            text = self.expect(run(command, "--help"), OK).stdout
            for words in notation:
                self.assertNotIn(words, text, command)
            self.assertLessEqual(max(map(len, text.splitlines())), 100, command)
        text = run("render", "--help").stdout
        for heading in ("Scene and samples:", "Image contents:", "Light transport:",
                        "When to stop:", "Output images:", "Division of the work:",
                        "--color auto|rgb|spectral"):
            self.assertIn(heading, text)
        for program in ("sheaf", "sheaf-worker", "sheaf-coordinator"):
            for flag, words in (("--version", program + " "), ("--help", "--log-level" if "-" in
                                                               program else "render")):
                done = subprocess.run([os.path.join(farm.programs(), program), flag], check=True,
                                      capture_output=True, text=True)
                self.assertIn(words, done.stdout)
                self.assertFalse([w for w in notation if w in done.stdout])

    def test_help_and_version_are_words_too(self):
        listed = self.expect(run("help"), OK).stdout
        self.assertEqual(listed, run("--help").stdout)
        for heading in ("Render on this machine:", "Render on a farm:", "Change jobs:"):
            self.assertIn(heading, listed)
        self.assertEqual(self.expect(run("help", "render"), OK).stdout,
                         run("render", "--help").stdout)
        self.assertEqual(self.expect(run("version"), OK).stdout, run("--version").stdout)

    def test_mistyped_words_get_suggestions(self):
        """Regression: `sheaf rendr` reported "A subcommand is required", `--sample 4` an extra
        SCENE.
        """
        scene = self.write("typed.pbrt", SCENE)
        for arguments, guess in ((["rendr"], '"render"'), (["render", "--sample", 4, scene],
                                                           '"--samples"'),
                                 (["render", scene, "--sampels=4"], '"--samples"'),
                                 (["render", scene, "--color", "spectal"], '"spectral"'),
                                 (["submit", scene, "--wiat"], '"--wait"')):
            done = self.expect(run(*arguments), USAGE)
            self.assertIn(f"did you mean {guess}?", done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1)

    def test_crops_beyond_the_image_are_noted(self):
        scene = self.write("crop.pbrt", SCENE)
        beyond = ("--crop", "0,0,9000,9000", "--samples", "1")
        for command in (["render", "-o", self.farm.path("crop.exr")], ["plan"]):
            said = self.expect(run(*command, scene, *beyond), OK)
            self.assertIn("--crop reaches beyond the image; rendered are the pixels 0,0,",
                          said.stderr)
        within = self.expect(run("plan", scene, "--crop", "0,0,2,2"), OK)
        self.assertNotIn("--crop", within.stderr)

    def test_show_has_one_scale_of_errors(self):
        scene, image = self.write("scale.pbrt", SCENE), self.farm.path("scale.exr")
        self.expect(run("render", scene, "--samples", "16", "-o", image), OK)
        text = self.expect(run("show", image), OK).stdout
        self.assertRegex(text, r"estimated error +±\S+ % \(relMSE \S+\)\n")
        self.assertRegex(text, r"samples +error +at most \(95 %\)\n +16\.0 +±\S+ % +±\S+ %")

    def test_plan_says_what_auto_will_measure(self):
        scene = self.write("auto.pbrt", SCENE)
        text = self.expect(run("plan", scene, "--techniques", "auto"), OK).stdout
        for words in ("camera+light+guiding", "+splitting", "+merging", "+sharing+views",
                      "--measure shows"):
            self.assertIn(words, text)
        self.assertNotIn("techniques: auto", self.expect(run("plan", scene), OK).stdout)
        plan = self.expect(run("plan", scene, "--techniques", "auto", "--json"), OK).stdout
        self.assertIs(json.loads(plan)["techniques_are_measured"], True)

    def test_errors_are_given_in_percent(self):
        """300 % of a pixel are a relMSE of 9."""
        scene, images = self.write("percent.pbrt", SCENE), []
        for target in ("300%", "9"):
            images.append(self.farm.path(f"target {target}.exr"))
            done = self.expect(run("render", scene, "--target-error", target, "-o", images[-1]), OK)
            self.assertRegex(done.stderr, r"sheaf: frame 1: \d+x\d+, .*\n  \d+\.\d s, error ±.*\n"
                             r"  written to " + re.escape(images[-1]))
            self.assertNotIn("samples/s", done.stderr)
        self.assertEqual(*map(farm.image_digest, images))
        wrong = self.expect(run("render", scene, "--target-error", "5%%"), USAGE)
        self.assertIn('--target-error: "5%%" is not a number', wrong.stderr)

    def test_json_flag_makes_errors_json(self):
        scene = self.write("wrong.pbrt", SCENE + "Nonsense\nMaterial 7\n")
        cases = ((["render", "--json", "--sample", 4, scene], USAGE, "--samples"),
                 (["plan", scene, "--json"], BAD_SCENE, "wrong.pbrt:8:1"),
                 (["render", self.farm.path("none.pbrt"), "--json"], FILE, "none.pbrt"),
                 (["render", scene, "--json", "-o", "a.jpg"], USAGE, "a.jpg"),
                 (["list", "--json", "--coordinator", f"127.0.0.1:{farm.free_port()}"], UNREACHABLE,
                  "sheaf-coordinator"))
        for arguments, code, words in cases:
            with self.subTest(arguments=arguments):
                done = self.expect(run(*arguments), code)
                self.assertEqual(done.stdout, "")
                error = json.loads(done.stderr)
                self.assertEqual((error["severity"], error["exit_code"]), ("error", code))
                self.assertIn(words, error["message"])
        noted = self.write("noted.pbrt", 'Sampler "halton"\n' + SCENE)
        done = self.expect(run("render", noted, "--samples", 1, "--json", "-o",
                               self.farm.path("noted.exr")), OK)
        severities = [json.loads(line)["severity"] for line in done.stderr.splitlines()]
        self.assertEqual(severities[0], "note")
        self.assertEqual(set(severities[1:]), {"info"})

    def test_own_scenes_print_no_notes(self):
        folder = os.path.join(farm.ROOT, "scenes")
        scenes = [name for name in os.listdir(folder) if name.endswith(".pbrt")]
        self.assertIn("cornell-box.pbrt", scenes)
        for name in scenes:
            self.assertNotIn("sampler", run("plan", os.path.join(folder, name)).stderr, name)

    def test_corrupt_images_are_found_before_upload(self):
        """Regression: only a worker found them, and named them by their path in its cache."""
        texture = self.farm.path("corrupt.png")
        farm.render(self.write("corrupt_maker.pbrt", SCENE), texture, "--samples", 1)
        whole = farm.read_bytes(texture)
        text = SCENE + ('Texture "wood" "spectrum" "imagemap" "string filename" "corrupt.png"\n'
                        'Material "diffuse" "texture reflectance" "wood"\nShape "sphere"\n')
        scene, line = self.write("corrupt.pbrt", text), text[:text.index("Texture")].count("\n") + 1
        place = rf"corrupt\.pbrt:{line}"
        for data in (whole[:len(whole) // 2], b"no image", b""):
            with open(texture, "wb") as f:
                f.write(data)
            for command in ("render", "submit"):
                jobs = self.farm.sheaf("list").stdout
                done = self.farm.sheaf(command, scene, "--samples", 1, check=False)
                self.assertRegex(self.expect(done, BAD_SCENE).stderr,
                                 place + r':1: texture "wood": corrupt\.png: ')
                self.assertEqual(self.farm.sheaf("list").stdout, jobs)
        # Only the headers of large images are checked; the worker finds other damage.
        large = SCENE.replace("48", "1200").replace("32", "1000")
        farm.render(self.write("large.pbrt", large), texture, "--samples", 1)
        whole = farm.read_bytes(texture)
        with open(texture, "wb") as f:
            f.write(whole[:len(whole) // 2])
        done = self.farm.sheaf("submit", scene, "--samples", 1, "--wait", "-o",
                               self.farm.path("corrupt.exr"), check=False)
        self.assertRegex(self.expect(done, FAILED).stderr,
                         place + r':1: texture "wood": corrupt\.png: ')
        self.assertNotIn(self.farm.path("cache"), done.stderr)

    def test_help_is_text(self):
        for command in ("render", "submit", "quote", "refine", "plan"):
            text = self.farm.sheaf(command, "--help").stdout
            self.assertTrue(all(c.isprintable() or c == "\n" for c in text), command)

    def test_frames_of_a_pattern(self):
        os.makedirs(self.farm.path("out"), exist_ok=True)
        done = self.farm.sheaf("submit", TURNTABLE, "--frames", "1-3", *SMALL, "--wait", "--json",
                               "--verbose", "-o", self.farm.path("out", "t.####.exr"))
        job = [json.loads(line) for line in done.stdout.splitlines()][-1]
        self.assertEqual(job["state"], "succeeded")
        self.assertIsNotNone(job["end_time"])
        digests = [frame["image_digest"] for frame in job["frames"]]
        self.assertEqual(len(set(digests)), 3, "each frame is another image")
        for number, digest in enumerate(digests, start=1):
            path = self.farm.path("out", f"t.{number:04d}.exr")
            self.assertEqual(farm.image_digest(path), digest)
            # "frame 1: 80x60, 4 samples\n  0.3 s, 60 k samples/s, 200 k rays/s, error ±14 % ..."
            self.assertRegex(done.stderr, rf"frame {number}: 80x60, 4 samples\\n  \d+\.\d s, "
                             r"\S+ \w?\s?samples/s, \S+ \w?\s?rays/s, error ±\S+ % \(relMSE \S+\), "
                             r"FLIP \S+\\n  written to " + re.escape(path))
        self.assertRegex(done.stderr, r"\"message\":\"jobs/\d+: 3 frames, \d+\.\d s")

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
        self.check_list(name, listed)

        again = self.farm.path("out", "again.#.exr")
        self.farm.sheaf("watch", name, "-o", again)
        self.assertEqual(farm.image_digest(self.farm.path("out", "again.2.exr")), digests[1])
        self.expect(self.farm.sheaf("watch", name, "-o", "one.exr", check=False), USAGE)

    def check_list(self, name, listed):
        """The list says what it leaves out, and its options choose what it shows."""
        scene = self.write("listed.pbrt", SCENE)
        self.farm.sheaf("submit", scene, "--samples", 1, "--pool", "none")
        done = self.farm.sheaf("list", "--limit", 1)
        self.assertEqual(done.stdout.count("jobs/"), 1, done.stdout)
        self.assertIn("there are older jobs than these 1", done.stderr)
        whole = self.farm.sheaf("list", "--limit", len(listed) + 1)
        self.assertEqual(whole.stdout.count("jobs/"), len(listed) + 1)
        self.assertNotIn("older jobs", whole.stderr)
        self.assertNotIn(name, self.farm.sheaf("list", "--state", "queued").stdout)
        self.assertIn(name, self.farm.sheaf("list", "--state", "succeeded").stdout)
        self.assertNotIn("jobs/", self.farm.sheaf("list", "--user", "nobody-of-this-name").stdout)

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

    def test_images_in_the_terminal(self):
        scene, exr = self.write("shown.pbrt", SCENE), self.farm.path("shown.exr")
        self.farm.sheaf("submit", scene, "--samples", 4, "--wait", "-o", exr)
        job = json.loads(self.farm.sheaf("list", "--json", "--limit", 1).stdout)["name"]
        half_block = "\u2580"
        for target, command in ((job, self.farm.sheaf), (exr, run)):
            self.assertNotIn("\x1b", command("show", target).stdout, "no terminal")
            text = command("show", target, "--image").stdout
            self.assertEqual(text.count(half_block), 48 * 32 / 2)
            self.assertIn("\x1b[38;2;", text)
            self.assertIn("\x1b[38;5;", command("show", target, "--image=blocks256").stdout)
            kitty = command("show", target, "--image=kitty").stdout
            payload = "".join(re.findall(r"\x1b_G[^;]*;([^\x1b]*)\x1b", kitty))
            self.assertTrue(base64.b64decode(payload).startswith(b"\x89PNG"))
            samples = command("show", target, "--image", "--layer", "samples").stdout
            self.assertIn("samples per pixel: dark blue 4, yellow 4", samples)
            self.assertIn("relative error: ",
                          command("show", target, "--image", "--layer", "error").stdout)
        self.expect(run("show", exr, "--image=sixel"), USAGE)
        self.expect(run("show", exr, "--image", "--view", "Filmic"), USAGE)
        self.expect(run("show", self.farm.path("none.exr")), FILE)
        self.assertEqual(json.loads(run("show", exr, "--json").stdout)["width_px"], 48)
        narrow = run("show", exr, "--image", environment={"COLUMNS": "20"}).stdout
        self.assertEqual(narrow.count(half_block), 20 * 7, "20 x 13 pixels")

    def test_workers(self):
        worker = json.loads(self.farm.sheaf("workers", "--json").stdout)
        self.assertEqual(worker["thread_count"], 1)
        self.assertIn(worker["state"], ("idle", "busy"))
        self.assertIn(worker["name"].removeprefix("workers/"), self.farm.sheaf("workers").stdout)

    def test_logs_and_delete(self):
        """The log has the events in order; then nothing is left of the job."""
        scene = self.farm.path("a room.pbrt")
        shutil.copy(os.path.join(farm.ROOT, "scenes", "cornell-box.pbrt"), scene)
        self.farm.sheaf("submit", scene, *SMALL, "--wait", "--denoise-with", "cp secret",
                        "-o", self.farm.path("logged.exr"), check=False)
        name = json.loads(self.farm.sheaf("list", "--json", "--limit", "1").stdout)["name"]
        job = json.loads(self.farm.sheaf("show", name, "--json").stdout)
        self.assertRegex(job["command"], r"^sheaf submit '.*/a room\.pbrt' ")
        self.assertNotIn("secret", job["command"])
        self.assertIn("command    sheaf submit", self.farm.sheaf("show", name).stdout)
        followed = self.farm.sheaf("logs", name, "--follow", "--json").stdout.splitlines()
        events = [json.loads(line) for line in followed]
        self.assertEqual([event["what"] for event in events],
                         ["submit", "started", "delivered", "succeeded"])
        self.assertEqual([event["frame_number"] for event in events], [None, 1, 1, None])
        self.assertRegex(events[1]["who"], "^workers/")
        self.assertRegex(events[2]["text"], r"^error \S+ %, \S+ s of CPU time, image [0-9a-f]{12}$")
        text = self.farm.sheaf("logs", name, "1").stdout
        self.assertRegex(text.splitlines()[1],
                         r"^\d{4}-\d\d-\d\d \S+  started    frame 1, workers/")
        running = self.farm.sheaf("submit", scene, "--samples", "65536",
                                  "--no-quote").stdout.strip()
        refused = self.farm.sheaf("delete", running, name, check=False)
        self.assertEqual((refused.returncode, refused.stdout), (1, f"{name} deleted\n"))
        self.assertIn("has not ended; cancel it first", refused.stderr)
        self.assertEqual(self.farm.sheaf("delete", running, "--cancel").stdout,
                         f"{running} deleted\n")
        for gone in (name, running):
            self.assertEqual(self.farm.sheaf("logs", gone, check=False).returncode, 1)

    def test_cancel(self):
        scene = self.write("long.pbrt", SCENE)
        name = self.farm.sheaf("submit", scene, "--samples", 1 << 24).stdout.strip()
        self.assertRegex(name, r"^jobs/\d+$")
        self.assertIn("cancelled", self.farm.sheaf("cancel", name).stdout)
        self.assertIn("was cancelled",
                      self.expect(self.farm.sheaf("watch", name, check=False), CANCELLED).stderr)
        job = json.loads(self.farm.sheaf("cancel", name, "--json").stdout)  # Again: no effect.
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
        again = json.loads(sheaf("pause", name, "--json").stdout)  # No effect.
        self.assertEqual(again["state"], "paused")
        self.assertIn("is paused", sheaf("refine", name, "--samples", 8, check=False).stderr)
        # Other jobs run first, and the job stays paused.
        sheaf("submit", scene, "--samples", 4, "--wait", "-o", self.farm.path("other.exr"))
        self.assertEqual(json.loads(sheaf("show", name, "--json").stdout)["state"], "paused")
        self.assertEqual(sheaf("priority", name, "-5").stdout, f"{name} priority -5\n")
        self.assertEqual(json.loads(sheaf("priority", name, 7, "--json").stdout)["priority"], 7)
        self.expect(sheaf("priority", name, 1001, check=False), USAGE)
        self.assertRegex(sheaf("resume", name).stdout, f"^{name} (queued|running)\n$")
        sheaf("pause", name)
        self.assertEqual(sheaf("cancel", name).stdout, f"{name} cancelled\n")
        for command in (("pause",), ("resume",), ("priority", 3)):
            done = self.expect(sheaf(command[0], name, *command[1:], check=False), FAILED)
            self.assertIn(f"{name} was cancelled", done.stderr)
            self.assertEqual(done.stdout, "")
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

    def test_no_coordinator_answers(self):
        address = f"127.0.0.1:{farm.free_port()}"
        done = self.expect(run("list", "--coordinator", address), UNREACHABLE)
        self.assertRegex(done.stderr, f"^sheaf: no coordinator answers at {address}: the "
                         r"connection was refused \(gave up after \d+ attempts\); start one with "
                         "sheaf-coordinator, or name another with --coordinator HOST:PORT\n$")

    def test_a_submission_outlasts_a_restart_of_the_coordinator(self):
        """Regression: it gave up after 4 s."""
        with farm.Farm() as own, open(own.path("told"), "w", encoding="utf-8") as told:
            own.kill(own.coordinator)
            process = subprocess.Popen(
                [os.path.join(farm.programs(), "sheaf"), "submit", self.write("late.pbrt", SCENE),
                 "--no-quote", "--coordinator", own.address],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=told, text=True)

            def is_waiting():
                with open(told.name, encoding="utf-8") as text:
                    return "does not answer; trying again for up to 1m" in text.read()
            farm.wait_until(is_waiting, 30, "the client's words")
            own.start_coordinator()
            text, _ = process.communicate(timeout=90 * farm.PATIENCE)
            self.assertEqual((process.returncode, text), (OK, "jobs/1\n"))

    def test_missing_files(self):
        for command in ("render", "submit", "plan"):
            with self.subTest(command=command):
                done = self.expect(run(command, self.farm.path("none.pbrt")), FILE)
                self.assertIn("none.pbrt", done.stderr)
        self.expect(run("compare", self.farm.path("none.exr"), self.farm.path("none.exr")), FILE)
        scene = self.write("unwritable.pbrt", SCENE)
        self.expect(run("render", scene, "--samples", 1, "-o", "/proc/none/out.exr"), FILE)

    def test_files_outside_of_the_scene_folder_are_listed_or_refused(self):
        """Regression: what a scene of others names was uploaded without a word."""
        os.makedirs(self.farm.path("inner"), exist_ok=True)
        shutil.copy(os.path.join(farm.ROOT, "scenes", "lenses", "double-gauss-50mm.dat"),
                    self.farm.path("lens.dat"))
        scene = self.write("inner/outside.pbrt", SCENE.replace(
            'Camera "perspective" "float fov" 45',
            'Camera "realistic" "string lensfile" "../lens.dat" "float focusdistance" 3'))
        said = "1 file outside of the scene's folder is uploaded: ../lens.dat"
        submit = ("submit", "--coordinator", self.farm.address, "--no-quote", "--samples", 1)
        done = self.expect(run(*submit, scene), OK)
        self.assertIn("sheaf: note: " + said + "\n", done.stderr)
        notes = [json.loads(line) for line in
                 self.expect(run(*submit, "--json", scene), OK).stderr.splitlines()]
        self.assertIn({"severity": "note", "message": said}, notes)
        self.assertNotIn("outside of", self.expect(run(
            *submit, self.write("inside.pbrt", SCENE)), OK).stderr)
        self.write("secret", "0" * 36)
        os.symlink(self.farm.path("secret"), self.farm.path("inner/link.bin"))
        model = self.write("inner/outside.gltf", json.dumps({
            "asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "link.bin"}]}))
        self.assertIn('outside.gltf: file "link.bin" leads outside of the scene\'s folder',
                      self.expect(run(*submit, model), BAD_SCENE).stderr)

    def test_broken_scenes_report_locations(self):
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

    def test_mistakes_that_compiling_shows_are_said_once_before_a_job_is_made(self):
        """Regression: `submit` made a job that failed, `render` said why three times."""
        line = SCENE.count("\n") + 1
        twisted = ('AreaLightSource "diffuse"\nShape "bilinearmesh" '
                   '"point3 P" [-1 -1 0  1 -1 .5  -1 1 .5  1 1 0]\n')
        bright = 'LightSource "point" "rgb I" [1e30 1 1] "float scale" 1e30\n'
        jobs = self.farm.sheaf("list").stdout
        for text, place in ((twisted, line + 1), (bright, line)):
            scene = self.write("late.pbrt", SCENE + text)
            for command in (("render",), ("submit",), ("submit", "--no-quote"), ("plan",)):
                with self.subTest(text=text, command=command):
                    done = self.farm.sheaf(*command, scene, check=False, seconds=30)
                    said = self.expect(done, BAD_SCENE).stderr
                    self.assertRegex(said, rf"^sheaf: late\.pbrt:{place}:1: [^\n]*\n$")
        self.assertEqual(self.farm.sheaf("list").stdout, jobs)

    def test_failures_of_rendering_are_said_once(self):
        """Only rendering reads a displacement."""
        scene = self.write("steep.pbrt", SCENE + 'Texture "far" "float" "scale" "float tex" 1e30 '
                           '"float scale" 1e30\nShape "trianglemesh" "integer indices" [0 1 2] '
                           '"point3 P" [0 0 0  1 0 0  0 1 0] "texture displacement" "far"\n')
        done = run("render", scene, "--samples", 1, "-o", self.farm.path("steep.exr"))
        said = self.expect(done, FAILED).stderr
        self.assertEqual(said.count("steep.pbrt:"), 1, said)

    def test_foreign_files_send_no_raw_bytes_to_the_terminal(self):
        """Regression: a .blend file's escape sequences were printed, and no message named its
        format.
        """
        foreign = (("room.blend", b"BLENDER-v305\x1b]0;owned\x07\x00REND", "Blender"),
                   ("packed.blend", b"\x28\xb5\x2f\xfd\x00\x1b[2J", "Blender"),
                   ("room.xml", b'<scene version="3.0.0">', "Mitsuba"),
                   ("room.abc", b"Ogawa\xff", "Alembic"), ("room", b"PXR-USDC\x00", "USD"),
                   ("noise", bytes(range(256)), "binary"))
        for name, data, word in foreign:
            path = self.farm.path(name)
            with open(path, "wb") as f:
                f.write(data)
            for command in ("render", "submit", "plan", "study"):
                with self.subTest(name=name, command=command):
                    done = self.expect(self.farm.sheaf(command, path, check=False), BAD_SCENE)
                    self.assertIn(word, done.stderr)
                    self.assertIn("not a pbrt-v4 or glTF scene", done.stderr)
                    self.assertTrue(all(c.isprintable() or c == "\n" for c in done.stderr))

    def test_scene_messages_are_printable(self):
        words = ("\x1b[31mRed", '"string \x1b]0;title\x07" 1', '"\x9b"', "\x07" * 5000)
        for word in words:
            scene = self.farm.path("escapes.pbrt")
            with open(scene, "w", encoding="latin-1") as f:
                f.write(SCENE + f'Shape "sphere" {word}\nMaterial {word}\n{word}\n')
            done = self.expect(run("plan", scene), BAD_SCENE)
            self.assertTrue(all(c.isprintable() or c == "\n" for c in done.stderr), done.stderr)
            self.assertLess(max(map(len, done.stderr.splitlines())), 9000)
        named = self.write("named.pbrt", SCENE + 'MakeNamedMedium "\x1b[31mmilk" "string type" '
                           '"homogeneous"\nMediumInterface "\x1b[31mmilk" ""\nShape "sphere"\n')
        self.assertNotIn("\x1b", self.expect(run("plan", named), OK).stdout)
        self.farm.sheaf("submit", self.write("titled.pbrt", SCENE), "--samples", 1, "--title",
                        "a\nforged line\x1b[31m", check=False)
        for listed in (self.farm.sheaf("list", "--limit", 1).stdout, self.farm.log("coordinator")):
            self.assertNotIn("\x1b[31m", listed)
            self.assertNotIn("\nforged", listed)

    def test_plan(self):
        plan = json.loads(self.expect(run("plan", "--json", TURNTABLE.replace("####", "0001")),
                                      OK).stdout)
        self.assertTrue(plan["variant"])
        self.assertTrue(plan["effects"])

    def test_plan_reports_bias(self):
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

    def test_techniques_are_shown(self):
        bdpt = self.write("bdpt.pbrt", 'Integrator "bdpt" "bool visualizeweights" true\n' + SCENE)
        plain = self.write("plain.pbrt", SCENE)
        noted = "bdpt.pbrt:1:1: "
        for scene, flags, techniques, cause in (
                (plain, (), "camera", None), (bdpt, (), "camera+light", noted),
                (plain, ("--techniques", "light"), "light", "requested"),
                (bdpt, ("--techniques", "light"), "light", "requested"),
                (plain, ("--techniques", "camera+guiding"), "camera+guiding", "requested"),
                (bdpt, ("--techniques", "camera"), "camera", None)):
            with self.subTest(scene=os.path.basename(scene), flags=flags):
                done = self.expect(run("plan", "--json", scene, *flags), OK)
                plan = json.loads(done.stdout)
                self.assertEqual(plan["techniques"], techniques)
                notes = [note for note in plan["notes"] if note.startswith("techniques: ")]
                self.assertEqual(len(notes), 0 if cause is None else 1)
                guiding = [note for note in plan["notes"] if note.startswith("guiding: ")]
                self.assertEqual(len(guiding), 1 if "guiding" in techniques else 0)
                text = self.expect(run("plan", scene, *flags), OK).stdout
                if cause:
                    self.assertIn(f"techniques: {techniques}, {cause}", text)
                else:
                    self.assertNotIn("techniques", text)
                self.assertEqual(noted in done.stderr, scene == bdpt)
                path = self.farm.path("techniques.exr")
                done = farm.render(scene, path, "--samples", 1, "--json", *flags)
                frame = json.loads(done.stdout.splitlines()[-1])["frames"][0]
                self.assertEqual(frame["techniques"], techniques)
                metadata = json.loads(farm.local("show", path, "--json"))["metadata"]
                self.assertEqual(metadata.get("techniques", "camera"), techniques)
        self.assertIn("camera, camera+light, light, camera+guiding, camera+light+guiding",
                      self.expect(run("plan", plain, "--techniques", "lights"), USAGE).stderr)

    def test_light_paths_are_refused_where_they_are_unknown(self):
        bdpt = self.write("bdpt.pbrt", 'Integrator "bdpt"\n' + SCENE)
        plain = self.write("plain.pbrt", SCENE)
        light = ("--techniques", "camera+light")
        for what, command, *flags in (
                ("measurements of effects", "plan", "--measure"),
                ("measurements of effects", "submit", "--measure", 1)):
            for scene, techniques in ((bdpt, ()), (plain, light)):
                with self.subTest(command=command, scene=os.path.basename(scene)):
                    done = self.expect(run(command, scene, *flags, *techniques), USAGE)
                    self.assertIn(f"{what} know paths from the camera alone, not the techniques "
                                  "camera+light; give --techniques camera", done.stderr)
        for techniques in ("camera", "camera+guiding"):
            done = self.expect(run("plan", bdpt, "--measure", "--measure-seconds", 0.1,
                                   "--techniques", techniques), OK)
            self.assertIn("us per sample", done.stdout)
        self.expect(run("quote", bdpt, "--local"), OK)

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

    def test_completion_knows_choices_and_jobs(self):
        """Regression: it completed only the names of options."""
        path = self.write("completion.bash", run("completion", "bash").stdout)
        job = self.farm.sheaf("submit", self.write("tab.pbrt", SCENE), "--samples", 1,
                              "--wait", "--json", "-o", self.farm.path("tab.exr")).stdout
        name = json.loads(job.splitlines()[-1])["name"]

        def complete(*words):
            script = (f"source '{path}'; COMP_WORDS=(sheaf {' '.join(words)}); "
                      f"COMP_CWORD={len(words)}; _sheaf; echo ${{COMPREPLY[@]}}")
            done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, env=dict(
                os.environ, SHEAF_COORDINATOR=self.farm.address,
                PATH=farm.programs() + ":" + os.environ["PATH"]), check=True)
            return done.stdout.split()
        self.assertEqual(complete("render", "--color", "s"), ["spectral"])
        self.assertEqual(complete("study", "--techniques", "l"), ["light"])
        self.assertEqual(complete("show", "--layer", '""'),
                         ["image", "error", "samples", "denoised", "denoisedError",
                          "denoised_external"])
        self.assertIn("acescg", complete("submit", "--primaries", "a"))
        listed = complete("render", "--aov", '""')
        self.assertEqual(complete("render", "--aov", "uv,mot"), ["uv,motion"])
        self.assertEqual(complete("render", "--cryptomatte", "a"), ["asset"])
        scene = self.write("listed.pbrt", SCENE)
        self.expect(run("plan", scene, "--aov", ",".join(listed)), OK)
        wrong = self.expect(run("plan", scene, "--aov", "none"), USAGE).stderr
        self.assertEqual([word for word in listed if word not in wrong], [])
        self.assertIn(name, complete("watch", '""'))
        self.assertIn(name, complete("cancel", "jobs/"))

    def test_unreliable_tiles_and_their_cause(self):
        """The room's glass ball casts a caustic on the floor that few samples reach."""
        scene = os.path.join(farm.ROOT, "scenes/cornell-box.pbrt")
        size = ("--crop", "120,240,320,400", "--samples", 16)
        plain = farm.render(scene, self.farm.path("plain.exr"), *size, "--verbose")
        self.assertIn("--light-paths or sheaf study identify the light responsible", plain.stderr)
        done = farm.render(scene, self.farm.path("paths.exr"), *size, "--light-paths", "--json")
        self.assertRegex(done.stderr, r"main cause: .*caustic \([0-9]+ tiles?\)")
        frame = json.loads(done.stdout.splitlines()[-1])["frames"][0]
        tiles = [layer["tile_count"] for layer in frame["unreliable_layers"]]
        self.assertEqual(sum(tiles), frame["unreliable_tile_count"])
        self.assertEqual(tiles, sorted(tiles, reverse=True))

    def test_smooth_images_report_the_gain_of_one_sequence(self):
        """The forecast gain is real, and at most what continued convergence would give. The room
        with the glass ball has no gain.
        """
        scene = self.write("smooth.pbrt", SMOOTH)

        def render(name, *how):
            return farm.render(scene, self.farm.path(name), "--pass-samples", 16, *how, "--json")

        def error(name):
            done = run("compare", self.farm.path("true.exr"), self.farm.path(name), "--json")
            return json.loads(self.expect(done, OK).stdout)["relative_mse"]

        def gain(done):
            return json.loads(done.stdout.splitlines()[-1])["frames"][0]["one_sequence_gain"]
        render("true.exr", "--samples", 2048, "--one-sequence", "--seed", 9)
        # Passes short enough that its error curve has intermediate points.
        apart = render("apart.exr", "--samples", 512, "--verbose")
        whole = render("whole.exr", "--samples", 512, "--one-sequence")
        measured = error("apart.exr") / error("whole.exr")
        self.assertGreater(measured, 1.1)
        self.assertGreater(gain(apart), measured)
        self.assertIn("the image is smooth", apart.stderr)
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
        more = self.farm.path("more.exr")  # The EXR beside the PNG.
        difference = self.farm.path("d.png")
        result = json.loads(self.expect(run("compare", more, few, "--json", "--diff", difference,
                                            "--tiles", "--reference-samples", 16), OK).stdout)
        self.assertEqual(result["tiles_deviating"], 0)
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
        self.expect(run("compare", more, few, "--tolerance", "300%"), OK)
        self.expect(run("compare", more, few, "--tolerance", "0.01%"), FAILED)

    def test_names_of_the_page(self):
        def status(host):
            request = Request(f"http://{self.farm.http}/", headers={"Host": host})
            try:
                return urlopen(request, timeout=10 * farm.PATIENCE).status
            except HTTPError as error:
                return error.code
        self.assertEqual(status("farm.example"), 200)
        self.assertEqual(status("other.example:80"), 200)
        self.assertEqual(status("evil.example"), 403)

    def test_failed_farm_start_leaves_nothing_running(self):
        late = farm.Farm()
        with mock.patch.object(farm, "START_SECONDS_MAX", 0), self.assertRaises(AssertionError):
            late.__enter__()
        self.assertIsNotNone(late.coordinator.poll())
        self.assertFalse(os.path.exists(late.folder))


if __name__ == "__main__":
    unittest.main(verbosity=2)
