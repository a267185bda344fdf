#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs the command blocks of README.md and of the tutorial, one line after the other.

It differs from a reader's machines in three ways: addresses are loopback with free ports,
farm.example.org is 127.0.0.1, and `ssh node7` runs its command here with another home. A line that
starts a coordinator or a worker keeps running during the next lines, as in a terminal of its own.
"""
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
from client_case import SCENE  # noqa: E402
from commands import blocks  # noqa: E402

SSH = """#!/bin/sh
shift
cd "$NODE" && HOME=$NODE exec sh -c "$*"
"""
COMMAND_SECONDS_MAX = 120
SERVES = re.compile(r"(ssh \S+ )?sheaf-(coordinator|worker)( --|$)")


class Reader:
    """A reader in a folder of their own; use with `with`."""

    def __enter__(self):
        self.folder = tempfile.mkdtemp(prefix="sheaf reader ")
        self.port, self.http = farm.free_port(), farm.free_port()
        self.daemons = []
        shims, node = os.path.join(self.folder, "bin"), os.path.join(self.folder, "node")
        os.makedirs(shims)
        os.makedirs(node)
        with open(os.path.join(shims, "ssh"), "w", encoding="utf-8") as file:
            file.write(SSH)
        os.chmod(os.path.join(shims, "ssh"), 0o755)
        self.environment = {k: v for k, v in os.environ.items() if not k.startswith("XDG_")}
        self.environment.update(
            HOME=self.folder, NODE=node, PATH=f"{shims}:{farm.programs()}:{os.environ['PATH']}",
            SHEAF_COORDINATOR=f"127.0.0.1:{self.port}", SHEAF_NO_QUOTE="1")
        return self

    def __exit__(self, *_):
        self.end_daemons()
        shutil.rmtree(self.folder, ignore_errors=True)

    def here(self, line):
        """The line with this machine's addresses."""
        line = line.partition("  #")[0].rstrip()
        line = line.replace("[::]:7400", f"127.0.0.1:{self.port}")
        line = line.replace("[::]:7480", f"127.0.0.1:{self.http}")
        line = line.replace("--coordinator farm.example.org",
                            f"--coordinator 127.0.0.1:{self.port}")
        line = line.replace("farm.example.org", "127.0.0.1")
        if line.startswith("sheaf-coordinator init"):
            line += f" --port {self.port}"
        if line.startswith("sheaf-coordinator --") and "--listen" not in line:
            line += f" --listen 127.0.0.1:{self.port} --http 127.0.0.1:{self.http}"
        return line

    def start(self, line):
        log = open(os.path.join(self.folder, "log"), "ab")
        self.daemons.append(subprocess.Popen(
            ["bash", "-c", "exec " + line], cwd=self.folder, env=self.environment, stdout=log,
            stderr=log, stdin=subprocess.DEVNULL, start_new_session=True))
        log.close()
        if "sheaf-coordinator" in line:
            farm.wait_until(lambda: self.answers(), 30, "a coordinator")

    def answers(self):
        # With certificates it answers here that a login is needed, which is an answer too.
        done = subprocess.run(["sheaf", "list"], env=self.environment, capture_output=True,
                              timeout=600)
        return done.returncode != 3

    def end_daemons(self):
        for process in reversed(self.daemons):
            os.killpg(process.pid, signal.SIGTERM)  # A shell between them would not pass it on.
            try:
                process.wait(timeout=300)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        self.daemons = []

    def run(self, path):
        """Runs a document. Returns the lines that ran."""
        ran = []
        for block in blocks(path):
            if block.reason:
                continue
            lines = block.lines
            if any("<<'" in line for line in lines):
                lines = [block.text()]
            for line in lines:
                if line.startswith("sheaf-coordinator init"):
                    self.end_daemons()  # The reader ends the farm of before.
                line = self.here(line)
                ran.append(line)
                if SERVES.match(line):
                    self.start(line)
                    continue
                done = subprocess.run(["bash", "-c", "set -o pipefail\n" + line], cwd=self.folder,
                                      env=self.environment, capture_output=True, text=True,
                                      stdin=subprocess.DEVNULL,
                                      timeout=COMMAND_SECONDS_MAX * farm.PATIENCE)
                if done.returncode:
                    with open(os.path.join(self.folder, "log"), errors="replace",
                              encoding="utf-8") as log:
                        raise AssertionError(f"{path}: {line}: exit code {done.returncode}\n"
                                             f"{done.stdout}{done.stderr}\n{log.read()[-3000:]}")
        return ran

    def digest(self, name):
        return farm.image_digest(os.path.join(self.folder, name))


class RunTest(unittest.TestCase):
    def test_readme(self):
        with Reader() as reader:
            with open(os.path.join(reader.folder, "scene.pbrt"), "w", encoding="utf-8") as file:
                file.write(SCENE)
            ran = reader.run("README.md")
            self.assertGreaterEqual(len(ran), 6)
            self.assertEqual(reader.digest("image.exr"), reader.digest("farm.exr"))

    def test_tutorial(self):
        with Reader() as reader:
            ran = reader.run("docs/tutorial.md")
            self.assertGreaterEqual(len(ran), 15)
            five = ran.index(next(line for line in ran if " init " in line))
            self.assertTrue(ran[five + 4].startswith("sheaf submit"), "at most five commands")
            self.assertEqual(reader.digest("farm.exr"), reader.digest("two.exr"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
