#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Images that the client writes, and what is left when it is interrupted or cannot write."""
import os
import re
import signal
import stat
import subprocess
import unittest

import farm
from client_case import FILE, INTERRUPTED, OK, SCENE, USAGE, ClientCase, run


def count_parts(folder):
    """Number of part files in all state folders below the folder."""
    return sum(len(names) for path, _, names in os.walk(folder) if "/parts" in path)


class OutputTest(ClientCase):
    def test_render_resumes_after_an_interruption(self):
        scene = self.write("kept.pbrt", SCENE)
        job = ("--samples", 2048, "--pass-samples", 64, "--lease-passes", 1, "--tile-size", 16,
               "--threads", 1)
        whole, kept = self.farm.path("whole.exr"), self.farm.path("kept.exr")
        done = farm.render(scene, whole, *job)
        self.assertNotIn("no worker", done.stderr)
        self.assertNotIn("uploading", done.stderr)
        self.assertIn(": 48x32, 2048 samples\n", done.stderr)
        self.assertIn(f"written to {whole}\n", done.stderr)

        command = [os.path.join(farm.programs(), "sheaf"), "render", scene, "-o", kept,
                   "--keep-state", self.farm.path("kept state"), *map(str, job)]
        first = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                 text=True)
        farm.wait_until(lambda: count_parts(self.farm.path("kept state")) > 3, 30,
                        "a few finished parts")
        first.send_signal(signal.SIGINT)
        _, text = first.communicate(timeout=30 * farm.PATIENCE)
        self.assertEqual(first.returncode, INTERRUPTED, text)
        self.assertIn("continues from here", text)
        self.assertFalse(os.path.exists(kept))
        for _ in range(2):  # Renders the rest; the second time nothing is left.
            farm.render(scene, kept, "--keep-state", self.farm.path("kept state"), *job)
            self.assertEqual(farm.image_digest(kept), farm.image_digest(whole))
            os.remove(kept)

    def interrupted_render(self, scene, output, *arguments):
        """The output of a `sheaf render` that is interrupted in the middle of its work."""
        command = [os.path.join(farm.programs(), "sheaf"), "render", scene, "-o", output,
                   "--threads", "1", *map(str, arguments)]
        folder = self.farm.path("tmp")
        os.makedirs(folder, exist_ok=True)
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True, env=dict(os.environ, TMPDIR=folder))
        farm.wait_until(lambda: count_parts(folder) > 3, 30, "a few finished parts")
        process.send_signal(signal.SIGINT)
        _, text = process.communicate(timeout=30 * farm.PATIENCE)
        self.assertEqual(process.returncode, INTERRUPTED, text)
        return text

    def test_interrupted_render_loses_nothing(self):
        """Regression: without --keep-state, Ctrl-C discarded all finished work."""
        scene, output = self.write("left.pbrt", SCENE), self.farm.path("left.exr")
        job = ("--samples", 2048, "--pass-samples", 64, "--lease-passes", 1, "--tile-size", 16)
        text = self.interrupted_render(scene, output, *job)
        folder = re.search(r"the same command with --keep-state '?([^\n']+?)'? continues", text)[1]
        self.assertRegex(text, r"interrupted at \d+\.\d %; rendered parts are kept in ")
        self.assertGreater(count_parts(folder), 3)
        whole = self.farm.path("unbroken.exr")
        done = farm.render(scene, output, *job, "--keep-state", folder)
        farm.render(scene, whole, *job)
        self.assertEqual(farm.image_digest(output), farm.image_digest(whole))
        self.assertIn("2048 samples", done.stderr)

    def test_the_first_signal_ends_commands_that_read_their_scene(self):
        """Regression: they read on, for minutes if need be, and a second signal ended them."""
        sphere = 'Shape "sphere" "float radius" 0.25\n'
        scene = self.write("large.pbrt", SCENE + sphere * 300_000)
        for command in (("render", "-o", self.farm.path("large.exr")), ("plan",),
                        ("study", "-o", self.farm.path("large.html")), ("quote", "--local")):
            with self.subTest(command=command[0]):
                process = subprocess.Popen(
                    [os.path.join(farm.programs(), "sheaf"), command[0], scene, *command[1:]],
                    stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

                def is_reading(process=process):
                    self.assertIsNone(process.poll(), "it reads for seconds")
                    with open(f"/proc/{process.pid}/io", encoding="utf-8") as file:
                        return int(re.search(r"rchar: (\d+)", file.read())[1]) > 1 << 20
                farm.wait_until(is_reading, 30, "some of the scene's bytes")
                process.send_signal(signal.SIGTERM)
                _, text = process.communicate(timeout=60 * farm.PATIENCE)
                self.assertEqual(process.returncode, INTERRUPTED, text)
                self.assertEqual(text, "sheaf: interrupted\n")

    def test_a_size_is_as_if_the_scene_stated_it(self):
        """In one process and on a farm, in pixels and as a part, also of another aspect."""
        stated = '"integer xresolution" 48 "integer yresolution" 32'
        scene, output = self.write("size.pbrt", SCENE), self.farm.path("size.exr")
        for size, width, height in (("50%", 24, 16), ("24x16", 24, 16), ("20x50", 20, 50)):
            small = self.write("small.pbrt", SCENE.replace(
                stated, f'"integer xresolution" {width} "integer yresolution" {height}'))
            expected = self.farm.path("small.exr")
            farm.render(small, expected, "--samples", 4)
            farm.render(scene, output, "--size", size, "--samples", 4)
            self.assertEqual(farm.image_digest(output), farm.image_digest(expected), size)
            self.expect(self.farm.sheaf("submit", scene, "--size", size, "--samples", 4, "--wait",
                                        "-o", output), OK)
            self.assertEqual(farm.image_digest(output), farm.image_digest(expected), size)
        for size in ("0%", "-5%", "%", "50", "1e9%", "50x", "nan%"):
            done = self.expect(run("render", scene, "-o", output, f"--size={size}"), USAGE)
            self.assertIn("as in 50%", done.stderr)

    def test_outputs_never_replace_inputs(self):
        """Regression: `-o` replaced the scene and exited with 0."""
        texture = self.farm.path("wood.png")
        farm.render(self.write("wood.pbrt", SCENE), texture, "--samples", 1)
        scene = self.write("own.pbrt", SCENE.replace("Shape", 'Texture "wood" "spectrum" '
                           '"imagemap" "string filename" "wood.png"\nMaterial "diffuse" '
                           '"texture reflectance" "wood"\nShape', 1))
        link = self.farm.path("own.exr")
        os.symlink("own.pbrt", link)
        before = {path: farm.read_bytes(path) for path in (scene, texture)}
        for output in (scene, link, texture, self.farm.path(".", "wood.png")):
            for command in ("render", "submit"):
                with self.subTest(output=output, command=command):
                    done = self.expect(self.farm.sheaf(command, scene, "--samples", 1, "-o", output,
                                                       check=False), USAGE)
                    self.assertIn(output, done.stderr)
        self.expect(run("compare", link, texture, "--diff", texture), USAGE)
        self.expect(run("render", scene, "--samples", 1, "--resume-from",
                        self.farm.path("wood.exr"), "-o", self.farm.path("wood.exr")), USAGE)
        self.assertEqual(before, {path: farm.read_bytes(path) for path in (scene, texture)})

    def test_outputs_are_regular_files_with_matching_extensions(self):
        """Regression: `-o -` made a file named -, `-o a.jpg` wrote EXR bytes, and links and devices
        were replaced.
        """
        scene = self.write("kind.pbrt", SCENE)
        kinds = "writes only .exr or .png"
        for output, words in (("-", "standard output"), ("a.jpg", kinds), ("a.tif", kinds),
                              ("a", kinds)):
            done = self.expect(run("render", scene, "--samples", 1, "-o", output), USAGE)
            self.assertIn(words, done.stderr)
            self.assertFalse(os.path.exists(output))
        self.expect(run("render", scene, "--png", "a.jpg"), USAGE)
        self.expect(run("study", scene, "-o", "a.exr"), USAGE)
        pipe = self.farm.path("pipe.exr")
        os.mkfifo(pipe)
        done = self.expect(run("render", scene, "--samples", 1, "-o", pipe), FILE)
        self.assertIn("not a regular file", done.stderr)
        self.assertTrue(stat.S_ISFIFO(os.stat(pipe).st_mode))
        link, target = self.farm.path("link.exr"), self.farm.path("target.exr")
        os.symlink("target.exr", link)
        for _ in range(2):  # A target that does not exist yet; one that does.
            self.expect(run("render", scene, "--samples", 1, "-o", link), OK)
            self.assertTrue(os.path.islink(link))
            self.assertFalse(os.path.islink(target))
        capitals = self.farm.path("capitals.PNG")
        self.expect(run("render", scene, "--samples", 1, "-o", capitals), OK)
        self.assertTrue(farm.read_bytes(capitals).startswith(b"\x89PNG"))

    def test_outputs_that_cannot_be_written_are_found_before_rendering(self):
        """Regression: a missing folder was found only after all work was done."""
        scene, output = self.write("before.pbrt", SCENE), self.farm.path("none", "a.exr")
        endless = ("--samples", 1 << 20, "-o", output)
        done = self.expect(run("render", scene, *endless), FILE)
        self.assertIn(output, done.stderr)
        jobs = self.farm.sheaf("list").stdout
        self.expect(self.farm.sheaf("submit", scene, "--wait", *endless, check=False), FILE)
        self.assertEqual(self.farm.sheaf("list").stdout, jobs, "nothing was submitted")
        name = self.farm.sheaf("submit", scene, "--samples", 1 << 24).stdout.strip()
        self.expect(self.farm.sheaf("watch", name, "-o", output, check=False), FILE)
        self.farm.sheaf("cancel", name)
        self.expect(run("study", scene, "-o", self.farm.path("none", "a.html")), FILE)
        self.expect(run("study", scene, "--json-output", self.farm.path("none", "a.json")), FILE)

    def test_unwritable_finished_image_is_kept(self):
        """The output's folder disappears before the end."""
        scene = self.write("fallback.pbrt", SCENE)
        folder, temporary = self.farm.path("leaves"), self.farm.path("fallback tmp")
        os.makedirs(folder)
        os.makedirs(temporary)
        command = [os.path.join(farm.programs(), "sheaf"), "render", scene, "--samples", "2048",
                   "--tile-size", "16", "--threads", "1", "-o", os.path.join(folder, "a.exr")]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True, env=dict(os.environ, TMPDIR=temporary))
        farm.wait_until(lambda: count_parts(temporary) > 0, 30, "a finished part")
        os.rmdir(folder)
        _, text = process.communicate(timeout=60 * farm.PATIENCE)
        self.assertEqual(process.returncode, FILE, text)
        kept = re.search(r"it is kept as (.+)", text)[1]
        self.assertTrue(kept.startswith(temporary), text)
        whole = self.farm.path("not lost.exr")
        farm.render(scene, whole, "--samples", 2048, "--tile-size", 16)
        self.assertEqual(farm.image_digest(kept), farm.image_digest(whole))

    def test_interrupted_wait_reports_how_to_fetch_the_image(self):
        scene, output = self.write("leave.pbrt", SCENE), self.farm.path("left behind.exr")
        command = [os.path.join(farm.programs(), "sheaf"), "submit", scene, "--samples",
                   str(1 << 24), "--wait", "-o", output, "--coordinator", self.farm.address,
                   "--no-quote"]
        before = len(self.farm.sheaf("list").stdout.splitlines())
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True)
        self.addCleanup(process.kill)
        farm.wait_until(lambda: len(self.farm.sheaf("list").stdout.splitlines()) > before, 30,
                        "the job")
        process.send_signal(signal.SIGINT)
        _, text = process.communicate(timeout=30 * farm.PATIENCE)
        self.assertEqual(process.returncode, INTERRUPTED, text)
        name = re.search(r"jobs/\d+", text)[0]
        self.assertIn(f"sheaf watch {name} --coordinator {self.farm.address} -o '{output}'", text)
        self.farm.sheaf("cancel", name)
        text = self.farm.sheaf("submit", scene, "--samples", 1, "-o", output).stderr
        self.assertRegex(text, r"without --wait no image is written; .* sheaf watch jobs/\d+ ")


if __name__ == "__main__":
    unittest.main(verbosity=2)
