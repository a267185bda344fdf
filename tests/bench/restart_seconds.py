#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Time from the start of a coordinator that was killed (SIGKILL) to its first lease.

The coordinator has a job of 10,000 tasks, of which some are rendered; a worker waits for it to come
back. Prints every restart and the median. The target is less than 2 s.

    tests/bench/restart_seconds.py [RESTARTS]
"""
import os
import statistics
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
from client_case import SCENE  # noqa: E402

TASK_COUNT_EDGE = 100  # Tiles along an edge of the frame.
TILE_PX = 16
SECONDS_MAX = 60


def first_lease_seconds(f):
    started = time.monotonic()
    f.start_coordinator()
    farm.wait_until(lambda: f.metrics()["sheaf_leases_granted_total"] > 0, SECONDS_MAX, "a lease")
    return time.monotonic() - started


def main():
    restarts = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    edge_px = str(TASK_COUNT_EDGE * TILE_PX)
    with farm.Farm() as f:
        scene = f.path("scene.pbrt")
        with open(scene, "w", encoding="utf-8") as file:
            file.write(SCENE.replace('xresolution" 48', f'xresolution" {edge_px}')
                       .replace('yresolution" 32', f'yresolution" {edge_px}'))
        f.start_worker()
        # One task a tile that takes seconds, so that the job outlives all restarts.
        f.sheaf("submit", scene, "--samples", 4096, "--tile-size", TILE_PX, "--pass-samples", 4096)
        seconds = []
        for restart in range(restarts):
            before = len(f.acknowledged())
            farm.wait_until(lambda: len(f.acknowledged()) > before, SECONDS_MAX, "a result")
            f.kill(f.coordinator)
            seconds.append(first_lease_seconds(f))
            print(f"restart {restart + 1}: {seconds[-1]:.2f} s, {len(f.acknowledged())} of "
                  f"{TASK_COUNT_EDGE ** 2} tasks done", flush=True)
    print(f"median {statistics.median(seconds):.2f} s (target less than 2 s)")


if __name__ == "__main__":
    main()
