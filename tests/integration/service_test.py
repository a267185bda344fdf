#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Coordinator and worker as services: what they tell their manager (here: this test), and workers
that leave their machine to its user.
"""
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

import client_case
import farm
sys.path.insert(0, os.path.join(farm.ROOT, "tests", "engines", "postgresql"))
import postgres  # noqa: E402

SECONDS_MAX = 30
WATCHDOG_SECONDS = 0.4


class Manager:
    """A service manager's socket, and the environment of what it starts."""

    def __init__(self, folder):
        self.path = os.path.join(folder, "notify")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.environment = {**os.environ, "NOTIFY_SOCKET": self.path,
                            "WATCHDOG_USEC": str(int(WATCHDOG_SECONDS * 1e6))}

    def next(self):
        self.socket.settimeout(SECONDS_MAX * farm.PATIENCE)
        return self.socket.recv(4096).decode()

    def await_line(self, line):
        """Reads until a datagram has the line; returns it."""
        end = time.monotonic() + SECONDS_MAX * farm.PATIENCE
        while time.monotonic() < end:
            told = self.next()
            if re.search(rf"(?m)^{line}", told):
                return told
        raise AssertionError(f"{line} was not told")


class ServiceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.scene = os.path.join(self.folder, "scene.pbrt")
        with open(self.scene, "w", encoding="utf-8") as file:
            file.write(client_case.SCENE)

    def manager(self):
        manager = Manager(self.folder)
        self.addCleanup(manager.socket.close)
        return manager

    def worker_state(self, f):
        lines = f.sheaf("workers", "--json").stdout.splitlines()
        return [json.loads(line)["state"] for line in lines]

    def test_the_coordinator_tells_its_manager(self):
        manager = self.manager()
        f = farm.Farm()
        f.environment = manager.environment
        with f:
            self.assertRegex(manager.next(), r"^READY=1\nSTATUS=serving gRPC on port \d+$")
            for _ in range(3):
                self.assertEqual(manager.next(), "WATCHDOG=1")
            f.coordinator.terminate()
            manager.await_line("STOPPING=1")
            self.assertEqual(f.coordinator.wait(SECONDS_MAX * farm.PATIENCE), 0)

    @unittest.skipIf(postgres.programs() is None, "tests/engines/postgresql/install")
    def test_a_coordinator_that_stands_by_tells_its_manager(self):
        manager = self.manager()
        with postgres.Server(fsync=False) as server:
            with farm.Farm(coordinator_arguments=("--database", server.url)) as f:
                second = subprocess.Popen(
                    [os.path.join(farm.programs(), "sheaf-coordinator"), "--listen", "127.0.0.1:0",
                     "--http", "", "--state-dir", f.path("state"), "--database", server.url],
                    env=manager.environment, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                self.addCleanup(second.wait)
                self.addCleanup(second.kill)
                manager.await_line("READY=1\nSTATUS=standing by: the coordinator .* owns the farm")
                for _ in range(3):
                    self.assertEqual(manager.next(), "WATCHDOG=1")
                f.kill(f.coordinator)
                manager.await_line(r"READY=1\nSTATUS=serving gRPC on port \d+$")
                for _ in range(3):
                    self.assertEqual(manager.next(), "WATCHDOG=1")
                second.terminate()
                manager.await_line("STOPPING=1")
                self.assertEqual(second.wait(SECONDS_MAX * farm.PATIENCE), 0)

    def test_a_worker_tells_its_manager(self):
        manager = self.manager()
        with farm.Farm() as f:
            f.environment = manager.environment
            worker = f.start_worker("--hours", "00:00-24:00")
            self.assertEqual(manager.next(), f"READY=1\nSTATUS=works for {f.address}")
            f.environment = dict(os.environ)
            for _ in range(3):
                self.assertEqual(manager.next(), "WATCHDOG=1")
            # It renders meanwhile, in a process that speaks to no manager.
            f.sheaf("submit", self.scene, "--samples", "16", "--wait", "-o", f.path("a.exr"))
            worker.terminate()
            manager.await_line("STOPPING=1")
            self.assertEqual(worker.wait(SECONDS_MAX * farm.PATIENCE), 0)

    def test_a_worker_that_stands_still_is_not_alive(self):
        manager = self.manager()
        with farm.Farm() as f:
            f.environment = manager.environment
            worker = f.start_worker()
            manager.await_line("WATCHDOG=1")
            worker.send_signal(signal.SIGSTOP)
            manager.socket.settimeout(3 * WATCHDOG_SECONDS)
            with self.assertRaises(TimeoutError):
                for _ in range(100):  # Earlier messages.
                    manager.socket.recv(4096)
            worker.send_signal(signal.SIGCONT)
            manager.await_line("WATCHDOG=1")

    def test_outside_its_hours_a_worker_takes_nothing(self):
        manager = self.manager()
        now = time.localtime()
        # From two hours after now to an hour before.
        hours = f"{(now.tm_hour + 2) % 24:02}:00-{(now.tm_hour + 22) % 24:02}:00"
        with farm.Farm() as f:
            f.environment = {**manager.environment}
            f.start_worker("--hours", hours)
            manager.await_line(r"STATUS=takes no work: outside its hours \(--hours\)")
            f.environment = dict(os.environ)
            job = f.sheaf("submit", self.scene, "--samples", "16").stdout.strip()
            farm.wait_until(lambda: self.worker_state(f) == ["stopped"], SECONDS_MAX, "stopped")
            self.assertEqual(json.loads(f.sheaf("show", job, "--json").stdout)["state"], "queued")
            # One that may work does.
            f.start_worker("--hours", "00:00-24:00")
            f.sheaf("watch", job)

    def test_a_worker_yields_to_load(self):
        manager = self.manager()
        busy = subprocess.Popen(["sh", "-c", "while :; do :; done"])
        self.addCleanup(busy.wait)
        self.addCleanup(busy.kill)
        try:  # Load is what runs at ordinary priority, whatever that of this test is.
            os.setpriority(os.PRIO_PROCESS, busy.pid, 0)
        except PermissionError:
            self.skipTest("this test runs at a lower priority and may not raise it")
        with farm.Farm() as f:
            f.environment = manager.environment
            worker = f.start_worker("--yield-load", "0.02")
            told = manager.await_line("STATUS=takes no work: other programs use")
            self.assertRegex(told, r"use \d+\.\d processors \(--yield-load 0\.02\)")
            started = os.getpriority(os.PRIO_PROCESS, 0)  # The worker was started with this.
            self.assertEqual(os.getpriority(os.PRIO_PROCESS, worker.pid), started or 10)

    def test_a_worker_yields_memory(self):
        manager = self.manager()
        with farm.Farm() as f:
            f.environment = manager.environment
            f.start_worker("--yield-memory", "1000T")
            told = manager.await_line("STATUS=takes no work")
            self.assertIn("of memory are available", told)

    def test_settings_that_cannot_work_are_refused(self):
        for arguments, message in (
                (("--hours", "7-9"), '"7-9" is no range of hours'),
                (("--yield-load", "1", "--nice", "0"), "give a --nice from 1 to 19"),
                (("--nice", "20"), "--nice")):
            done = subprocess.run([os.path.join(farm.programs(), "sheaf-worker"), *arguments],
                                  capture_output=True, text=True, check=False,
                                  timeout=60 * farm.PATIENCE)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(message, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
