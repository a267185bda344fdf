#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Programs under the surroundings that they inherit: ignored signals, the time zone, the umask,
names in other encodings, and a clock that is wrong.

Usage: surroundings_test.py FAULTS, the library of tests/support/machine_faults.cc.
"""
import datetime
import json
import os
import signal
import stat
import subprocess
import sys
import time
import unittest

import farm as farms
from client_case import SCENE
from machine_faults import MachineFaults
from secure_farm_test import SecureFarm

DAY_SECONDS = 86400
HANGUPS = (signal.SIGHUP, signal.SIGINT)


def program(name):
    return os.path.join(farms.programs(), name)


class SurroundingsTest(unittest.TestCase):
    def enter(self, farm):
        farm.__enter__()
        self.addCleanup(farm.__exit__)
        farm.scene = farm.path("scene.pbrt")
        with open(farm.scene, "w", encoding="utf-8") as file:
            file.write(SCENE)
        return farm

    def start(self, farm, *words, ignored=(), **more):
        """Started as nohup and as a script in the background start programs."""
        def ignore():
            for number in ignored:
                signal.signal(number, signal.SIG_IGN)
        environment = dict(farm.environment, SHEAF_COORDINATOR=farm.address, SHEAF_NO_QUOTE="1")
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, env=environment, preexec_fn=ignore,
                                   **more)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def jobs(self, farm):
        text = farm.sheaf("list", "--json").stdout
        return [json.loads(line) for line in text.splitlines()]

    def test_ignored_signals_stay_ignored(self):
        farm = self.enter(farms.Farm())
        output = farm.path("waited.exr")
        waiting = self.start(farm, program("sheaf"), "submit", farm.scene, "--samples", "4",
                             "--wait", "-o", output, ignored=HANGUPS)
        farms.wait_until(lambda: self.jobs(farm), 30, "the job")
        worker = self.start(farm, program("sheaf-worker"), "--coordinator", farm.address,
                            "--threads", "1", "--cache-dir", farm.path("cache"), "--pool", "other",
                            ignored=HANGUPS)
        farms.wait_until(lambda: farm.sheaf("workers", "--json").stdout, 30, "the worker")
        rendered = farm.path("rendered.exr")
        rendering = self.start(farm, program("sheaf"), "render", farm.scene, "--samples", "4096",
                               "--threads", "1", "-o", rendered, "--http", "127.0.0.1:0",
                               ignored=HANGUPS)
        time.sleep(1)
        self.assertIsNone(rendering.poll(), "it needs longer than the signals take")
        for process in (waiting, worker, rendering):
            for number in HANGUPS:
                process.send_signal(number)
        farm.start_worker()
        self.assertEqual(waiting.wait(300 * farms.PATIENCE), 0)
        self.assertTrue(os.path.exists(output))
        self.assertIsNone(worker.poll())
        self.assertEqual(rendering.wait(300 * farms.PATIENCE), 0)
        self.assertTrue(os.path.exists(rendered))
        worker.send_signal(signal.SIGTERM)
        self.assertEqual(worker.wait(60 * farms.PATIENCE), 0)

    def test_the_coordinator_keeps_an_ignored_interrupt(self):
        farm = farms.Farm()
        farm.coordinator_prefix = ["sh", "-c", 'trap "" INT; exec "$0" "$@"']
        self.enter(farm)
        farm.coordinator.send_signal(signal.SIGINT)
        time.sleep(1)
        self.assertEqual(self.jobs(farm), [])
        farm.coordinator.send_signal(signal.SIGTERM)
        self.assertEqual(farm.coordinator.wait(60 * farms.PATIENCE), 0)

    def test_time_zones_in_the_form_of_posix(self):
        farm = self.enter(farms.Farm())
        now = datetime.datetime.now(datetime.timezone.utc).replace(second=0, microsecond=0)
        deadline = now + datetime.timedelta(days=40)
        for zone, offset in (("JST-9", 9), ("<-03>3", -3), ("Asia/Tokyo", 9),
                             ("UTC0", 0), ("Nowhere/Land", 0)):
            farm.environment["TZ"] = zone
            local = deadline + datetime.timedelta(hours=offset)
            done = farm.sheaf("submit", farm.scene, "--samples", "4", "--json", "--deadline",
                              local.strftime("%Y-%m-%d %H:%M"))
            job = json.loads(done.stdout.splitlines()[-1])
            self.assertEqual(job["deadline_time"][:16], deadline.strftime("%Y-%m-%dT%H:%M"), zone)
            self.assertIn(local.strftime("%Y-%m-%d %H:%M"), farm.sheaf("show", job["name"]).stdout)
            self.assertEqual("no such time zone" in done.stderr, zone == "Nowhere/Land",
                             done.stderr)

    def test_hours_of_workers_are_of_the_time_zone(self):
        farm = self.enter(farms.Farm())
        farm.environment["TZ"] = "JST-9"
        there = datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(hours=9)
        begin, end = there - datetime.timedelta(hours=1), there + datetime.timedelta(hours=2)
        farm.start_worker("--hours", f"{begin:%H:%M}-{end:%H:%M}")
        farm.sheaf("submit", farm.scene, "--samples", "4", "--wait", "-o", farm.path("o.exr"))

    def test_the_umask_decides_who_may_write(self):
        before = os.umask(0o002)
        self.addCleanup(os.umask, before)
        farm = self.enter(farms.Farm())
        farm.start_worker()
        farm.sheaf("submit", farm.scene, "--samples", "4", "--wait", "-o", farm.path("a.exr"),
                   "--png", farm.path("a.png"))
        farms.render(farm.scene, farm.path("b.exr"), "--samples", "4", "--exr-type", "float")
        for name in ("a.exr", "a.png", "b.exr", "ports"):
            mode = stat.S_IMODE(os.stat(farm.path(name)).st_mode)
            self.assertEqual(oct(mode), oct(0o664), name)

    def open_to_others(self, *folders):
        """Paths in folders, and these, whose permissions let other accounts in."""
        paths = list(folders)
        for folder in folders:
            for parent, inner, files in os.walk(folder):
                paths += [os.path.join(parent, name) for name in inner + files]
        return [path for path in paths if not os.path.islink(path)
                and stat.S_IMODE(os.lstat(path).st_mode) & 0o077]

    def test_state_and_caches_are_private_under_any_umask(self):
        before = os.umask(0)
        self.addCleanup(os.umask, before)
        farm = self.enter(SecureFarm())
        farm.enrol_worker("node1")
        farm.log_in("anna", "submit")
        farm.person("anna", "submit", farm.scene, "--target-error", "0.05", "--samples", "64",
                    "--wait", "-o", farm.path("a.exr"))
        state = farm.path("state")
        private = (state, farm.path("cache"), farm.path("home-anna", "sheaf"),
                   farm.path("identity-node1"))
        kept = set(os.listdir(state))
        self.assertLessEqual({"access", "content", "farm.db", "farm.db-wal", "farm.db-shm", "lock",
                              "outputs", "parts", "rounds"}, kept)
        self.assertEqual(self.open_to_others(*private), [])
        # As earlier versions left it, beside a file that is not the coordinator's.
        farm.coordinator.terminate()
        farm.coordinator.wait(60 * farms.PATIENCE)
        for parent, _, files in os.walk(state):
            os.chmod(parent, 0o755)
            for name in files:
                os.chmod(os.path.join(parent, name), 0o644)
        notes = os.path.join(state, "notes.txt")
        with open(notes, "w", encoding="utf-8") as file:
            file.write("of a user")
        os.symlink(notes, os.path.join(state, "outputs", "link"))
        farm.start_coordinator()
        self.assertEqual(self.open_to_others(*private), [notes])
        self.assertNotIn("chmod", farm.log("coordinator"))
        farms.render(farm.scene, farm.path("b.exr"), "--samples", "4", "--keep-state",
                     farm.path("kept"))
        self.assertEqual(self.open_to_others(farm.path("kept")), [])

    def refused(self, farm, *words):
        environment = dict(farm.environment, SHEAF_COORDINATOR=farm.address)
        done = subprocess.run([program("sheaf"), *words], env=environment, capture_output=True,
                              stdin=subprocess.DEVNULL, timeout=300, check=False)
        text = done.stderr.decode()  # It is UTF-8, whatever came in.
        self.assertNotIn("libprotobuf", text)
        self.assertEqual(len(text.splitlines()), 1, text)
        return done.returncode, text

    def test_texts_that_are_not_utf8_are_named(self):
        farm = self.enter(farms.Farm())
        for option in (b"--title", b"--after", b"--show", b"--require", b"--pool"):
            code, text = self.refused(farm, b"submit", farm.scene.encode(), option, b"caf\xe9")
            self.assertEqual(code, 2, text)
            self.assertIn(option.decode() + ": ", text)
            self.assertIn("caf\\xe9", text)
        code, text = self.refused(farm, b"cancel", b"caf\xe9")
        self.assertEqual(code, 2, text)
        code, text = self.refused(farm, b"show", b"caf\xe9")
        self.assertEqual(code, 1, text)
        self.assertIn("is not UTF-8", text)
        self.assertNotIn("libprotobuf", farm.log("coordinator"))

    def test_host_names_in_another_encoding_and_none(self):
        if subprocess.run(["unshare", "--uts", "true"], capture_output=True,
                          check=False).returncode:
            self.skipTest("no namespaces of host names here")
        farm = self.enter(farms.Farm())
        for number, (name, shown) in enumerate(((b"caf\xe9", "caf_"), (b"", "unnamed-host"))):
            farm.client_prefix = [
                "unshare", "--uts", sys.executable, "-c",
                f"import ctypes, os, sys; n = {name!r}; "
                "assert ctypes.CDLL(None).sethostname(n, len(n)) == 0; "
                "os.execv(sys.argv[1], sys.argv[1:])"]
            worker = farm.start_worker()
            farm.client_prefix = []
            farm.sheaf("submit", farm.scene, "--samples", "4", "--wait", "-o",
                       farm.path(f"{number}.exr"))
            self.assertIn(f"workers/{shown}-", farm.sheaf("workers").stdout.replace(
                f"\n{shown}-", f"\nworkers/{shown}-"))
            log = farm.log(f"worker{number + 1}")
            self.assertIn("hostnamectl", log)
            self.assertNotIn("libprotobuf", log + farm.log("coordinator"))
            farm.kill(worker)

    def test_images_are_shown_whatever_the_case_of_their_name(self):
        farm = self.enter(farms.Farm())
        farms.render(farm.scene, farm.path("OUT.EXR"), "--samples", "4")
        self.assertIn("OUT.EXR", farms.local("show", farm.path("OUT.EXR")))

    def test_frames_that_a_job_does_not_have(self):
        farm = self.enter(farms.Farm())
        farm.sheaf("submit", farm.scene, "--samples", "4")
        code, text = self.refused(farm, "show", "1", "--frame", "7")
        self.assertEqual(code, 1)
        self.assertIn("jobs/1: has no frame 7, only ", text)

    def test_jobs_to_wait_for_are_checked_before_the_upload(self):
        farm = self.enter(farms.Farm())
        code, text = self.refused(farm, "submit", farm.scene, "--after", "3", "--after", "jobs/3")
        self.assertEqual(code, 2)
        self.assertIn("is given twice", text)
        code, text = self.refused(farm, "submit", farm.scene, "--after", "3")
        self.assertEqual(code, 1)
        self.assertIn("--after 3: ", text)
        self.assertEqual(os.listdir(farm.path("state", "content", "blobs"))
                         if os.path.exists(farm.path("state", "content", "blobs")) else [], [])

    def test_a_clock_that_is_behind_is_named(self):
        farm = SecureFarm()
        self.enter(farm)
        farm.log_in("anna", "submit")
        token = farm.token("worker", "node")
        faults = MachineFaults(FAULTS, farm.path("faults"))
        farm.environment.update(faults.environment)
        for days in (1, 6 * 365):
            faults.set(clock_offset_seconds=-days * DAY_SECONDS)
            done = farm.person("anna", "list", check=False)
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn("is not valid before", done.stderr)
            self.assertIn("set the clock", done.stderr)
        worker = farm.start_worker("--token", token, "--identity-dir", farm.path("node"))
        farms.wait_until(lambda: "set the clock" in farm.log("worker1"), 15, "the worker's words")
        farm.kill(worker)

    def test_a_clock_that_is_set_ahead_ages_nothing(self):
        farm = farms.Farm()
        faults = MachineFaults(FAULTS, farm.path("faults"))
        farm.environment.update(faults.environment)
        self.enter(farm)
        farm.start_worker()
        farm.sheaf("submit", farm.scene, "--samples", "4", "--wait", "-o", farm.path("o.exr"))
        faults.set(clock_offset_seconds=30 * DAY_SECONDS)
        removed = []

        def is_noticed():  # absl reads the clock anew only every few seconds.
            removed.append(farm.sheaf("gc").stdout)
            return "has been set ahead by 720h" in farm.log("coordinator")
        farms.wait_until(is_noticed, 15, "the coordinator's words")
        self.assertEqual(set(removed), {"removed 0 bytes\n"})
        self.assertNotIn("parts removed", farm.sheaf("show", "1").stdout)


if __name__ == "__main__":
    FAULTS = os.path.abspath(sys.argv.pop(1))
    unittest.main(verbosity=2)
