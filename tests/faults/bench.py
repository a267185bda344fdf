# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""One farm in which faults happen to small jobs, one job per fault, with the accounts of each.

A kind of fault is a function that gets a Bench: it begins a job, causes the fault within
`with bench.fault():`, and heals it there. The bench then follows the job to its end.
"""
import collections
import contextlib
import dataclasses
import hashlib
import json
import os
import random
import signal
import sqlite3
import statistics
import subprocess
import sys
import time
import traceback
from urllib.error import URLError
from urllib.request import urlopen

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "integration"))
import farm  # pylint: disable=wrong-import-position
from damaged_files import SCENE, write_scene  # pylint: disable=wrong-import-position
from machine_faults import MachineFaults  # pylint: disable=wrong-import-position

# A fraction of a second on two threads, in 32 parts.
SAMPLES, PASS_SAMPLES = 128, 32
JOB = ("--crop", "16,16,80,48", "--tile-size", "16", "--pass-samples", PASS_SAMPLES,
       "--lease-passes", "1", "--samples", SAMPLES)
PARTS = (64 // 16) * (32 // 16) * (SAMPLES // PASS_SAMPLES)
LEASE_SECONDS = 1
JOB_SECONDS_MAX = 60
UNDISTURBED_JOBS = 5
WORKERS = 2
COORDINATOR_ARGUMENTS = ("--lease-seconds", str(LEASE_SECONDS), "--kept-parts-max", "64MB",
                         "--round-previews-max", "1MB", "--poison-workers", str(WORKERS))


class NotSurvived(Exception):
    """The job did not end with its image."""


@dataclasses.dataclass
class Outcome:
    """The outcome of one job with one fault."""
    survived: bool = False
    told: bool = False          # Whether the coordinator or a client named the fault.
    hash_equal: bool = False
    recovery_seconds: float = 0.0  # Beyond those of an undisturbed job and the fault.
    repeated: float = 0.0       # Leases beyond those of an undisturbed job, as a fraction.
    lost: int = 0               # Acknowledged parts that were not there after a restart.
    twice: int = 0              # Samples that two parts hold.
    problem: str = ""


@dataclasses.dataclass(frozen=True)
class Undisturbed:
    """Medians of jobs without a fault."""
    seconds: float
    leases: float


class Bench:
    """Use with `with`. Thread safety: none."""

    def __init__(self, library, seed, farm_class=farm.Farm, undisturbed=None,
                 undisturbed_jobs=UNDISTURBED_JOBS):
        """undisturbed: of an earlier farm of this class; None: it is measured by that many jobs."""
        self.library = library
        self.farm_class = farm_class
        self.undisturbed = undisturbed
        self.undisturbed_jobs = undisturbed_jobs
        self.random = random.Random(seed)
        self.scene_number = 0
        self.digests = {}  # Digests of pixels, by the digest of the file.
        self.worker_names = {}  # Names of their logs, by process id.
        self.stack = contextlib.ExitStack()

    def __enter__(self):
        with self.stack:
            self._start()
            self.stack = self.stack.pop_all()
        return self

    def __exit__(self, *error):
        return self.stack.__exit__(*error)

    def _start(self):
        f = self.farm = self.farm_class(COORDINATOR_ARGUMENTS)
        self.faults = MachineFaults(self.library, f.path("coordinator.faults"))
        self.worker_faults = MachineFaults(self.library, f.path("worker.faults"))
        self.prepare_folder()
        f.environment.update(self.faults.environment)
        self.stack.enter_context(f)
        for _ in range(WORKERS):
            self.start_worker()
        self.scene, self.texture = write_scene(f.folder)
        farm.render(self.scene, f.path("expected.exr"), *JOB)
        self.expected = farm.image_digest(f.path("expected.exr"))
        first = self._run_undisturbed()  # Workers have the scene from then on.
        if self.undisturbed is None:
            outcomes = [first] + [self._run_undisturbed() for _ in range(self.undisturbed_jobs - 1)]
            self.undisturbed = Undisturbed(*map(statistics.median, zip(*outcomes)))

    def prepare_folder(self):
        """Called once, before the farm starts; for file systems mounted there."""

    def _run_undisturbed(self):
        """Returns its seconds and leases."""
        outcome = self.run(lambda bench: bench.begin(progress=False))
        assert outcome.survived, "an undisturbed job: " + outcome.problem
        return self.job_seconds, self.granted

    # One occurrence.

    def run(self, fault):
        """Causes a fault to a job, and follows the job to its end."""
        self.outcome = Outcome()
        self.job = self.watch = None
        self.fault_seconds = 0.0
        self.granted = 0
        scene = self.scene
        try:
            self.granted_at_begin = self._granted_now()
            fault(self)
            self._finish()
            self._check_workers()
        except (AssertionError, NotSurvived, OSError, sqlite3.Error,
                subprocess.SubprocessError) as error:
            self.outcome.problem = "".join(traceback.format_exception_only(error)).strip()
        finally:
            if self.watch is not None and self.watch.poll() is None:
                self.watch.kill()
                self.watch.wait()
            self.scene = scene
            self.faults.set()
            self.worker_faults.set()
        return self.outcome

    def begin(self, progress=True):
        """Submits a job, lets a client follow it, and lets a part of it be rendered."""
        self.begin_time = time.monotonic()
        self.job = self.submit()
        self.follow()
        if progress:
            wanted = self.random.randrange(1, PARTS * 2 // 3)
            farm.wait_until(lambda: len(self.acknowledged()) >= wanted, JOB_SECONDS_MAX, "parts")

    def submit(self, scene=None):
        done = self.farm.sheaf("submit", scene or self.scene, *JOB, "--json")
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def follow(self):
        output = self.farm.path("out.exr")
        with contextlib.suppress(FileNotFoundError):
            os.remove(output)
        environment = dict(os.environ, SHEAF_COORDINATOR=self.farm.address)
        self.watch = subprocess.Popen(
            [os.path.join(farm.programs(), "sheaf"), "watch", self.job, "-o", output],
            env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True)

    def new_scene(self):
        """Another scene with the same image, which no worker has yet."""
        self.scene_number += 1
        path = self.farm.path(f"scene{self.scene_number}.pbrt")
        with open(path, "w", encoding="utf-8") as file:
            file.write(SCENE + f"# {self.scene_number}\n")
        return path

    @contextlib.contextmanager
    def fault(self):
        """Encloses the fault, from its cause until it is healed."""
        begin = time.monotonic()
        yield
        self.fault_seconds += time.monotonic() - begin

    def pause(self, least, most):
        time.sleep(self.random.uniform(least, most))

    def tell(self, told, what=""):
        """Notes whether the farm reported the fault; what: names it in the error if it had to."""
        self.outcome.told = self.outcome.told or bool(told)
        if what:
            assert told, "no program reports " + what

    def _finish(self):
        deadline = time.monotonic() + JOB_SECONDS_MAX * farm.PATIENCE
        while True:
            try:
                said, _ = self.watch.communicate(timeout=max(0.1, deadline - time.monotonic()))
            except subprocess.TimeoutExpired as expired:
                raise NotSurvived(f"{self.job} did not end") from expired
            if self.watch.returncode == 0:
                break
            if time.monotonic() > deadline or "failed" in said:
                raise NotSurvived(f"{self.job}: {said[-500:]}")
            self.tell(said.strip())
            time.sleep(0.02)
            self.follow()
        self.job_seconds = time.monotonic() - self.begin_time
        self.outcome.hash_equal = self._digest(self.farm.path("out.exr")) == self.expected
        self.outcome.survived = self.outcome.hash_equal
        if not self.outcome.hash_equal:
            self.outcome.problem = "another image"
        self._account()

    def _check_workers(self):
        """A worker that no fault has killed is alive still."""
        dead = self.replace_dead_workers()
        if dead:
            self.outcome.survived = False
            self.outcome.problem = "workers ended by themselves: " + "; ".join(
                f"code {worker.returncode}, "
                f"{self.farm.log(self.worker_names[worker.pid]).splitlines()[-1:]}"
                for worker in dead)

    def _digest(self, path):
        """The digest of the pixels; of files with the same bytes it is computed once."""
        key = hashlib.sha256(farm.read_bytes(path)).digest()
        if key not in self.digests:
            self.digests[key] = farm.image_digest(path)
        return self.digests[key]

    def _account(self):
        self.granted += self._granted_now() - self.granted_at_begin
        if self.undisturbed is not None:
            self.outcome.recovery_seconds = max(
                0.0, self.job_seconds - self.fault_seconds - self.undisturbed.seconds)
            self.outcome.repeated = max(0, self.granted - self.undisturbed.leases) / PARTS
        covered = collections.Counter()
        for _, x, y, first, count, kind in self.acknowledged():
            covered.update((x, y, kind, sample) for sample in range(first, first + count))
        self.outcome.twice = sum(times - 1 for times in covered.values())

    # Answers of the farm.

    def acknowledged(self):
        return self.farm.acknowledged(self.job)

    def metric(self, name):
        return self.farm.metrics().get(name, 0)

    def _granted_now(self):
        """Leases granted since the coordinator's start; 0 where it does not answer."""
        try:
            return self.metric("sheaf_leases_granted_total")
        except (URLError, OSError):
            return 0

    def failures(self):
        url = f"http://{self.farm.http}/api/v1/{self.job}/failures"
        return urlopen(url, timeout=100).read().decode()

    def waiting_reason(self):
        return json.loads(self.farm.sheaf("show", self.job, "--json").stdout)["waiting_reason"]

    # Starts and ends of processes.

    def start_worker(self):
        """One whose faults are those of workers, not the coordinator's."""
        environment = dict(self.farm.environment)
        self.farm.environment.update(self.worker_faults.environment)
        worker = self.farm.start_worker("--log-level", "debug")
        self.worker_names[worker.pid] = f"worker{self.farm.worker_count}"
        self.farm.environment = environment
        return worker

    def replace_dead_workers(self):
        """Starts others for those that have ended, and returns these."""
        dead = [worker for worker in self.farm.workers if worker.poll() is not None]
        for worker in dead:
            self.farm.workers.remove(worker)
            self.start_worker()
        return dead

    def any_worker(self):
        return self.random.choice(self.farm.workers)

    def kill_coordinator(self):
        self.granted += self._granted_now() - self.granted_at_begin
        self.granted_at_begin = 0
        self.farm.kill(self.farm.coordinator)

    def stop_coordinator(self):
        """Ends it as an administrator does: its database is whole in one file then."""
        self.granted += self._granted_now() - self.granted_at_begin
        self.granted_at_begin = 0
        self.farm.coordinator.send_signal(signal.SIGTERM)
        self.farm.coordinator.wait(timeout=30 * farm.PATIENCE)

    def await_death(self, process, seconds=20):
        """Returns whether the process ended by itself."""
        try:
            process.wait(timeout=seconds * farm.PATIENCE)
            return True
        except subprocess.TimeoutExpired:
            return False

    def restart_coordinator(self):
        """Starts one that is not running. It must still have all acknowledged parts."""
        before = self.acknowledged()
        self.faults.set()
        self.farm.start_coordinator()
        self.outcome.lost += len(before - self.acknowledged())
