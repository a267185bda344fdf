# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A farm of real processes on loopback, for tests: starts, kills and restarts them.

The test is the parent of every daemon, so a killed daemon is reaped here and its port is free
again.
"""
import contextlib
import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
START_SECONDS_MAX = 30
JOB_SECONDS_MAX = 300
# How much slower than on an idle machine programs may be; builds with sanitizers set it.
TIME_SCALE = float(os.environ.get("SHEAF_TIME_SCALE", "1"))
# Factor from what an event or a program takes on an idle machine to the limit of waiting for it,
# which only ends what hangs.
PATIENCE = 10 * TIME_SCALE
# Whether long forms run as well: tests/run --all.
ALL_TESTS = os.environ.get("SHEAF_ALL_TESTS", "") == "1"


def programs():
    """Folder of the built programs: SHEAF_BIN, which ctest sets."""
    folder = os.environ.get("SHEAF_BIN", os.path.join(ROOT, "build", "release", "bin"))
    if not os.path.exists(os.path.join(folder, "sheaf")):
        sys.exit(f"no programs in {folder}: build first, or set SHEAF_BIN")
    return folder


def public_scenes():
    """Folder of third-party scenes from SHEAF_PUBLIC_SCENES, or None if it is not set."""
    folder = os.environ.get("SHEAF_PUBLIC_SCENES", "")
    return folder if os.path.isdir(folder) else None


def wait_until(condition, seconds, what):
    seconds *= PATIENCE
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {seconds} s: {what}")


def free_port():
    """A loopback port on which no program listens now."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


TASK_KIND_LIGHT = 1  # As the store numbers them.


