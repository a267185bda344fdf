# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Clocks that are set, and memory that is short."""
import resource

import farm
from kinds import kind
from memory_test import HUGE, ROOM

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


@kind("workers lack the memory for another job's scene", must_tell=True)
def memory_short(bench):
    """That job fails with the reason; the job of the bench does not notice."""
    path = bench.farm.path("huge.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(HUGE % 10)
    with bench.fault():
        for worker in bench.farm.workers:
            limit_memory(worker, ROOM)
        huge = bench.farm.sheaf("submit", path, "--samples", "1").stdout.strip()
        bench.begin(progress=False)
        said = bench.farm.sheaf("watch", huge, check=False)
        bench.tell(said.returncode == 1 and "address space" in said.stdout + said.stderr)
        for worker in bench.farm.workers:
            assert worker.poll() is None, "a worker died"
            limit_memory(worker, 0)
