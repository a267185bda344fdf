#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Files and folders by any name: each command reads and writes the right file, or refuses in one
line. Beside each there are files that a name means if it is taken for a pattern.
"""
import concurrent.futures
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import OpenImageIO

import farm
from client_case import BAD_SCENE, OK, SCENE, USAGE, ClientCase
from package_build import build_package

# Name -> what it means where it is taken for a pattern of frame 1.
NAMES = {"take#2": "take12", "a#7.####": "a#7.0001", "100%d%04d": "10011", "why?*[x]=1": "whyy",
         " it's \"q\" ": " its q ", "line\nend": "line", "-dash": "dash",
         "back\\slash $HOME;x": "backslash", "~": "home", "<UDIM>": "1001"}
NAMES_AT_ONCE = 4  # Their programs mostly wait for a job.
TEXTURE = 'Texture "t" "spectrum" "imagemap" "string filename" "{}"\n'
SMALL = SCENE.replace("48", "8").replace("32", "4").replace(
    "Shape", 'Material "diffuse" "texture reflectance" "t"\nShape')


def setUpModule():
    global sheaf
    sys.path.insert(0, build_package())
    import sheaf


class NamesTest(ClientCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.images = {}
        for kind, level in (("right", "0.9"), ("wrong", "0.1")):
            cls.images[kind] = cls.farm.path(kind + ".png")
            light = cls.write(cls, kind + "_maker.pbrt", SCENE.replace("0.5 0.6", level + " 0.6"))
            farm.render(light, cls.images[kind], "--samples", 1)
        scene = cls.write(cls, "plain.pbrt", SMALL.replace("WorldBegin\n", "WorldBegin\n"
                                                           + TEXTURE.format("right.png")))
        plain = cls.farm.path("plain.exr")
        farm.render(scene, plain, "--samples", 1)
        cls.expected = cls.pixels_of(plain)
        # A refused name makes no job; "JOB" stands for this one.
        done = cls.farm.sheaf("submit", scene, "--samples", 1, "--wait", "--title", "t", "-o",
                              cls.farm.path("submitted.exr"))
        cls.job = cls.job_of(done)

    @classmethod
    def pixels_of(cls, path):
        """All channels, and their names. OpenImageIO takes names for patterns, so it reads a copy
        of a plain name.
        """
        with tempfile.TemporaryDirectory() as folder:
            copy = os.path.join(folder, "copy.exr")
            shutil.copy(path, copy)
            image = OpenImageIO.ImageInput.open(copy)
            pixels = image.read_image(OpenImageIO.FLOAT).tobytes()
            names = image.spec().channelnames
            image.close()
        return names, hashlib.sha256(pixels).hexdigest()

    def lay_out(self, base, name, kind):
        folder = os.path.join(base, name)
        os.makedirs(folder, exist_ok=True)
        # Texts of scenes cannot hold line ends.
        texture = "texture" if "\n" in name else name
        shutil.copy(self.images[kind], os.path.join(folder, texture + ".png"))
        quoted = texture.replace("\\", "\\\\").replace('"', '\\"')
        with open(os.path.join(folder, name + ".pbrt"), "w", encoding="utf-8") as file:
            file.write(SMALL.replace("WorldBegin\n",
                                     "WorldBegin\n" + TEXTURE.format(quoted + ".png")))

    def sheaf(self, base, *arguments):
        environment = dict(self.farm.environment, SHEAF_COORDINATOR=self.farm.address,
                           SHEAF_NO_QUOTE="1")
        return subprocess.run([os.path.join(farm.programs(), "sheaf"), *map(str, arguments)],
                              cwd=base, env=environment, stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, check=False,
                              timeout=60 * farm.PATIENCE)

    def steps(self, path):
        """Commands with the files that they write."""
        job = ("--samples", 1)
        yield ("plan", path + ".pbrt"), ()
        yield (("render", path + ".pbrt", *job, "-o", path + ".exr", "--png", path + "_v.png"),
               (path + ".exr", path + "_v.png"))
        yield (("submit", path + ".pbrt", *job, "--wait", "-o", path + "_s.exr", "--title", "t"),
               (path + "_s.exr",))
        yield ("watch", "JOB", "-o", path + "_w.exr", "--png", path + "_w.png"), (path + "_w.exr",
                                                                                  path + "_w.png")
        yield ("refine", "JOB", "--samples", 1, "--wait", "-o", path + "_r.exr"), (path + "_r.exr",)
        yield ("show", path + ".exr"), ()
        yield ("compare", path + ".exr", path + "_s.exr", "--diff", path + "_d.exr"), (
            path + "_d.exr",)

    def test_each_command_takes_names_as_they_are(self):
        with concurrent.futures.ThreadPoolExecutor(NAMES_AT_ONCE) as pool:
            checked = [(name, pool.submit(self.check_name, name, decoy))
                       for name, decoy in NAMES.items()]
            for name, check in checked:
                with self.subTest(name=name):
                    check.result()

    def check_name(self, name, decoy):
        base = self.farm.path("names", str(list(NAMES).index(name)))
        self.lay_out(base, name, "right")
        for folder, file in ((decoy, name), (name, decoy), (decoy, decoy)):
            self.lay_out(base, folder, "wrong")
            if file != folder:
                os.rename(os.path.join(base, folder, folder + ".pbrt"),
                          os.path.join(base, folder, file + ".pbrt"))
        self.lay_out(base, name, "right")
        for path in (os.path.join(name, name), os.path.join(base, name, name)):
            self.check_steps(base, name, path)

    def check_steps(self, base, name, path):
        job = self.job
        for arguments, outputs in self.steps(path):
            try:
                before = self.tree(base)
                done = self.sheaf(base, *(job if a == "JOB" else a for a in arguments))
                if arguments[0] == "submit":
                    job = self.job_of(done) or job
                if str(arguments[1]).startswith("-"):  # As any program reads it.
                    self.expect(done, USAGE)
                    self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                    if arguments[0] in ("plan", "render"):
                        self.assertIn("write the file's name as ./-dash", done.stderr)
                    self.assertEqual(self.tree(base), before)
                    continue
                if "####" in name and outputs and arguments[0] not in ("compare",):
                    job = self.check_long_run(base, done, before, path, outputs, arguments) or job
                    continue
                if arguments[0] in ("show", "compare") and "####" in name:
                    continue
                self.expect(done, OK)
                made = {os.path.relpath(os.path.join(base, output), base) for output in outputs}
                self.assertEqual(self.tree(base) - before, made - before)
                for output in outputs:
                    if output.endswith(".exr") and arguments[0] != "compare":
                        self.assertEqual(self.pixels_of(os.path.join(base, output)), self.expected)
            except AssertionError as error:
                raise AssertionError(f"{arguments[0]} {path}: {error}") from error

    def check_long_run(self, base, done, before, path, outputs, arguments):
        """Where no frames are asked for, #### is refused; watch cannot know. Returns its job."""
        if arguments[0] in ("render", "submit"):
            self.expect(done, USAGE)
            self.assertIn("--frames", done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertEqual(self.tree(base), before)
            # By another name of the image the scene is the right one.
            image = os.path.join(base, "image.exr")
            made = self.sheaf(base, arguments[0], path + ".pbrt", "--samples", 1, "-o", image,
                              *(("--wait", "--title", "t") if arguments[0] == "submit" else ()))
            self.expect(made, OK)
            self.assertEqual(self.pixels_of(image), self.expected)
            os.remove(image)
            return self.job_of(made)
        self.expect(done, OK)
        for output in outputs:
            folder, file = os.path.split(os.path.join(base, output))
            self.assertTrue(os.path.exists(os.path.join(folder, file.replace("####", "0001"))))
        return None

    @staticmethod
    def tree(base):
        return {os.path.relpath(os.path.join(folder, name), base)
                for folder, _, names in os.walk(base) for name in names}

    @staticmethod
    def job_of(done):
        """None: it has made none."""
        named = re.search(r"^(jobs/\d+):", done.stdout + done.stderr, re.M)
        return named and named[1]

    def test_names_that_are_not_utf8_are_refused_by_name(self):
        folder = self.farm.path("latin")
        os.makedirs(folder)
        scene = os.fsencode(folder) + b"/sc\xe9ne.pbrt"
        with open(scene, "w", encoding="utf-8") as file:
            file.write(SCENE)
        for command in ("render", "submit"):
            done = self.sheaf(folder, command, os.fsdecode(scene), "--samples", "1")
            self.assertEqual(done.returncode, BAD_SCENE, done.stderr)
            self.assertIn("sc\\xe9ne.pbrt: the name is not UTF-8", done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)

    def test_outputs_may_have_the_longest_names(self):
        folder = self.farm.path("long")
        os.makedirs(folder)
        scene = self.write("long/scene.pbrt", SCENE)
        for size in (244, 255):
            name = "n" * (size - 4) + ".exr"
            done = self.sheaf(folder, "render", scene, "--samples", "1", "-o", name)
            self.assertEqual(done.returncode, OK, done.stderr)
            self.assertIn(name, os.listdir(folder))

    def test_a_study_takes_names_as_they_are(self):
        base, name = self.farm.path("study"), "s#1 <UDIM> %d?*'\""
        self.lay_out(base, name, "right")
        path = os.path.join(name, name)
        self.expect(self.sheaf(base, "study", path + ".pbrt", "--minutes", 0.2, "-o",
                               path + ".html", "--json-output", path + ".json"), OK)
        self.assertTrue(os.path.exists(os.path.join(base, path + ".html")))
        self.assertTrue(os.path.exists(os.path.join(base, path + ".json")))

    def test_python_takes_names_as_they_are(self):
        with sheaf.connect(self.farm.address, programs=farm.programs()) as client:
            for name, decoy in NAMES.items():
                with self.subTest(name=name):
                    base = self.farm.path("python", str(list(NAMES).index(name)))
                    self.lay_out(base, decoy, "wrong")
                    self.lay_out(base, name, "right")
                    path = os.path.join(base, name, name)
                    job = client.wait(client.submit(path + ".pbrt", samples=1, title="t"),
                                      images=path + "_w.exr")
                    client.download(job, path + ".exr")
                    written = path.replace(name, name.replace("####", "0001")) + "_w.exr"
                    for image in (path + ".exr", os.path.join(base, name,
                                                              os.path.basename(written))):
                        self.assertEqual(self.pixels_of(image), self.expected)
                        self.assertEqual(sheaf.read_image(image).rgb.shape, (4, 8, 3))

    def test_a_folder_for_each_frame(self):
        """Regression: without --frames f/####/s.pbrt was f/0001/s.pbrt, with them it was refused;
        shot#7/s.pbrt was shot17/s.pbrt.
        """
        base = self.farm.path("frames")
        for folder in ("f/0001", "f/0002", "shot#7", "shot17", "shot27", "o/1", "o/2"):
            os.makedirs(os.path.join(base, folder))
            with open(os.path.join(base, folder, "s.pbrt"), "w", encoding="utf-8") as file:
                file.write(SCENE.replace("0.5 0.6", f"0.{len(folder)} 0.{folder[-1]}"))
        both = ("--frames", "1-2", "--samples", 1)
        done = self.sheaf(base, "render", "f/####/s.pbrt", "--samples", 1)
        self.assertIn("give --frames", self.expect(done, USAGE).stderr)
        self.expect(self.sheaf(base, "render", "f/####/s.pbrt", *both, "-o", "o/#/x.exr"), OK)
        for number in (1, 2):
            farm.render(os.path.join(base, f"f/000{number}/s.pbrt"), os.path.join(base, "y.exr"),
                        "--samples", 1)
            self.assertEqual(farm.image_digest(os.path.join(base, "y.exr")),
                             farm.image_digest(os.path.join(base, f"o/{number}/x.exr")))
        done = self.sheaf(base, "render", "shot#7/s.pbrt", *both, "-o", "f.#.exr")
        self.assertIn("needs", self.expect(done, USAGE).stderr)
        self.expect(self.sheaf(base, "render", "shot#7/s.pbrt", "--samples", 1, "-o",
                               "shot#7/x.exr"), OK)
        farm.render(os.path.join(base, "shot#7", "s.pbrt"), os.path.join(base, "y.exr"),
                    "--samples", 1)
        self.assertEqual(farm.image_digest(os.path.join(base, "y.exr")),
                         farm.image_digest(os.path.join(base, "shot#7", "x.exr")))
        done = self.sheaf(base, "render", "f/####/s.pbrt", *both, "-o", "shot#7/x.exr")
        self.assertIn("the job has 2 frames", self.expect(done, USAGE).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
