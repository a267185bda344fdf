#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The autoscaler with a real Slurm of virtual nodes: a pool from nothing to eight workers and back,
and faults of Slurm during jobs, after each of which the image must have the same SHA-256.

    tests/engines/slurm/run                     # installs Slurm, then runs this
    tests/engines/slurm/run --times 5 --kind scancel
"""
import argparse
import json
import logging
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(HERE)))
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "integration")]

import farm as farms  # noqa: E402
from cluster import SLURMD_TIMEOUT_SECONDS, Cluster  # noqa: E402

WORKERS_MAX = 8
COOL_DOWN_SECONDS = 20
LOOK_SECONDS = 1
FIRST_LEASE_SECONDS_MAX = 15
POOL_TASKS = 200
JOB_SECONDS_MAX = 300

SCENE = """LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" [40]
Film "rgb" "integer xresolution" [64] "integer yresolution" [64]
Sampler "zsobol" "integer pixelsamples" [64]
WorldBegin
LightSource "infinite" "rgb L" [0.6 0.7 1]
Material "diffuse" "rgb reflectance" [0.5 0.4 0.3]
Shape "sphere" "float radius" [1]
"""
TILES = 4  # Each has 32 x 32 pixels.


class SlurmFarm:
    """A coordinator, a cluster and an autoscaler."""

    def __init__(self, package):
        self.cluster, self.farm = Cluster(WORKERS_MAX), farms.Farm(["--lease-seconds", "10"])
        self._package, self._autoscaler = package, None
        self.operator_resumes = 0

    def __enter__(self):
        self.cluster.__enter__()
        try:
            self.farm.__enter__()
            self.scene = self.farm.path("scene.pbrt")
            with open(self.scene, "w", encoding="utf-8") as file:
                file.write(SCENE)
            self.start_autoscaler()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        self.stop_autoscaler()
        self.farm.__exit__()
        self.cluster.__exit__()

    def start_autoscaler(self):
        with open(self.farm.path("autoscaler.log"), "ab") as log:
            self._autoscaler = subprocess.Popen(
                [sys.executable, "-m", "sheaf_autoscaler", "--engine", "slurm", "--coordinator",
                 self.farm.address, "--threads", "1", "--max", str(WORKERS_MAX),
                 "--cool-down", f"{COOL_DOWN_SECONDS}s", "--queue-time", "2s",
                 "--look-every", f"{LOOK_SECONDS}s", "--worker",
                 os.path.join(farms.programs(), "sheaf-worker"),
                 "--cache-dir", self.cluster.path("cache", "$SLURMD_NODENAME"),
                 "--slurm-partition", "render", "--slurm-output", self.cluster.path("workers.log")],
                env=dict(self.cluster.environment, PYTHONPATH=self._package),
                stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def stop_autoscaler(self):
        if self._autoscaler is not None and self._autoscaler.poll() is None:
            self._autoscaler.kill()  # It has no state to save.
            self._autoscaler.wait()

    def submit(self, blocks, pass_samples):
        """A job of TILES * blocks tasks."""
        return self.farm.sheaf("submit", self.scene, "--samples", blocks * pass_samples,
                               "--pass-samples", pass_samples, "--lease-passes", 1).stdout.strip()

    def job(self, name):
        return json.loads(self.farm.sheaf("show", name, "--json").stdout)

    def wait(self, name, seconds=JOB_SECONDS_MAX):
        """Returns the digest of its image."""
        def ended():
            self.operator_resumes += len(self.cluster.resume_drained())
            time.sleep(0.3)
            found = self.job(name)
            return found if found["state"] in ("succeeded", "failed", "cancelled") else None
        try:
            job = farms.wait_until(ended, seconds, f"the end of {name}")
        except AssertionError:
            print(self.farm.log("autoscaler")[-3000:], self.farm.sheaf("workers").stdout,
                  self.cluster.run("squeue", check=False).stdout, self.cluster.states())
            raise
        if job["state"] != "succeeded":
            raise AssertionError(f"{name}: {job['state']}: {job.get('failure')}")
        return job["frames"][0]["image_digest"]


def play_pool(slurm):
    """From nothing to eight workers and back; returns what was measured, as lines."""
    begin = time.monotonic()
    job = slurm.submit(POOL_TASKS // TILES, 256)
    submitted, first_lease, most, most_at, gone = time.monotonic(), None, 0, 0.0, None
    ended = None
    while gone is None:
        now = time.monotonic()
        if first_lease is None and slurm.farm.metrics()["sheaf_leases_granted_total"] > 0:
            first_lease = now
        running = len(slurm.cluster.tasks())
        if running > most:
            most, most_at = running, now - submitted
        if ended is None and slurm.job(job)["state"] == "succeeded":
            ended = now
        if ended is not None and running == 0:
            gone = now
        if now - begin > 2 * JOB_SECONDS_MAX:
            print(slurm.farm.log("autoscaler")[-3000:])
            raise AssertionError("the pool did not come back to nothing")
        time.sleep(0.2)
    assert first_lease is not None
    lines = [("tasks", f"{slurm.farm.metrics()['sheaf_results_accepted_total']:.0f}", ""),
             ("workers", f"0 > {most} > 0", f"0 > {WORKERS_MAX} > 0"),
             ("eight after, s", f"{most_at:.1f}", ""),
             ("submit to first lease, s", f"{first_lease - submitted:.1f}",
              f"< {FIRST_LEASE_SECONDS_MAX}"),
             ("end of the job to no workers, s", f"{gone - ended:.1f}",
              f"cool-down {COOL_DOWN_SECONDS}, and 5 to stop")]
    ok = (most == WORKERS_MAX and first_lease - submitted < FIRST_LEASE_SECONDS_MAX
          and gone - ended <= COOL_DOWN_SECONDS + 5)
    return lines, ok


# Faults. Each gets the farm and a running task with its node, and returns when it has happened.

def scancel(slurm, task, _):
    slurm.cluster.run("scancel", task)


def requeue(slurm, task, _):
    slurm.cluster.run("scontrol", "requeue", task)


def node_down(slurm, _, node):
    slurm.cluster.kill_node(node)
    time.sleep(SLURMD_TIMEOUT_SECONDS + random.uniform(1, 4))
    slurm.cluster.start_node(node)


def slurmctld_killed(slurm, *_):
    slurm.cluster.kill_controller()
    time.sleep(random.uniform(0.5, 4))
    slurm.cluster.start_controller()


def preempted(slurm, _, node):
    """A job of a partition of higher priority takes the node."""
    slurm.cluster.run("sbatch", "-p", "urgent", "-w", node, "--output=/dev/null",
                      "--wrap", "sleep 3")


def autoscaler_killed(slurm, *_):
    slurm.stop_autoscaler()
    time.sleep(random.uniform(0, 2))
    slurm.start_autoscaler()


KINDS = {"scancel": scancel, "node down": node_down, "requeue": requeue,
         "slurmctld killed": slurmctld_killed, "preempted": preempted,
         "autoscaler killed": autoscaler_killed}
# Slurm's notice reaches the worker, which returns its tasks: none is lost to a lease's end.
GENTLE = ("scancel", "requeue", "preempted")


def play_fault(slurm, kind, blocks, expected):
    """Returns (seconds of the job, whether the image is right, workers lost)."""
    lost = slurm.farm.metrics()["sheaf_workers_lost_total"]
    begin = time.monotonic()
    name = slurm.submit(blocks, 256)
    farms.wait_until(lambda: slurm.cluster.tasks() and slurm.job(name)["state"] != "queued",
                     JOB_SECONDS_MAX, "a worker with a task")
    time.sleep(random.uniform(0, 1.5))
    tasks = slurm.cluster.tasks()
    if tasks:
        task = random.choice(sorted(tasks))
        KINDS[kind](slurm, task, tasks[task])
    digest = slurm.wait(name)
    return (time.monotonic() - begin, digest == expected,
            slurm.farm.metrics()["sheaf_workers_lost_total"] - lost)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--times", type=int, default=20, help="of each kind of fault")
    parser.add_argument("--kind", action="append", choices=sorted(KINDS))
    parser.add_argument("--blocks", type=int, default=24,
                        help=f"of samples of a fault's job, of {TILES} tasks each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=600, help="no fault begins later")
    options = parser.parse_args()
    random.seed(options.seed)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))  # Ends the cluster, too.
    logging.basicConfig(level=logging.WARNING)
    package = tempfile.mkdtemp(prefix="sheaf-package-")
    subprocess.run([sys.executable, "setup.py", "-q", "build", "--build-base", package,
                    "--build-lib", os.path.join(package, "lib")],
                   cwd=os.path.join(ROOT, "python"), check=True, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60 * options.minutes
    ok = True
    try:
        with SlurmFarm(os.path.join(package, "lib")) as slurm:
            lines, ok = play_pool(slurm)
            for what, found, limit in lines:
                print(f"| {what} | {found} | {limit} |", flush=True)
            ok &= play_faults(slurm, options, end)
    finally:
        shutil.rmtree(package, ignore_errors=True)
    print("passed" if ok else "FAILED")
    return 0 if ok else 1


def play_faults(slurm, options, end):
    expected = slurm.wait(slurm.submit(options.blocks, 256))
    kinds = options.kind or list(KINDS)
    results = {kind: [] for kind in kinds}
    for _ in range(options.times):
        for kind in kinds:  # In turns.
            if time.monotonic() < end:
                results[kind].append(play_fault(slurm, kind, options.blocks, expected))
                print(kind, *results[kind][-1], file=sys.stderr, flush=True)
    print("| fault | times | image equal | workers lost | job s, median | max |", flush=True)
    print("|---|---|---|---|---|---|")
    ok = True
    for kind, found in results.items():
        if not found:
            continue
        equal = sum(right for _, right, _ in found)
        lost = sum(lost for _, _, lost in found)
        seconds = [taken for taken, _, _ in found]
        print(f"| {kind} | {len(found)} | {equal} | {lost:.0f} | "
              f"{statistics.median(seconds):.1f} | {max(seconds):.1f} |")
        ok &= equal == len(found) and (lost == 0 or kind not in GENTLE)
    print(f"nodes that had to be resumed by hand: {slurm.operator_resumes}")
    return ok


if __name__ == "__main__":
    sys.exit(main())
