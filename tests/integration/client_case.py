# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The shared part of the client's tests: a farm with one worker, exit codes, and runs of
`sheaf`."""
import os
import subprocess
import unittest

import farm

OK, FAILED, USAGE, UNREACHABLE, BAD_SCENE, CANCELLED, FILE, INTERRUPTED = 0, 1, 2, 3, 4, 5, 6, 130

# A square under a sky. Tests append invalid statements.
SCENE = """LookAt 0 0 -3  0 0 0  0 1 0
Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 48 "integer yresolution" 32
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
  "point3 P" [-1 -1 0  1 -1 0  1 1 0  -1 1 0]
"""


def run(*arguments, seconds=30, environment=None):
    """Runs `sheaf` without a farm."""
    return subprocess.run([os.path.join(farm.programs(), "sheaf"), *map(str, arguments)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=seconds * farm.PATIENCE,
                          env=dict(os.environ, **(environment or {})))


class ClientCase(unittest.TestCase):
    """One farm with one worker serves all tests of a class."""

    worker_arguments = ()

    @classmethod
    def setUpClass(cls):
        cls.farm = farm.Farm(["--allow-host", "farm.example", "--allow-host", "other.example"])
        cls.farm.__enter__()
        cls.addClassCleanup(cls.farm.__exit__)
        cls.farm.start_worker(*cls.worker_arguments)

    def write(self, name, text):
        path = self.farm.path(name)
        with open(path, "w", encoding="utf-8") as f:
            f.write(text)
        return path

    def expect(self, done, code):
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done
