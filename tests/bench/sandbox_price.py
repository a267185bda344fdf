#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Price of the sandbox: one worker that renders scenes in confined processes against one that
renders them in its own.

Times `sheaf submit --wait` on both in turn, with the scene loaded anew each time, and prints every
pair, the ratio of wall times and its median. The target is at most 1.02 for a job of 30 s or more.

    tests/bench/sandbox_price.py [SCENE] [SAMPLES] [PAIRS]
"""
import os
import statistics
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402


def timed_job(mode, scene, samples):
    """Wall time of one job on a new farm, in seconds, and the digest of its image."""
    with farm.Farm() as f:
        f.start_worker("--sandbox", mode)
        farm.wait_until(lambda: "works for" in f.log("worker1"), 30, "the worker")
        started = time.monotonic()
        f.sheaf("submit", scene, "--wait", "-o", f.path("out.exr"), "--samples", samples,
                seconds=3600)
        return time.monotonic() - started, farm.image_digest(f.path("out.exr"))


def main():
    scene = sys.argv[1] if len(sys.argv) > 1 else os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
    samples = sys.argv[2] if len(sys.argv) > 2 else "64"
    pairs = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    ratios = []
    for pair in range(pairs):
        # The order alternates, so that a machine that warms up or slows down favors neither.
        times = {}
        for mode in ("required", "none") if pair % 2 else ("none", "required"):
            times[mode] = timed_job(mode, scene, samples)
        if times["required"][1] != times["none"][1]:
            sys.exit("the images differ")
        ratios.append(times["required"][0] / times["none"][0])
        print(f"pair {pair + 1}: required {times['required'][0]:.2f} s, "
              f"none {times['none'][0]:.2f} s, ratio {ratios[-1]:.4f}", flush=True)
    print(f"median ratio {statistics.median(ratios):.4f} (target at most 1.02)")


if __name__ == "__main__":
    main()
