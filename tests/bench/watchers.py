#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Measures what a job of many frames costs: the seconds of its submission, and the processors that
the coordinator takes without clients and while three watch it.

Prints one line of JSON. The targets are at most 5 s, and at most .1 processors more for the
watchers.

    tests/bench/watchers.py [FRAMES] [SECONDS]
"""
import json
import os
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
from client_case import SCENE  # noqa: E402

WATCHERS = 3


def cpu_seconds(pid):
    with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(f, seconds):
    """Processors of the coordinator, and frames a second."""
    before, frames = cpu_seconds(f.coordinator.pid), f.metrics()["sheaf_frames_delivered_total"]
    start = time.monotonic()
    time.sleep(seconds)
    took = time.monotonic() - start
    return ((cpu_seconds(f.coordinator.pid) - before) / took,
            (f.metrics()["sheaf_frames_delivered_total"] - frames) / took)


def main():
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10
    with farm.Farm() as f:
        f.start_worker()
        for number in range(1, frames + 1):
            with open(f.path(f"f.{number:05}.pbrt"), "w", encoding="utf-8") as file:
                file.write(SCENE + f"# {number}\n")
        start = time.monotonic()
        done = f.sheaf("submit", f.path("f.#####.pbrt"), "--frames", f"1-{frames}", "--samples", 64,
                       "--json")
        submit_seconds = time.monotonic() - start
        job = json.loads(done.stdout.splitlines()[-1])["name"]
        time.sleep(2)
        alone, rate_alone = measure(f, seconds)
        environment = dict(f.environment, SHEAF_COORDINATOR=f.address)
        watchers = [subprocess.Popen([os.path.join(farm.programs(), "sheaf"), "watch", job],
                                     env=environment, stdin=subprocess.DEVNULL,
                                     stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                    for _ in range(WATCHERS)]
        time.sleep(2)
        watched, rate_watched = measure(f, seconds)
        again, _ = measure(f, seconds)
        for watcher in watchers:
            watcher.kill()
            watcher.wait()
    print(json.dumps({"frames": frames, "submit_seconds": round(submit_seconds, 2),
                      "stderr_lines": len(done.stderr.splitlines()),
                      "processors_alone": round(alone, 3),
                      "processors_watched": [round(watched, 3), round(again, 3)],
                      "frames_per_second_alone": round(rate_alone, 1),
                      "frames_per_second_watched": round(rate_watched, 1)}))


if __name__ == "__main__":
    main()
