#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""deploy/progress: its reports about a long command when the output is no terminal."""
import os
import re
import subprocess
import tempfile
import unittest

DEPLOY = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "deploy")
PROGRESS = os.path.join(DEPLOY, "progress")
APT_GET = """echo 'dlstatus:2:50.5:Retrieving file 2 of 3'; sleep 1.5
echo 'pmstatus:dpkg-exec:0.0000:Running dpkg'
echo 'pmstatus:libc6:amd64:7.5:Preparing libc6:amd64'; sleep 1.5
echo 'E: Unable to locate a package'; [ "$1" = update ] || exit 100
"""


# Waits until a line of the progress has the text.
AWAIT = """await() {
  for _ in $(seq 3000); do grep -q "$1" "$LINES_FILE" && return; sleep 0.1; done
}
"""


def told(script, *arguments, seconds="1"):
    """Runs a shell script, which may call `await TEXT`, through deploy/progress. Returns (standard
    output, lines of standard error).
    """
    with tempfile.NamedTemporaryFile("w+") as lines:
        done = subprocess.run(
            ["bash", "-c", AWAIT + "( " + script + ' ) | "$0" "$@"', PROGRESS, *arguments],
            stdout=subprocess.PIPE, stderr=lines, text=True, timeout=600, check=True,
            env={**os.environ, "SHEAF_PROGRESS_SECONDS": seconds, "LINES_FILE": lines.name})
        lines.seek(0)
        return done.stdout, lines.read().splitlines()


class ProgressTest(unittest.TestCase):
    def test_first_line_reports_the_expected_time(self):
        processors = len(os.sched_getaffinity(0))
        out, lines = told("echo '[1/40] Building a'", "building", str(15000 * processors),
                          seconds="30")
        self.assertEqual(lines, ["sheaf: building: 40 steps, about 10 min on %d processors"
                                 % processors])
        self.assertEqual(out, "")

    def test_progress_is_reported_during_long_steps(self):
        _, lines = told("echo '[3/4] Building a'; await 'step 3 of 4'", "building", "1000")
        self.assertGreaterEqual(len(lines), 2)
        for line in lines[1:]:
            self.assertRegex(line, r"^sheaf: building: step 3 of 4, about \d+ s left$")

    def test_slow_steps_raise_the_remaining_time(self):
        _, lines = told("for i in 1 2; do sleep 1.2; echo \"[$i/400] a\"; done; await 'step 2 of'",
                        "building", "100")
        left = [re.search(r"about (\d+) (s|min) left", line) for line in lines[1:]]
        seconds = [int(m[1]) * (60 if m[2] == "min" else 1) for m in left]
        self.assertGreater(seconds[-1], 40, lines)

    def test_lines_of_ctest_are_copied(self):
        written = "Test project\n  1/20 Test #7: a ..... Passed 0.1 sec\n\n100% tests passed\n"
        out, lines = told("printf %%s '%s'" % written, "testing", "1000", "--copy", seconds="30")
        self.assertEqual(out, written)
        self.assertEqual(len(lines), 1)
        self.assertRegex(lines[0], "^sheaf: testing: 20 steps, about ")

    def test_the_remaining_time_follows_from_the_times_of_tests(self):
        """A slow test counts by what it was expected to take, and short ones not at all."""
        with tempfile.NamedTemporaryFile("w") as times:
            times.write("0.10 short\n600.00 long\n600.0 longer\n")
            times.flush()
            _, lines = told("echo '  1/3 Test #1: short .... Passed   20.00 sec'; await 'step 1'; "
                            "echo '  2/3 Test #2: long ...***Failed  1400.00 sec'; await 'step 2'",
                            "testing", "1000", "--copy", "--times", times.name, "2")
        self.assertEqual(lines[0].split(",")[1], " about 10 min on %d processors"
                         % len(os.sched_getaffinity(0)))
        self.assertIn("step 1 of 3, about 10 min left", lines[1])
        self.assertIn("step 2 of 3, about 20 min left", lines[-1])

    def test_command_without_steps_prints_nothing(self):
        self.assertEqual(told("echo 'ninja: no work to do.'", "building", "1000"), ("", []))

    def test_packages_report_progress_and_failures(self):
        with tempfile.TemporaryDirectory() as folder:
            for name, script in {"apt-get": APT_GET, "dpkg-query": "exit 1",
                                 "sudo": 'exec "$@"'}.items():
                path = os.path.join(folder, name)
                with open(path, "w") as file:
                    file.write("#!/bin/bash\n" + script)
                os.chmod(path, 0o755)
            done = subprocess.run(
                [os.path.join(DEPLOY, "install-packages"), "build"], capture_output=True,
                text=True, timeout=600, env={**os.environ, "SHEAF_PROGRESS_SECONDS": "1",
                                            "PATH": folder + ":" + os.environ["PATH"]})
        self.assertEqual(done.returncode, 1)
        self.assertIn("sheaf: installing packages: step 50 of 200, about ", done.stderr)
        self.assertIn("sheaf: installing packages: step 107 of 200, about ", done.stderr)
        self.assertIn("\nE: Unable to locate a package\nsheaf: apt-get could not", done.stderr)
        self.assertNotIn("pmstatus", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
