#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Standard streams of all programs: output that cannot be written, closed descriptors, terminals
that understand no escapes, and a missing HOME.
"""
import os
import pty
import re
import subprocess
import sys
import unittest

import farm as farms
from client_case import FILE, OK, SCENE, ClientCase

AUTOSCALER = [sys.executable, "-m", "sheaf_autoscaler"]
# Commands whose output is only that of their help here: they need more than a farm, or act on it.
HELP_ALONE = {"repro", "bundle", "login", "page", "approve", "study", "watch"}
# The reason is unknown of what was written, and lost, before the end.
FULL = r"standard output: not all could be written(: No space left on device)?;"
CLOSED = r"standard output: not all could be written(: Bad file descriptor)?;"


def program(name):
    return os.path.join(farms.programs(), name)


def to_full_device(words, **more):
    with open("/dev/full", "wb") as full:
        return subprocess.run(words, stdin=subprocess.DEVNULL, stdout=full, text=True,
                              stderr=subprocess.PIPE, timeout=60 * farms.PATIENCE, check=False,
                              **more)


def with_closed(words, redirections, **more):
    return subprocess.run(["sh", "-c", f'exec "$@" {redirections}', "sh", *words], text=True,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, timeout=60 * farms.PATIENCE, check=False, **more)


def read_terminal(main):
    """All that is written until the other side is closed; closes this one."""
    text = b""
    with os.fdopen(main, "rb", buffering=0) as terminal:
        while True:
            try:
                read = terminal.read(65536)
            except OSError:  # The other side is closed.
                return text
            if not read:
                return text
            text += read


class StandardStreamsTest(ClientCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        f = cls.farm
        cls.environment = dict(f.environment, SHEAF_COORDINATOR=f.address, SHEAF_NO_QUOTE="1",
                               PYTHONPATH=os.path.join(farms.ROOT, "python"))
        cls.scene = f.path("scene.pbrt")
        with open(cls.scene, "w", encoding="utf-8") as file:
            file.write(SCENE)
        cls.image = f.path("image.exr")
        f.sheaf("submit", cls.scene, "--samples", 4, "--wait", "-o", cls.image)
        subprocess.run([program("volume_seeds"), f.path("seeds")], check=True)

    def expect_both(self, words):
        """To a full disk, and to a closed descriptor."""
        shown = " ".join(map(str, words))
        done = to_full_device(words, env=self.environment)
        self.assertEqual(done.returncode, FILE, shown + "\n" + done.stderr)
        self.assertRegex(done.stderr, FULL, shown)
        done = with_closed(words, ">&-", env=self.environment)
        self.assertEqual(done.returncode, FILE, shown + "\n" + done.stderr)
        self.assertRegex(done.stderr, CLOSED, shown)

    def commands(self):
        """The arguments of each command of `sheaf`, by its name."""
        scene, image = self.scene, self.image
        submit = ["submit", scene, "--samples", "4"]
        # No worker takes it, so that it does not end.
        job = self.farm.sheaf(*submit, "--pool", "nowhere").stdout.strip()
        return {
            "render": [["render", scene, "--samples", "1", "--json", "-o",
                        self.farm.path("r.exr")]],
            "quote": [["quote", scene, "--samples", "4"]],
            "submit": [submit, [*submit, "--json"]],
            "list": [["list"], ["list", "--json"]],
            "show": [["show", "1"], ["show", "1", "--json"], ["show", image, "--image=none"],
                     ["show", image]],
            "refine": [["refine", "1", "--price", "--target-error", "0.001"]],
            "pause": [["pause", job]],
            "resume": [["resume", job]], "priority": [["priority", job, "3"]],
            "cancel": [["cancel", job]], "retry": None, "kill": None,
            "workers": [["workers"], ["workers", "--json"]],
            "share": [["share", "list"]], "pin": [["pin", "1"]], "unpin": [["unpin", "1"]],
            "logs": [["logs", "1"], ["logs", "1", "--json"]],
            "delete": None, "release": None, "drain": None, "undrain": None,
            "gc": [["gc"], ["gc", "--json"]],
            "usage": [["usage"], ["usage", "--json"], ["usage", "--csv"]],
            "plan": [["plan", scene], ["plan", scene, "--json"],
                     ["plan", scene, "--timings", "--memory"]],
            "pack": [["pack", self.farm.path("seeds/volume/0"), "-o", self.farm.path("pages")]],
            "compare": [["compare", image, image], ["compare", image, image, "--json"]],
            "completion": [["completion", "bash"]],
            "view": None,  # It answers requests: view_test.py.
        }

    def test_every_command_notices_output_that_is_not_written(self):
        text = farms.local("--help")
        names = re.findall(r"^  ([a-z]+) {2,}\S", text[text.index("COMMAND"):], re.M)
        cases = self.commands()
        self.assertGreater(len(names), 25, text)
        self.assertEqual(set(names), set(cases) | HELP_ALONE)
        for name in names:
            self.expect_both([program("sheaf"), name, "--help"])
            for words in cases.get(name) or []:
                self.expect_both([program("sheaf"), *words])
        for words in ("--help", "--version"):
            self.expect_both([program("sheaf"), words])

    def test_every_other_program_notices_it_too(self):
        for name in ("sheaf-coordinator", "sheaf-worker"):
            for words in (["--help"], ["--version"], ["--completion", "bash"]):
                self.expect_both([program(name), *words])
        self.expect_both([*AUTOSCALER, "--help"])
        state = self.farm.path("secure state")
        subprocess.run([program("sheaf-coordinator"), "init", "--state-dir", state], check=True,
                       capture_output=True, env=dict(self.environment, HOME=state))
        for words in (["enroll", "worker", "node7"], ["identities"], ["scraper", "prometheus"]):
            self.expect_both([program("sheaf-coordinator"), *words, "--state-dir", state])

    def test_other_exit_codes_remain(self):
        other = self.farm.path("other.exr")
        farms.render(self.scene, other, "--samples", 1, "--seed", 5)
        words = [program("sheaf"), "compare", self.image, other, "--tolerance", "0"]
        self.assertEqual(subprocess.run(words, capture_output=True, check=False).returncode, 1)
        done = to_full_device(words)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, FULL)

    def test_a_reader_that_goes_is_no_error(self):
        for words in ([program("sheaf"), "completion", "bash"],
                      [program("sheaf-coordinator"), "--help"], [*AUTOSCALER, "--help"]):
            for ignored in ("", 'trap "" PIPE; '):  # A parent may ignore SIGPIPE.
                read, write = os.pipe()
                os.close(read)
                done = subprocess.run(["sh", "-c", ignored + 'exec "$@"', "sh", *words],
                                      stdout=write, stderr=subprocess.PIPE, text=True,
                                      stdin=subprocess.DEVNULL, env=self.environment,
                                      restore_signals=True, check=False)
                os.close(write)
                self.assertEqual(done.stderr, "")
                self.assertIn(done.returncode, (OK, -13), words)

    def test_closed_descriptors_are_taken_by_no_file(self):
        image = self.farm.path("closed.exr")
        done = with_closed([program("sheaf"), "render", self.scene, "--samples", "4", "-o", image],
                           "<&- >&- 2>&-")
        self.assertEqual(done.returncode, OK)
        self.assertEqual(farms.image_digest(image), farms.image_digest(self.image))
        for name, words in (("sheaf-coordinator", ["--listen", "127.0.0.1:0", "--http", "",
                                                   "--state-dir", self.farm.path("closed state")]),
                            ("sheaf-worker", ["--coordinator", self.farm.address, "--threads", "1",
                                              "--pool", "none",
                                              "--cache-dir", self.farm.path("closed cache")])):
            daemon = subprocess.Popen(["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", program(name),
                                       *words])
            self.addCleanup(daemon.wait)
            self.addCleanup(daemon.kill)

            def streams():
                folder = f"/proc/{daemon.pid}/fd"
                try:
                    found = {n: os.readlink(f"{folder}/{n}") for n in os.listdir(folder)}
                except OSError:
                    return None
                is_running = any("eventfd" in target for target in found.values())
                return [found.get(n) for n in "012"] if is_running else None
            self.assertEqual(farms.wait_until(streams, 30, name), ["/dev/null"] * 3, name)

    def test_state_lies_in_the_home_directory_without_HOME(self):
        environment = {key: value for key, value in self.environment.items()
                       if key not in ("HOME", "XDG_CACHE_HOME")}
        done = subprocess.run([program("sheaf-coordinator"), "--help"], capture_output=True,
                              text=True, env=environment, cwd=self.farm.folder, check=True)
        home = re.escape(os.path.expanduser("~" + __import__("pwd").getpwuid(os.getuid()).pw_name))
        self.assertRegex(re.sub(r"\s+", " ", done.stdout),
                         home + "/.local/state/sheaf/coordinator")
        done = subprocess.run([program("sheaf-coordinator"), "--help"], capture_output=True,
                              text=True, env=dict(environment, HOME="relative"), check=True)
        self.assertNotIn("relative", done.stdout)

    def test_the_hint_of_init_names_the_same_state(self):
        state = self.farm.path("hinted state")  # Its name has spaces.
        done = subprocess.run([program("sheaf-coordinator"), "init", "--state-dir", state],
                              check=True, capture_output=True, text=True,
                              env=dict(self.environment, HOME=state))
        hint = done.stdout[done.stdout.index("next: ") + 6:]
        self.assertIn(f"--listen [::]:7400 --http [::]:7480 --state-dir '{state}'", hint)
        self.assertIn(f"enroll worker NAME --state-dir '{state}'", hint)
        done = subprocess.run([program("sheaf-coordinator"), "init"], check=True, text=True,
                              capture_output=True, env=dict(self.environment, HOME=state))
        self.assertNotIn("--state-dir", done.stdout)

    def errors_on_terminal(self, terminal):
        """The errors that `sheaf render` writes to a terminal of this TERM."""
        main, side = pty.openpty()
        environment = {key: value for key, value in self.environment.items() if key != "TERM"}
        if terminal is not None:
            environment["TERM"] = terminal
        process = subprocess.Popen([program("sheaf"), "render", self.scene, "--samples", "64",
                                    "-o", self.farm.path("t.exr")], env=environment, stderr=side,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        os.close(side)
        text = read_terminal(main)
        self.assertEqual(process.wait(), OK)
        return text

    def test_plain_terminals_get_no_escapes(self):
        self.assertIn(b"\x1b[K", self.errors_on_terminal("xterm"))
        for terminal in ("dumb", None, ""):
            text = self.errors_on_terminal(terminal)
            self.assertNotIn(b"\x1b", text)
            self.assertNotIn(b"\r", text.replace(b"\r\n", b""))

    def test_no_color_is_honored(self):
        words = ["show", self.image, "--image=blocks"]
        shown = subprocess.run([program("sheaf"), *words], capture_output=True, check=True,
                               env=self.environment)
        self.assertIn(b"\x1b[", shown.stdout)
        main, side = pty.openpty()
        environment = dict(self.environment, TERM="xterm-256color", NO_COLOR="1")
        process = subprocess.Popen([program("sheaf"), "show", self.image], stdout=side, stderr=side,
                                   stdin=subprocess.DEVNULL, env=environment)
        os.close(side)
        text = read_terminal(main)
        self.assertEqual(process.wait(), OK)
        self.assertNotIn(b"\x1b", text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
