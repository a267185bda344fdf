# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Clocks that are set, and memory that is short."""
import contextlib
import os
import resource
import subprocess
import sys

import farm
from control_group import ControlGroup
from kinds import kind
from memory_test import HUGE, ROOM

GROUP_BYTES = 192 << 20  # For what workers and their scenes take beyond what they have.
JUMP_SECONDS = 3 * 3600  # Longer than lost workers are remembered and than any lease may last.


def set_clock(bench, seconds):
    bench.begin()
    with bench.fault():
        bench.faults.set(clock_offset_seconds=seconds)
        bench.worker_faults.set(clock_offset_seconds=seconds)
        bench.pause(0, 0.2)
    lost = bench.metric("sheaf_workers_lost_total")
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    assert bench.metric("sheaf_workers_lost_total") == lost, "a worker is lost"


@kind("clock is set forward by hours")
def clock_forward(bench):
    set_clock(bench, JUMP_SECONDS)


@kind("clock is set back by hours")
def clock_back(bench):
    set_clock(bench, -JUMP_SECONDS)


def limit_memory(worker, room_bytes):
    with open(f"/proc/{worker.pid}/statm", encoding="ascii") as file:
        size_bytes = int(file.read().split()[0]) * resource.getpagesize()
    soft = size_bytes + room_bytes if room_bytes else resource.RLIM_INFINITY
    resource.prlimit(worker.pid, resource.RLIMIT_AS, (soft, resource.RLIM_INFINITY))


def submit_beyond_memory(bench, told):
    """Another job's scene is beyond the workers' memory: that job fails with the reason; the job of
    the bench does not notice."""
    path = bench.farm.path("huge.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(HUGE % 11)
    huge = bench.farm.sheaf("submit", path, "--samples", "1").stdout.strip()
    bench.begin(progress=False)
    said = bench.farm.sheaf("watch", huge, check=False)
    said = said.stdout + said.stderr
    bench.tell(told in said, "the memory: " + said)
    for worker in bench.farm.workers:
        assert worker.poll() is None, "a worker died"


@kind("workers lack the address space for another job's scene", must_tell=True)
def memory_short(bench):
    with bench.fault():
        for worker in bench.farm.workers:
            limit_memory(worker, ROOM)
        submit_beyond_memory(bench, "address space")
        for worker in bench.farm.workers:
            limit_memory(worker, 0)


def descendants(pid):
    """The process and all that descend from it."""
    found = [pid]
    for parent in found:
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            for thread in os.listdir(f"/proc/{parent}/task"):
                with open(f"/proc/{parent}/task/{thread}/children", encoding="ascii") as file:
                    found += map(int, file.read().split())
    return found


def workers_processes(bench):
    return [pid for worker in bench.farm.workers for pid in descendants(worker.pid)]


@kind("workers' control group lacks the memory for another job's scene", must_tell=True,
      needs="groups")
def group_short(bench):
    with bench.fault(), ControlGroup() as group:
        group.add(workers_processes(bench))
        group.limit(GROUP_BYTES)
        submit_beyond_memory(bench, "control group")


# Takes all memory of the group that it is started in, piece by piece.
HOG = """
import time
taken = []
print("started", flush=True)
while True:
    taken.append(bytearray(b"x") * (4 << 20))
"""


@kind("memory of the workers' control group runs out, and the kernel kills them", needs="groups")
def group_exhausted(bench):
    """Something else in the group takes it all; the kernel kills the workers or their scenes'
    processes before that."""
    bench.begin()
    with bench.fault(), ControlGroup() as group:
        processes = workers_processes(bench)
        group.add(processes)
        for pid in processes:
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                with open(f"/proc/{pid}/oom_score_adj", "w", encoding="ascii") as file:
                    file.write("1000")
        with subprocess.Popen([sys.executable, "-c", HOG], stdout=subprocess.PIPE) as hog:
            hog.stdout.readline()
            group.add([hog.pid])
            group.limit(GROUP_BYTES)
            hog.wait()
        farm.wait_until(lambda: any(w.poll() is not None for w in bench.farm.workers) or
                        not all(os.path.exists(f"/proc/{pid}") for pid in processes), 5,
                        "a process that the kernel killed")
        bench.replace_dead_workers()
