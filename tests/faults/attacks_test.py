#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Attacks on a farm and on its users, on real processes: what one of them keeps from the others.

Runs with the interpreter of python_package_test.py, whose stubs the hoarder uses. Prints how long
the hoarder delayed the delivery; the test counts leases instead, for seconds are the machine's.
"""
import json
import os
import signal
import socket
import sys
import time
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
from client_case import BAD_SCENE, OK, SCENE, run  # noqa: E402
from python_package_test import setUpModule  # noqa: E402,F401  unittest calls it.
from sandbox_test import children_of, is_running  # noqa: E402

EVENT_STREAMS_OF_ONE = 32  # kEventReadersOfOneMax
# A chunk of work that no worker finishes within the test.
ENDLESS = ("--samples", 1 << 20, "--pass-samples", 1 << 20, "--lease-passes", 1)
# Tiles of one task each, whose time the farm learns from the first of them.
TASKS = ("--samples", 64, "--pass-samples", 16, "--lease-passes", 1, "--tile-size", 16)
NESTED = 60
GRACE_SECONDS = 1


def is_stopped(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        return file.read().rsplit(")", 1)[1].split()[0] in "Tt"


class Stream:
    """An event stream of the page, from an address of loopback."""

    def __init__(self, http, address="127.0.0.1"):
        host, port = http.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), 30 * farm.PATIENCE, (address, 0))
        self.socket.sendall(b"GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        self.status = int(self.socket.recv(4096).split()[1])

    def close(self):
        self.socket.close()


class AttacksTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.farm = farm.Farm()
        cls.farm.__enter__()
        cls.addClassCleanup(cls.farm.__exit__)

    def write(self, name, text):
        path = self.farm.path(name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def submit(self, scene, *arguments):
        done = self.farm.sheaf("submit", scene, *arguments, "--json")
        return json.loads(done.stdout.splitlines()[-1])

    def test_mixes_that_share_what_they_mix_are_walked_once(self):
        lines = ['MakeNamedMaterial "m0" "string type" "diffuse"',
                 'MakeNamedMaterial "m1" "string type" "conductor"']
        for level in range(2, NESTED):
            lines.append(f'MakeNamedMaterial "m{level}" "string type" "mix" "string materials" '
                         f'["m{level - 1}" "m{level - 2}"]')
        lines.append(f'NamedMaterial "m{NESTED - 1}"')
        scene = self.write("mixes.pbrt",
                           SCENE.replace("Shape", "\n".join(lines) + "\nShape", 1))
        self.assertEqual(run("plan", scene, seconds=60).returncode, OK)

    def test_includes_that_double_are_refused(self):
        for level in range(30):
            self.write(f"includes/{level}.pbrt", 2 * f'Include "{level + 1}.pbrt"\n')
        self.write("includes/30.pbrt", "# nothing\n")
        scene = self.write("includes/scene.pbrt", SCENE + 'Include "0.pbrt"\n')
        done = run("plan", scene, seconds=60)
        self.assertEqual(done.returncode, BAD_SCENE, done.stderr)
        self.assertIn("nclu", done.stderr)

    def test_files_outside_of_a_gltf_are_not_uploaded(self):
        secret = self.write("secret.bin", 36 * "s")
        for uri in (secret, "../secret.bin"):
            scene = self.write("model/scene.gltf", json.dumps({
                "asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": uri}],
                "bufferViews": [{"buffer": 0, "byteLength": 36}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3,
                               "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}))
            done = self.farm.sheaf("submit", scene, check=False)
            self.assertNotEqual(done.returncode, OK, uri)
            self.assertIn("secret.bin", done.stderr)
        for name in os.listdir(self.farm.path("state", "content")):
            folder = self.farm.path("state", "content", name)
            for blob in os.listdir(folder) if os.path.isdir(folder) else []:
                self.assertNotEqual(os.path.getsize(os.path.join(folder, blob)), 36)

    def test_event_streams_of_one_leave_those_of_others(self):
        streams = [Stream(self.farm.http) for _ in range(EVENT_STREAMS_OF_ONE + 1)]
        for stream in streams:
            self.addCleanup(stream.close)
        self.assertEqual([stream.status for stream in streams],
                         EVENT_STREAMS_OF_ONE * [200] + [429])
        other = Stream(self.farm.http, "127.0.0.2")
        self.addCleanup(other.close)
        self.assertEqual(other.status, 200)
        for stream in streams:
            stream.close()

        def is_free():
            again = Stream(self.farm.http)
            again.close()
            return again.status == 200
        farm.wait_until(is_free, 10, "a place of a closed stream")

    def test_workers_end_within_their_grace_whatever_stands_still(self):
        scene = self.write("endless.pbrt", SCENE)
        for sandbox, stopped in (("best", ()), ("best", (0,)), ("best", (-1,)), ("best", (0, -1)),
                                 ("none", ())):
            with self.subTest(sandbox=sandbox, stopped=stopped):
                job = self.submit(scene, *ENDLESS)["name"]
                worker = self.farm.start_worker("--sandbox", sandbox, "--grace-seconds",
                                                str(GRACE_SECONDS))
                log = f"worker{self.farm.worker_count}"
                farm.wait_until(lambda: "is ready" in self.farm.log(log) or sandbox == "none", 60,
                                "the scene")
                farm.wait_until(lambda: self.farm.sheaf("workers", "--json").stdout, 30, "it")
                below = children_of(worker.pid)  # The outer process first.
                chosen = [below[index] for index in stopped]
                for pid in chosen:
                    os.kill(pid, signal.SIGSTOP)
                    farm.wait_until(lambda pid=pid: is_stopped(pid), 10, "a stopped process")
                worker.send_signal(signal.SIGTERM)
                self.assertEqual(worker.wait((GRACE_SECONDS + 6) * farm.PATIENCE), 0)
                farm.wait_until(lambda: not any(is_running(pid) for pid in below), 10,
                                "the end of its processes")
                self.farm.workers.remove(worker)
                self.farm.sheaf("cancel", job)

    def test_a_hoarder_does_not_hold_up_delivery(self):
        """It takes all leases and delivers nothing; a frame waits for its checks for seconds."""
        from hoarding_worker import HoardingWorker
        scene = self.write("hoard.pbrt", SCENE)
        profile = self.submit(scene, "--samples", 1)["numeric_profile"]
        self.farm.sheaf("cancel", "1")
        worker = self.farm.start_worker()
        with HoardingWorker(self.farm.address, "hoarder", profile) as hoarder:
            job = self.submit(scene, *TASKS)["name"]
            farm.wait_until(lambda: hoarder.taken, 30, "its leases")
            begin = last_sample = time.monotonic()
            words = set()
            while True:
                shown = json.loads(self.farm.sheaf("show", job, "--json").stdout)
                words.add(shown.get("waiting_reason", ""))
                progress = shown["frames"][0]["progress"]
                if progress["sample_count_done"] < progress["sample_count_total"]:
                    last_sample = time.monotonic()
                if shown["state"] != "running":
                    break
                self.assertLess(time.monotonic() - begin, 60 * farm.PATIENCE, "it hangs")
            waited = time.monotonic() - last_sample
        print(f"hoarder: {len(hoarder.taken)} leases; delivered {waited:.1f} s after the last "
              f"sample; the job waited: {sorted(filter(None, words))}", file=sys.stderr)
        self.assertEqual(shown["state"], "succeeded")
        self.assertTrue(any(why.startswith("waits for checks") for why in words), words)
        self.assertGreater(self.farm.metrics()["sheaf_checks_dropped_total"], 0)
        self.assertLess(waited, 6 * farm.PATIENCE)  # check_wait_min, and not check_wait_max.
        worker.terminate()
        worker.wait(60 * farm.PATIENCE)
        self.farm.workers.remove(worker)


if __name__ == "__main__":
    unittest.main(verbosity=2)
