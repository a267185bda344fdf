#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Error times cost of Sheaf against Cycles on one scene, in one run.

    SHEAF_BIN=build/release/bin tests/bench/cycles_ratio.py SCENE.pbrt CYCLES_SCRIPT.py
        [--samples N] [--seeds K] [--reference-samples M] [--max-ratio R] [--one-sequence]

CYCLES_SCRIPT is run by Debian's Blender as `blender ... --python CYCLES_SCRIPT -- SCENE SAMPLES OUT
SEED` and must build the same scene there. Each renderer is compared with a long rendering of its
own (so that filters do not matter), K times with different seeds, in turns. The error is relMSE as
`sheaf compare` prints it; the cost is the CPU time of the whole process minus that of the same
process at one sample, which excludes the startup of both. Prints relMSE x CPU seconds of each and
the ratio, and the ratio of the means of the two long renderings, which should be 1. Exits with 1 if
the ratio of the medians exceeds --max-ratio.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile

SHEAF = os.path.join(os.environ.get("SHEAF_BIN", "build/release/bin"), "sheaf")
THREADS = 2


def cpu_seconds(command):
    """CPU seconds of the command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit("%s failed:\n%s%s" % (command[0], done.stdout[-2000:], done.stderr[-2000:]))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def sheaf(options, samples, seed, out):
    return cpu_seconds([SHEAF, "render", options.scene, "--samples", str(samples), "--seed",
                        str(seed), "--threads", str(THREADS), "-o", out] +
                       (["--one-sequence"] if options.one_sequence else []))


def cycles(options, samples, seed, out):
    return cpu_seconds(["blender", "-b", "--factory-startup", "-t", str(THREADS), "--python",
                        options.script, "--", options.scene, str(samples), out, str(seed)])


def compare(reference, image):
    done = subprocess.run([SHEAF, "compare", "--json", reference, image], capture_output=True,
                          text=True)
    if not done.stdout:
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("script")
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--reference-samples", type=int, default=4096)
    parser.add_argument("--one-sequence", action="store_true",
                        help="render without independent replicates, as Cycles does")
    parser.add_argument("--max-ratio", type=float, default=float("inf"))
    options = parser.parse_args()
    renderers = {"Sheaf": sheaf, "Cycles": cycles}
    with tempfile.TemporaryDirectory() as folder:
        def path(name, seed):
            return os.path.join(folder, "%s-%s.exr" % (name, seed))
        start = {}
        for name, render in renderers.items():
            start[name] = render(options, 1, 1, path(name, "start"))
            render(options, options.reference_samples, 1000, path(name, "reference"))
        products = {name: [] for name in renderers}
        for seed in range(1, options.seeds + 1):
            for name, render in renderers.items():
                seconds = render(options, options.samples, seed, path(name, seed)) - start[name]
                error = compare(path(name, "reference"), path(name, seed))["relative_mse"]
                products[name].append(error * seconds)
                print("%-7s seed %d: relMSE %.5f in %.2f CPU s (and %.2f to start): %.5f" %
                      (name, seed, error, seconds, start[name], products[name][-1]), flush=True)
        means = compare(path("Cycles", "reference"), path("Sheaf", "reference"))["mean_ratio"]
    median = {name: statistics.median(values) for name, values in products.items()}
    ratio = median["Sheaf"] / median["Cycles"]
    print("means, Sheaf over Cycles: %s" % " ".join("%.4f" % mean for mean in means))
    print("relMSE x CPU seconds: Sheaf %.5f, Cycles %.5f, ratio %.3f" %
          (median["Sheaf"], median["Cycles"], ratio))
    return 0 if ratio <= options.max_ratio else 1


if __name__ == "__main__":
    sys.exit(main())
