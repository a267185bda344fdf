#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Price of the sandbox: one worker that renders scenes in confined processes against one that
renders them in its own.

Times `sheaf submit --wait` on both in turn, with the scene loaded anew each time, and prints every
pair, the ratios of wall times and of CPU times of all processes, and their medians. The target is
at most 1.02 for a job of 30 s or more. On a busy machine CPU times are the ones to compare.

    tests/bench/sandbox_price.py [SCENE] [SAMPLES] [PAIRS]
"""
import os
import resource
import statistics
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402


def cpu_seconds():
    """CPU time of all processes that have ended so far, including those of a worker's scenes."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def timed_job(mode, scene, samples):
    """Wall and CPU time of one job on a new farm, in seconds, and the digest of its image."""
    cpu_before = cpu_seconds()
    with farm.Farm() as f:
        worker = f.start_worker("--sandbox", mode)
        farm.wait_until(lambda: "works for" in f.log("worker1"), 30, "the worker")
        started = time.monotonic()
        f.sheaf("submit", scene, "--wait", "-o", f.path("out.exr"), "--samples", samples,
                seconds=3600)
        wall = time.monotonic() - started
        worker.terminate()  # In order, so that the CPU time of its scene's process is known.
        worker.wait()
        digest = farm.image_digest(f.path("out.exr"))
    return wall, cpu_seconds() - cpu_before, digest


def main():
    scene = sys.argv[1] if len(sys.argv) > 1 else os.path.join(farm.ROOT, "scenes", "showroom.pbrt")
    samples = sys.argv[2] if len(sys.argv) > 2 else "64"
    pairs = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    ratios, cpu_ratios = [], []
    for pair in range(pairs):
        # The order alternates, so that a machine that warms up or slows down favors neither.
        runs = {}
        for mode in ("required", "none") if pair % 2 else ("none", "required"):
            runs[mode] = timed_job(mode, scene, samples)
        (wall, cpu, digest), (wall_none, cpu_none, digest_none) = runs["required"], runs["none"]
        if digest != digest_none:
            sys.exit("the images differ")
        ratios.append(wall / wall_none)
        cpu_ratios.append(cpu / cpu_none)
        print(f"pair {pair + 1}: required {wall:.2f} s, none {wall_none:.2f} s, ratio "
              f"{ratios[-1]:.4f}; CPU {cpu:.2f} s, {cpu_none:.2f} s, ratio {cpu_ratios[-1]:.4f}",
              flush=True)
    print(f"median ratio {statistics.median(ratios):.4f}, of CPU times "
          f"{statistics.median(cpu_ratios):.4f} (target at most 1.02)")


if __name__ == "__main__":
    main()
