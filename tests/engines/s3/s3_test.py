#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Farms whose parts and scenes lie on S3 servers of different make, through every fault: each image
has the SHA-256 of a render without a farm. tests/engines/s3/run installs the servers.
"""
import contextlib
import json
import os
import sys
import tempfile
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "..", "..", "..")
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "integration")]
import farm  # noqa: E402
import servers  # noqa: E402
from faulty_proxy import FaultyProxy  # noqa: E402

SCENE = os.path.join(ROOT, "scenes", "showroom.pbrt")
SETTINGS = ("--crop", "200,80,456,272", "--tile-size", "32", "--pass-samples", "16",
            "--lease-passes", "1", "--samples", 64)
PARTS_BEFORE_FAULT = 3
FAULT_SECONDS = 4  # On a slow machine longer, until the fault was caused once.


def expected_digest():
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "expected.exr")
        farm.render(SCENE, path, *SETTINGS)
        return farm.image_digest(path)


class S3Cases:
    """The tests, for each make of server."""

    @classmethod
    def setUpClass(cls):
        cls.expected = expected_digest()

    @contextlib.contextmanager
    def served(self, prefix, size_max=None):
        """A farm without workers: (farm, proxy, server)."""
        with self.server_class(size_max) as server, FaultyProxy(server.port) as proxy:
            f = farm.Farm(["--objects", f"s3://farm/{prefix}", "--lease-seconds", "5"])
            f.environment.update(server.environment(proxy.port))
            with f:
                yield f, proxy, server

    @staticmethod
    def begin(f):
        """A new job, and new workers: those of before may have given up the server for a while."""
        for process in list(f.workers):
            f.kill(process)
        for _ in range(2):
            f.start_worker()
        submitted = f.sheaf("submit", SCENE, *SETTINGS, "--json").stdout
        job = json.loads(submitted.splitlines()[-1])["name"]
        farm.wait_until(lambda: len(f.acknowledged(job)) >= PARTS_BEFORE_FAULT, 120,
                        "the first parts")
        return job

    @contextlib.contextmanager
    def job(self, prefix, size_max=None):
        """A farm with a job under way: (farm, job, proxy, server)."""
        with self.served(prefix, size_max) as (f, proxy, server):
            yield f, self.begin(f), proxy, server

    def finish(self, f, job):
        output = f.path(job.replace("/", "-") + ".exr")
        f.sheaf("watch", job, "-o", output)
        self.assertEqual(farm.image_digest(output), self.expected)
        for name in ["coordinator"] + [f"worker{i + 1}" for i in range(f.worker_count)]:
            self.assertNotIn("X-Amz-Signature", f.log(name), "a log names a ticket")
        secret = f.environment["AWS_SECRET_ACCESS_KEY"]
        if secret != f.environment["AWS_ACCESS_KEY_ID"]:
            self.assertNotIn(secret, f.log("coordinator"))

    def through(self, f, proxy, fault, share, words=None):
        proxy.heal()
        begin = time.monotonic()
        job = self.begin(f)
        retries = f.metrics()["sheaf_objects_retries_total"]
        proxy.fault, proxy.share = fault, share
        if words:
            farm.wait_until(lambda: words in f.log("coordinator"), 60, words + " in the log")
        else:
            time.sleep(FAULT_SECONDS)
            farm.wait_until(lambda: proxy.counts.get(fault), 60, f"a request that meets {fault}")
        proxy.heal()
        healed = time.monotonic()
        self.finish(f, job)
        caused = proxy.counts.get(fault, 0)
        retries = f.metrics()["sheaf_objects_retries_total"] - retries
        print(f"  {self.server_class.name}: {fault}: caused {caused} times, {retries:.0f} repeated "
              f"by the coordinator; {healed - begin:.0f} s to its end, "
              f"{time.monotonic() - healed:.0f} s to the image", flush=True)
        self.assertGreater(caused, 0)

    def test_no_fault(self):
        with self.job("calm") as (f, job, _, _server):
            self.finish(f, job)
            metrics = f.metrics()
            self.assertEqual(metrics["sheaf_objects_failures_total"], 0)
            print(f"  {self.server_class.name}: {metrics['sheaf_objects_requests_total']:.0f} "
                  f"requests, {metrics['sheaf_objects_sent_bytes_total']:.0f} bytes sent by the "
                  f"coordinator, {metrics['sheaf_objects_received_bytes_total']:.0f} received")

    def test_errors_that_pass(self):
        # A server takes seconds to start, so the faults share one.
        with self.served("passing") as (f, proxy, _):
            for fault in ("500", "503", "reset", "lost answer", "truncated", "altered"):
                with self.subTest(fault):
                    self.through(f, proxy, fault, share=0.3)

    def test_a_refusal_is_told(self):
        with self.served("refused") as (f, proxy, _):
            self.through(f, proxy, "403", 1.0, f"key {self.server_class.key} may not do this")

    def test_a_full_server_is_told(self):
        with self.served("full") as (f, proxy, _):
            self.through(f, proxy, "full", 1.0, "no room left")

    def test_a_slow_server(self):
        with self.job("slow") as (f, job, proxy, _):
            proxy.delay_seconds = 0.5
            time.sleep(FAULT_SECONDS)
            proxy.heal()
            self.finish(f, job)

    def test_a_killed_server(self):
        with self.job("killed") as (f, job, _, server):
            server.kill()
            farm.wait_until(lambda: "is not writable" in f.log("coordinator"), 90, "the log tells")
            server.start()
            self.finish(f, job)

    def test_a_killed_coordinator(self):
        with self.job("restart") as (f, job, _, _server):
            before = f.acknowledged()
            f.kill(f.coordinator)
            f.start_coordinator()
            self.assertLessEqual(before, f.acknowledged(), "what was acknowledged is there")
            self.finish(f, job)


class S3rverTest(S3Cases, unittest.TestCase):
    server_class = servers.S3rver

    def test_full_disk(self):
        with self.job("disk", size_max="256m") as (f, job, _, server):
            filler = os.path.join(server.folder, "filler")
            with contextlib.suppress(OSError), open(filler, "wb") as file:
                while True:
                    file.write(bytes(1 << 20))
            farm.wait_until(lambda: "is not writable" in f.log("coordinator"), 90, "the log tells")
            os.remove(filler)
            server.kill()
            server.start()  # It ends where its disk is full.
            self.finish(f, job)


class SwiftTest(S3Cases, unittest.TestCase):
    server_class = servers.Swift


if __name__ == "__main__":
    unittest.main(verbosity=2)
