#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Overhead of the farm: coordinator and two one-thread workers against one process of two threads.

Times `sheaf submit --wait` on a warm farm and `sheaf render --threads 2` in turn on the same job,
and prints every pair, the ratio of wall times and its median. The target is at most 1.05 for a job
of 60 s or more.

    tests/bench/farm_efficiency.py [SCENE] [SAMPLES] [PAIRS]
"""
import os
import statistics
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402


def timed(call):
    started = time.monotonic()
    call()
    return time.monotonic() - started


def main():
    scene = sys.argv[1] if len(sys.argv) > 1 else os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
    samples = sys.argv[2] if len(sys.argv) > 2 else "256"
    pairs = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        for pair in range(pairs):
            with farm.Farm() as f:
                f.start_worker()
                f.start_worker()
                f.sheaf("submit", scene, "--wait", "-o", f.path("warm.exr"), "--samples", 1)
                over_farm = timed(lambda: f.sheaf(
                    "submit", scene, "--wait", "-o", f.path("out.exr"), "--samples", samples,
                    seconds=3600))
                farm_digest = farm.image_digest(f.path("out.exr"))
            alone_path = os.path.join(folder, "alone.exr")
            alone = timed(lambda: farm.render(scene, alone_path, "--samples", samples,
                                              "--threads", 2, seconds=3600))
            if farm.image_digest(alone_path) != farm_digest:
                sys.exit("the images differ")
            ratios.append(over_farm / alone)
            print(f"pair {pair + 1}: farm {over_farm:.2f} s, one process {alone:.2f} s, "
                  f"ratio {ratios[-1]:.4f}", flush=True)
    print(f"median ratio {statistics.median(ratios):.4f} (target at most 1.05)")


if __name__ == "__main__":
    main()
