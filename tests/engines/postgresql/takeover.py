#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Two coordinators on one PostgreSQL database: the owner of the farm is killed at random moments,
and the database crashes and starts again. No image may differ from that of one process, no
acknowledged result may be lost or merged twice, and the other coordinator must grant its first
lease within five seconds.

    tests/engines/postgresql/install                 # once, as root
    tests/engines/postgresql/takeover.py             # 50 kills, 10 restarts of the database
    tests/engines/postgresql/takeover.py --kills 2 --restarts 1 --seed 7
    SHEAF_TIME_SCALE=3 tests/engines/postgresql/takeover.py --minutes 11   # on a busy machine

The whole takes some six minutes on a machine that does nothing else. With --minutes it begins no
more faults after that time; it then fails, and says how many it caused and what they showed.
"""
import argparse
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from urllib.error import URLError
from urllib.request import urlopen

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "..", "integration")]
import farm  # noqa: E402
import postgres  # noqa: E402

SCENE = os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
SAMPLES = 256
JOB = ("--crop", "200,80,456,272", "--samples", str(SAMPLES), "--tile-size", "32",
       "--pass-samples", "16", "--lease-passes", "1")
TAKEOVER_SECONDS_MAX = 5
# Unfinished jobs, so that there is work whenever a coordinator is killed.
LIVE_JOBS = 4
WORKERS = 2
NOT_BELOW_SECONDS, NOT_ABOVE_SECONDS = 0.1, 1.5  # Between two faults.


class SharedFarm:
    """Two coordinators with one database and one state directory, and workers that know both."""

    def __init__(self, server, with_database_arguments=()):
        self.server = server
        self.arguments = list(with_database_arguments)
        self.folder = tempfile.mkdtemp(prefix="sheaf takeover ")
        self.ports = [(farm.free_port(), farm.free_port()) for _ in range(2)]
        self.addresses = ",".join(f"127.0.0.1:{grpc}" for grpc, _ in self.ports)
        self.coordinators = [None, None]
        self.workers = []
        self.stopped_themselves = 0

    def __enter__(self):
        for index in range(2):
            self.start(index)
        for number in range(WORKERS):
            self.workers.append(self._start(f"worker{number}", "sheaf-worker", "--coordinator",
                                            self.addresses, "--threads", "1", "--cache-dir",
                                            self.path("cache")))
        return self

    def __exit__(self, *_):
        for process in self.workers + self.coordinators:
            if process and process.poll() is None:
                process.kill()
                process.wait()
        if os.environ.get("SHEAF_KEEP"):
            print("kept", self.folder)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)

    def path(self, name):
        return os.path.join(self.folder, name)

    def _start(self, name, program, *arguments):
        with open(self.path(name + ".log"), "ab") as log:
            return subprocess.Popen([os.path.join(farm.programs(), program), *arguments],
                                    stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def port_file(self, index):
        return self.path(f"ports{index}")

    def start(self, index):
        if os.path.exists(self.port_file(index)):
            os.remove(self.port_file(index))
        grpc, http = self.ports[index]
        self.coordinators[index] = self._start(
            f"coordinator{index}", "sheaf-coordinator", "--listen", f"127.0.0.1:{grpc}", "--http",
            f"127.0.0.1:{http}", "--state-dir", self.path("state"), "--database", self.server.url,
            "--lease-seconds", "2", "--port-file", self.port_file(index), *self.arguments)

    def revive(self, indices=(0, 1)):
        """Starts coordinators that stopped themselves, as a service manager does."""
        for index in indices:
            if self.coordinators[index].poll() is not None:
                self.stopped_themselves += 1
                self.start(index)

    def owner(self):
        """The number of the coordinator that serves, or None."""
        for index, process in enumerate(self.coordinators):
            if process.poll() is None and os.path.exists(self.port_file(index)):
                return index
        return None

    def wait_for_owner(self):
        def found():
            self.revive()
            owner = self.owner()
            return None if owner is None else (owner,)
        return farm.wait_until(found, 60, "a coordinator that serves")[0]

    def metric(self, index, name):
        try:
            text = urlopen(f"http://127.0.0.1:{self.ports[index][1]}/metrics",
                           timeout=5).read().decode()
        except (URLError, OSError):
            return 0
        return sum(float(line.split()[1]) for line in text.splitlines()
                   if line.startswith(name + " "))

    def acknowledged(self, job=None):
        where = f" WHERE job_id = {job.rpartition('/')[2]}" if job else ""
        return {tuple(map(int, row)) for row in self.server.rows(
            "SELECT job_id, frame_number, x0, y0, first, count, kind FROM sheaf_jobs.parts"
            + where)}

    def acknowledged_count(self):
        return int(self.server.rows("SELECT count(*) FROM sheaf_jobs.parts")[0][0])

    def sheaf(self, *arguments):
        environment = dict(os.environ, SHEAF_COORDINATOR=self.addresses, SHEAF_NO_QUOTE="1")
        done = subprocess.run([os.path.join(farm.programs(), "sheaf"), *map(str, arguments)],
                              env=environment, stdin=subprocess.DEVNULL, capture_output=True,
                              text=True, timeout=farm.JOB_SECONDS_MAX * farm.PATIENCE)
        if done.returncode != 0:
            raise AssertionError(f"sheaf {' '.join(map(str, arguments))}: {done.returncode}\n"
                                 f"{done.stdout}{done.stderr}")
        return done.stdout


class Run:
    def __init__(self, f, choice):
        self.farm = f
        self.choice = choice
        self.jobs = []
        self.takeover_seconds = []
        self.restart_seconds = []
        self.lost = 0
        self.begin = time.monotonic()

    def minutes(self):
        return (time.monotonic() - self.begin) / 60

    def say(self, text):
        print(f"{self.minutes():6.2f} min  {text}", flush=True)

    def cause(self, faults, minutes_max):
        for number, fault in enumerate(faults, 1):
            if self.minutes() > minutes_max:
                self.say(f"no further faults after {minutes_max} minutes")
                return
            seconds = self.kill_owner() if fault == "kill" else self.restart_database()
            self.say(f"fault {number} of {len(faults)}, {fault}: work after {seconds:.2f} s")

    def keep_busy(self, owner):
        live = int(self.farm.metric(owner, "sheaf_jobs_live"))
        for _ in range(LIVE_JOBS - live):
            submitted = self.farm.sheaf("submit", SCENE, *JOB, "--json")
            self.jobs.append(json.loads(submitted.splitlines()[-1])["name"])

    def pause(self):
        time.sleep(self.choice.uniform(NOT_BELOW_SECONDS, NOT_ABOVE_SECONDS))

    def kill_owner(self):
        """Returns the seconds until the other's first lease."""
        owner = self.farm.wait_for_owner()
        self.keep_busy(owner)
        self.pause()
        before = self.farm.acknowledged()
        killed = time.monotonic()
        self.farm.coordinators[owner].kill()
        self.farm.coordinators[owner].wait()
        os.remove(self.farm.port_file(owner))
        other = 1 - owner

        def has_leased():
            self.farm.revive([other])
            if self.farm.metric(other, "sheaf_leases_granted_total") > 0:
                return True
            # Workers may have held all that was left, and delivered it since.
            if self.farm.owner() == other and not self.farm.metric(other, "sheaf_jobs_live"):
                self.keep_busy(other)
            return False
        farm.wait_until(has_leased, 60, "the other coordinator's first lease")
        self.takeover_seconds.append(time.monotonic() - killed)
        self.lost += len(before - self.farm.acknowledged())
        self.farm.start(owner)
        return self.takeover_seconds[-1]

    def restart_database(self):
        """Returns the seconds until the next result."""
        self.keep_busy(self.farm.wait_for_owner())
        self.pause()
        before = self.farm.acknowledged()
        ended = time.monotonic()
        self.farm.server.end(signal.SIGQUIT)
        time.sleep(self.choice.uniform(0, 1))
        self.farm.server.start()

        def more_results():
            self.farm.revive()
            if self.farm.acknowledged_count() > len(before):
                return True
            owner = self.farm.owner()
            if owner is not None and not self.farm.metric(owner, "sheaf_jobs_live"):
                self.keep_busy(owner)  # All had arrived before the crash.
            return False
        farm.wait_until(more_results, 60, "results after a restart of the database")
        self.restart_seconds.append(time.monotonic() - ended)
        self.lost += len(before - self.farm.acknowledged())
        return self.restart_seconds[-1]

    def finish(self, expected_file):
        """Returns (images that are equal, jobs with samples merged twice or missing)."""
        equal = wrong = 0
        for job in self.jobs:
            output = self.farm.path("out.exr")
            self.farm.sheaf("watch", job, "-o", output)
            if farm.read_bytes(output) == expected_file:
                equal += 1
            else:
                print(f"{job}: the image's SHA-256 is {farm.image_digest(output)}")
            os.remove(output)
            try:
                samples = farm.samples_by_tile(row[1:] for row in self.farm.acknowledged(job))
                wrong += any(len(s) != SAMPLES for s in samples.values())
            except AssertionError as error:
                print(job, error)
                wrong += 1
            self.say(f"{job} is compared, of {len(self.jobs)}")
        return equal, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--restarts", type=int, default=10)
    parser.add_argument("--seed", type=int, default=time.time_ns() % 1_000_000)
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="of faults; the jobs that are then unfinished come on top")
    arguments = parser.parse_args()
    if postgres.programs() is None:
        print("skipped: PostgreSQL's server is not installed (tests/engines/postgresql/install)")
        return 0
    print(f"--seed {arguments.seed}", flush=True)
    choice = random.Random(arguments.seed)
    faults = ["kill"] * arguments.kills + ["restart"] * arguments.restarts
    choice.shuffle(faults)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "expected.exr")
        farm.render(SCENE, path, *JOB)
        expected, expected_file = farm.image_digest(path), farm.read_bytes(path)
    print(f"the image's SHA-256 is {expected}", flush=True)
    with postgres.Server() as server, SharedFarm(server) as f:
        run = Run(f, choice)
        run.cause(faults, arguments.minutes)
        f.wait_for_owner()
        equal, wrong = run.finish(expected_file)
    slowest = max(run.takeover_seconds, default=0)
    print(f"{len(run.takeover_seconds)} kills of the owner: first lease of the other after "
          f"{statistics.median(run.takeover_seconds or [0]):.2f} s (median), {slowest:.2f} s "
          f"(maximum; limit {TAKEOVER_SECONDS_MAX} s)")
    print(f"{len(run.restart_seconds)} crashes of the database: next result after "
          f"{statistics.median(run.restart_seconds or [0]):.2f} s (median), "
          f"{max(run.restart_seconds, default=0):.2f} s (maximum); coordinators that stopped "
          f"themselves: {f.stopped_themselves}")
    print(f"{len(run.jobs)} jobs: {equal} images equal to the bit, {wrong} with samples merged "
          f"twice or missing, {run.lost} acknowledged results lost")
    caused = len(run.takeover_seconds) + len(run.restart_seconds)
    print(f"{caused} of {len(faults)} faults in {run.minutes():.1f} minutes")
    good = equal == len(run.jobs) and wrong == run.lost == 0 and caused == len(faults)
    return 0 if good and slowest < TAKEOVER_SECONDS_MAX * farm.TIME_SCALE else 1


if __name__ == "__main__":
    sys.exit(main())