class Farm:
    """A coordinator and workers with a temporary folder; use with `with`."""

    def __init__(self, coordinator_arguments=()):
        self.folder = tempfile.mkdtemp(prefix="sheaf farm ")  # Paths may contain a space.
        self.coordinator_arguments = list(coordinator_arguments)
        self.coordinator = None
        self.workers = []
        self.host = "127.0.0.1"
        self.address = self.http = self.host + ":0"
        self.coordinator_prefix = []  # Commands that run the programs, as "ip netns exec NAME".
        self.client_prefix = []
        self.worker_count = 0
        self.environment = dict(os.environ)  # For all programs.
        self.log_file = None  # Where all programs write their logs: a file of each by default.

    def __enter__(self):
        try:
            self.start_coordinator()
        except BaseException:  # Python does not call __exit__ if __enter__ has failed.
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in self.workers + [self.coordinator]:
            if process and process.poll() is None:
                if os.environ.get("SHEAF_ORDERLY_END"):
                    process.terminate()
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        process.wait(START_SECONDS_MAX)
                process.kill()
                process.wait()
        if os.environ.get("SHEAF_KEEP"):
            print("kept", self.folder)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def log(self, name):
        with open(self.path(name + ".log"), encoding="utf-8", errors="replace") as f:
            return f.read()

    def _start(self, name, arguments):
        log = open(self.log_file or self.path(name + ".log"), "ab")
        process = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                   env=self.environment)
        log.close()
        return process

    def start_coordinator(self):
        """Starts the coordinator; restarts use the same ports, so that workers find it again."""
        port_file = self.path("ports")
        if os.path.exists(port_file):
            os.remove(port_file)
        self.coordinator = self._start("coordinator", [
            *self.coordinator_prefix, os.path.join(programs(), "sheaf-coordinator"),
            "--listen", self.address, "--http", self.http, "--state-dir", self.path("state"),
            "--port-file", port_file, *self.coordinator_arguments])

        def ports():
            if self.coordinator.poll() is not None:
                raise AssertionError("coordinator ended:\n" + self.log("coordinator"))
            try:
                with open(port_file, encoding="utf-8") as f:
                    found = dict(line.strip().split("=") for line in f)
            except FileNotFoundError:
                return None
            return found if len(found) == 2 else None

        found = wait_until(ports, START_SECONDS_MAX, "coordinator's port file")
        self.address = f"{self.host}:{found['grpc']}"
        self.http = f"{self.host}:{found['http']}"

    def start_worker(self, *arguments, threads=1, cache="cache"):
        """cache: the name of its folder of scene files; by default workers share one."""
        self.worker_count += 1
        process = self._start(f"worker{self.worker_count}", [
            *self.client_prefix, os.path.join(programs(), "sheaf-worker"),
            "--coordinator", self.address, "--threads", str(threads),
            "--cache-dir", self.path(cache), *arguments])
        self.workers.append(process)
        return process

    def kill(self, process):
        process.send_signal(signal.SIGKILL)
        process.wait()
        if process in self.workers:
            self.workers.remove(process)

    def sheaf(self, *arguments, check=True, seconds=JOB_SECONDS_MAX, quote=False):
        """quote: whether a submission quotes its price, which creates pilot jobs."""
        environment = dict(self.environment, SHEAF_COORDINATOR=self.address,
                           SHEAF_NO_QUOTE="0" if quote else "1")
        command = [*self.client_prefix, os.path.join(programs(), "sheaf"), *map(str, arguments)]
        done = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=seconds * PATIENCE)
        if check and done.returncode != 0:
            raise AssertionError(f"sheaf {' '.join(map(str, arguments))}: exit code "
                                 f"{done.returncode}\n{done.stdout}{done.stderr}\n"
                                 + self.log("coordinator")[-2000:])
        return done

    def acknowledged(self, job=None):
        """Keys of all results that the coordinator has acknowledged, read from its store: (frame,
        x0, y0, first sample, count, kind of task). job: those of "jobs/7" alone.
        """
        path = self.path("state", "farm.db")
        with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as db:
            return set(db.execute("SELECT frame_number, x0, y0, first, count, kind FROM parts "
                                  "WHERE ? IS NULL OR job_id = ?",
                                  (job, job and int(job.rpartition("/")[2]))))

    def metrics(self):
        """Prometheus samples by name with labels, as floats."""
        from urllib.request import urlopen
        text = urlopen(f"http://{self.http}/metrics", timeout=10 * PATIENCE).read().decode()
        samples = re.finditer(r"^(sheaf_\w+(?:\{.*\})?) (\S+)$", text, re.M)
        return {m[1]: float(m[2]) for m in samples}


def samples_by_tile(acknowledged):
    """The samples of each tile in Farm.acknowledged, by (frame, x0, y0, kind of task).
    AssertionError: one is there twice.
    """
    samples = {}
    for frame, x, y, first, count, kind in acknowledged:
        covered = samples.setdefault((frame, x, y, kind), set())
        block = set(range(first, first + count))
        if covered & block:
            raise AssertionError(f"tile {x},{y}: samples acknowledged twice")
        covered |= block
    return samples


def render(scene, output, *arguments, seconds=JOB_SECONDS_MAX):
    """Runs `sheaf render`, which uses a single process."""
    done = subprocess.run([os.path.join(programs(), "sheaf"), "render", scene, "-o", output,
                           *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, timeout=seconds * PATIENCE)
    if done.returncode != 0:
        raise AssertionError(f"sheaf render {scene}: exit code {done.returncode}\n{done.stdout}"
                             f"{done.stderr}")
    return done


def read_bytes(path):
    with open(path, "rb") as file:
        return file.read()


def local(*arguments):
    """The output of a `sheaf` command that needs no farm."""
    return subprocess.run([os.path.join(programs(), "sheaf"), *map(str, arguments)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True,
                          timeout=JOB_SECONDS_MAX * PATIENCE).stdout


def image_digest(path):
    """SHA-256 of the pixels, as printed by `sheaf compare`."""
    return json.loads(compare(path, path))["image_digest"]


def compare(reference, image):
    """The output of `sheaf compare --json`."""
    return local("compare", "--json", reference, image)
