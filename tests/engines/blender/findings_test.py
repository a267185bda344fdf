#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Exports scenes after public reports from headless Blender, without rendering them
(findings_in_blender.py). Skipped where there is no Blender.

Run: findings_test.py [--trixie] [CASE ...]. --trixie: by Blender 4.3, in the chroot that run.py
makes. tests/engines/blender/run.py renders the same scenes.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import run

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
SECONDS_MAX = 900
RANDOM_SCENES = 60
KEYED_AT_A_TIME = 12
CHOSEN = []  # Cases; all if empty.
IS_TRIXIE = "--trixie" in sys.argv


def run_in_blender(script, *arguments):
    """Runs a script inside Blender with the add-on; returns its output and its exit code."""
    with tempfile.TemporaryDirectory(prefix="sheaf-blender-findings-") as folder:
        addons = pathlib.Path(folder, "user", "addons")
        addons.mkdir(parents=True)
        shutil.copytree(ROOT / "blender" / "sheaf_blender", addons / "sheaf_blender")
        command = ["blender", "-b", "--factory-startup", "--python-exit-code", "3", "--python",
                   str(HERE / script), "--", folder, *arguments]
        environment = {
            "BLENDER_USER_SCRIPTS": str(addons.parent), "PYTHONDONTWRITEBYTECODE": "1",
            "SHEAF_BIN": folder, "SHEAF_TEST_CONTENT": f"{folder}/content", "HOME": folder,
            "PATH": os.environ["PATH"]}
        if IS_TRIXIE:
            command = run.trixie_command(command, environment, (ROOT, folder))
        found = subprocess.run(command, env=environment, text=True, check=False,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               timeout=SECONDS_MAX)
        return found.stdout, found.returncode


@unittest.skipUnless(shutil.which("blender"), "there is no Blender; install blender "
                     "and python3-openimageio")
class FindingsTest(unittest.TestCase):
    def test_each_property_is_in_a_list(self):
        said, code = run_in_blender("settings_in_blender.py")
        self.assertTrue(code == 0 and "SETTINGS_OK" in said, said[-6000:])

    def test_random_scenes(self):
        said, code = run_in_blender("random_in_blender.py", "1", str(RANDOM_SCENES))
        self.assertTrue(code == 0 and "RANDOM_OK" in said, said[-6000:])

    def test_keyed_inputs(self):
        said, code = run_in_blender("keyed_in_blender.py", str(KEYED_AT_A_TIME))
        self.assertTrue(code == 0 and "KEYED_OK" in said, said[-6000:])

    def test_planted_exceptions(self):
        said, code = run_in_blender("planted_in_blender.py")
        self.assertTrue(code == 0 and "PLANTED_OK" in said, said[-6000:])

    def test_findings(self):
        said, code = run_in_blender("findings_in_blender.py", *CHOSEN)
        self.assertTrue(code == 0 and "FINDINGS_OK" in said, said[-6000:])


if __name__ == "__main__":
    CHOSEN += [each for each in sys.argv[1:] if each != "--trixie"]
    if IS_TRIXIE:
        run.install_trixie()
    unittest.main(argv=sys.argv[:1], verbosity=2)
