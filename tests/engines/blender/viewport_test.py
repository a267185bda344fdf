#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Rendered shading in Blender's 3D viewport: in a window of Xvfb (viewport_in_blender.py), and its
functions without one (region_in_blender.py). Skipped where there is no Blender or Xvfb.

Run: viewport_test.py [--trixie]. SHEAF_BIN: the folder of sheaf, by default build/release/bin.
--trixie: by Blender 4.3, in the chroot that run.py makes; the programs have to run there.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import run

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PROGRAMS = pathlib.Path(os.environ.get("SHEAF_BIN", ROOT / "build" / "release" / "bin")).resolve()
SECONDS_MAX = 600
SCREEN = "700x500x24"
IS_TRIXIE = "--trixie" in sys.argv


def blender(folder, script, *options, **environment):
    """Runs a script inside Blender with the add-on; returns its output."""
    addons = pathlib.Path(folder, "user", "addons")
    addons.mkdir(parents=True)
    shutil.copytree(ROOT / "blender" / "sheaf_blender", addons / "sheaf_blender")
    command = ["blender", *options, "--factory-startup", "--python-exit-code", "3", "--python",
               str(HERE / script)]
    environment.update({
        "BLENDER_USER_SCRIPTS": str(addons.parent), "PYTHONDONTWRITEBYTECODE": "1",
        "SHEAF_BIN": str(PROGRAMS), "HOME": folder, "TMPDIR": folder,
        "SHEAF_TEST_CONTENT": f"{folder}/content",
        "PATH": os.environ["PATH"]})
    if IS_TRIXIE:
        command = run.trixie_command(command, environment,
                                     (ROOT, folder, PROGRAMS, "/tmp/.X11-unix"))
    return subprocess.run(command, env=environment, text=True, check=False,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          timeout=SECONDS_MAX).stdout


@unittest.skipUnless(shutil.which("blender"), "there is no Blender; install blender "
                     "and python3-openimageio")
class ViewportTest(unittest.TestCase):
    def test_without_a_window(self):
        with tempfile.TemporaryDirectory(prefix="sheaf-blender-viewport-") as folder:
            said = blender(folder, "region_in_blender.py", "-b")
        self.assertIn("REGION_OK", said, said[-6000:])

    @unittest.skipUnless(shutil.which("Xvfb"), "there is no Xvfb; install xvfb and libgl1-mesa-dri")
    def test_in_a_window(self):
        with tempfile.TemporaryDirectory(prefix="sheaf-blender-viewport-") as folder:
            read, write = os.pipe()
            screen = subprocess.Popen(
                ["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-fbdir", folder,
                 "-nolisten", "tcp"], pass_fds=(write,), stderr=subprocess.DEVNULL)
            try:
                os.close(write)
                with os.fdopen(read) as answer:
                    display = ":" + answer.readline().strip()
                said = blender(folder, "viewport_in_blender.py", DISPLAY=display,
                               LIBGL_ALWAYS_SOFTWARE="1",
                               SHEAF_TEST_SCREEN=os.path.join(folder, "Xvfb_screen0"))
            finally:
                screen.terminate()
                screen.wait()
        self.assertIn("VIEWPORT_OK", said, said[-6000:])
        left = int(re.search(r"LEFT (\d+)\.", said)[1])
        self.assertFalse(pathlib.Path(f"/proc/{left}").exists(), "Blender leaves a process")


if __name__ == "__main__":
    if IS_TRIXIE:
        run.install_trixie()
    unittest.main(argv=[each for each in sys.argv if each != "--trixie"], verbosity=2)
