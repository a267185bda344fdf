#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Slow links to a farm, many small jobs, and hostile clients: proper requests always succeed.

SHEAF_TINY_JOBS=1000 runs the long form of the test of many jobs.
"""
import concurrent.futures
import os
import socket
import subprocess
import time
import unittest
from urllib.request import urlopen

import farm
from slow_link import SlowLink

ROUND_TRIPS_MS = (0, 40, 120, 200, 400, 800) if farm.ALL_TESTS else (0, 120)
TLS_ROUND_TRIPS = 2
SCENE_FILES_MAX = 64 * 2  # A worker keeps 64 scenes; a process each, by a socket and a pipe.
TINY_JOBS = int(os.environ.get("SHEAF_TINY_JOBS", "60" if farm.ALL_TESTS else "12"))
HALF_OPEN = 600
USAGE, UNREACHABLE = 2, 3
# A distinct scene for each number.
TINY = """Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 16 "integer yresolution" 16
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 {}]
Shape "sphere"
"""
# Each of its two parts has about 5 MB.
NOISE = """Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 256 "integer yresolution" 128
WorldBegin
LightSource "point" "rgb I" [9 9 9] "point3 from" [0 2 0]
Material "diffuse" "rgb reflectance" [0.5 0.5 0.5]
Shape "sphere" "float radius" 5
"""
THIN_BYTES_PER_SECOND = 700_000


def write_tiny(f, number):
    path = f.path(f"tiny{number}.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(TINY.format(number))
    return path


class NetworkTest(unittest.TestCase):
    def test_every_command_works_over_slow_links(self):
        with concurrent.futures.ThreadPoolExecutor(len(ROUND_TRIPS_MS)) as pool:
            digests = list(pool.map(self.use_farm_over, ROUND_TRIPS_MS))
        self.assertEqual(len(set(digests)), 1)

    def use_farm_over(self, round_trip_ms):
        with farm.Farm() as f, SlowLink(f.address, round_trip_ms / 1000, TLS_ROUND_TRIPS) as link:
            f.address = link.address
            f.start_worker()
            job = f.sheaf("submit", write_tiny(f, 1), "--samples", 4).stdout.strip()
            f.sheaf("watch", job, "-o", f.path("out.exr"))
            self.assertIn(job, f.sheaf("list").stdout, round_trip_ms)
            self.assertEqual(len(f.sheaf("workers", "--json").stdout.splitlines()), 1)
            self.assertNotIn("trying again", f.log("worker1"), round_trip_ms)
            self.assertGreaterEqual(link.connections, 5)
            return farm.image_digest(f.path("out.exr"))

    def test_results_on_a_thin_link_delay_no_heartbeat(self):
        with farm.Farm(["--lease-seconds", "4"]) as f, \
                SlowLink(f.address, 0.04, bytes_per_second=THIN_BYTES_PER_SECOND) as link:
            scene = f.path("noise.pbrt")
            with open(scene, "w", encoding="utf-8") as file:
                file.write(NOISE)
            job = f.sheaf("submit", scene, "--samples", 16, "--tile-size", 128).stdout.strip()
            coordinator, f.address = f.address, link.address
            f.start_worker()
            f.address = coordinator
            f.sheaf("watch", job, "-o", f.path("out.exr"))
            metrics = f.metrics()
            self.assertGreater(metrics["sheaf_parts_bytes"], 8 * THIN_BYTES_PER_SECOND)
            self.assertEqual(metrics["sheaf_workers_lost_total"], 0)
            self.assertEqual(metrics["sheaf_lease_expired_total"], 0)

    def test_tiny_jobs_in_a_row(self):
        """No command fails, and the worker keeps no data of finished jobs."""
        with farm.Farm() as f:
            worker = f.start_worker()
            files_at_first, failed = None, []
            start = time.monotonic()
            for number in range(TINY_JOBS):
                done = f.sheaf("submit", write_tiny(f, number), "--samples", 1, "--wait", "--json",
                               "-o", f.path("tiny.exr"), check=False)
                if done.returncode != 0 or '"succeeded"' not in done.stdout:
                    failed.append((number, done.returncode, done.stderr))
                if number == 5:
                    files_at_first = open_files(worker)
            print(f"{TINY_JOBS} jobs in {time.monotonic() - start:.1f} s, {len(failed)} failed; "
                  f"the worker has {files_at_first}, then {open_files(worker)} files open")
            self.assertEqual(failed, [])
            self.assertLessEqual(open_files(worker), files_at_first + 8 + SCENE_FILES_MAX)

    def test_hosts_without_a_port_get_the_default(self):
        # No program listens at the second loopback address, even if one does at the first.
        for arguments, environment in ((["--coordinator", "127.0.0.2"], {}),
                                       ([], {"SHEAF_COORDINATOR": "127.0.0.2"})):
            environment = dict(os.environ, **environment)
            done = run("sheaf", "list", *arguments, environment=environment)
            self.assertEqual(done.returncode, UNREACHABLE, done.stderr)
            self.assertIn("no coordinator answers at 127.0.0.2:7400: ", done.stderr)
            self.assertIn("no coordinator answers at 127.0.0.2:7400: the connection was refused; "
                          "start one with sheaf-coordinator",
                          self.first_warning_of_a_worker(arguments, environment))
        for wrong in ("::1", "host:", "host:99999", "host:0"):
            for program in (("sheaf", "list"), ("sheaf-worker",)):
                done = run(*program, "--coordinator", wrong)
                self.assertEqual(done.returncode, USAGE, done.stderr)
                self.assertIn("write host:port", done.stderr)

    def first_warning_of_a_worker(self, arguments, environment):
        with farm.Farm() as f:
            worker = subprocess.Popen([os.path.join(farm.programs(), "sheaf-worker"), *arguments,
                                       "--cache-dir", f.path("cache")], env=environment, text=True,
                                      stderr=subprocess.PIPE)
            line = "none yet"
            while line and "trying again" not in line:
                line = worker.stderr.readline()
            worker.kill()
            worker.communicate()
            return line

    def test_half_open_requests_do_not_block_others(self):
        with farm.Farm() as f:
            host, _, port = f.http.rpartition(":")
            sockets = []
            self.addCleanup(lambda: [s.close() for s in sockets])
            for _ in range(HALF_OPEN):
                sockets.append(socket.create_connection((host, int(port)),
                                                        timeout=10 * farm.PATIENCE))
                sockets[-1].sendall(b"GET /healthz HTTP/1.1\r\nHost: local")
            for path in ("/healthz", "/metrics", "/", "/api/v1/jobs"):
                with urlopen(f"http://{f.http}{path}", timeout=farm.PATIENCE) as answer:
                    self.assertEqual(answer.status, 200, path)


def run(program, *arguments, environment=None):
    return subprocess.run([os.path.join(farm.programs(), program), *arguments], text=True,
                          stdin=subprocess.DEVNULL, capture_output=True, env=environment,
                          timeout=30 * farm.PATIENCE)


def open_files(process):
    return len(os.listdir(f"/proc/{process.pid}/fd"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
