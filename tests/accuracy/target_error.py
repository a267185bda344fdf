#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Whether --target-error keeps its word, and at what price.

    SHEAF_BIN=build/dev/bin tests/accuracy/target_error.py SCENE... [--targets 0.1,0.05,0.02,0.01]
        [--runs 5] [--reference-samples 4096] [--crop X0,Y0,X1,Y1] [--check]

Of every scene it renders the smallest target, then a reference of another seed with 16 times as
many samples, in every pixel and by one sequence, and at least --reference-samples: at the rim of a
lamp a pixel's share of it may be one in a thousand, and a reference that has missed it takes right
pictures for wrong. Then each target with several seeds, and compares: the true error is the relMSE
against the reference less what the reference itself is still wrong by, of which one sequence knows
no more than an upper estimate, some hundredths of the smallest target. Prints, for each scene and
target, the share of runs that reached it, and the overshoot: how much more was spent than an error
of exactly the target takes, target / true error - 1, where the first round was not already enough
(no picture has fewer samples than that). With --check, exits with 1 where fewer than 95 % of all
runs reach their target, or the median overshoot is above 25 %.
"""
import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile

BIN = os.environ.get("SHEAF_BIN", "build/dev/bin")
REFERENCE_GROWTH = 16
REFERENCE_SAMPLES_MIN = 4096
REACHED_MIN = 0.95
OVERSHOOT_MAX = 0.25
REFERENCE_SEED = 1_000_003


def run(*arguments):
    done = subprocess.run([os.path.join(BIN, "sheaf"), *map(str, arguments)], capture_output=True,
                          text=True, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"sheaf {' '.join(map(str, arguments))}:\n{done.stderr}")
    return done.stdout


def render_frame(scene, flags, seed, path, *how):
    out = run("render", scene, "--seed", seed, "-o", path, "--json", *flags, *how)
    return json.loads(out.splitlines()[-1])["frames"][0]


def render(scene, crop, target, seed, path):
    flags = ["--crop", crop] if crop else []
    return render_frame(scene, flags, seed, path, "--target-error", target)


def pixel_count(frame):
    window = frame["window"]
    return (window["x1_px"] - window["x0_px"]) * (window["y1_px"] - window["y0_px"])


def relative_mse(reference, image):
    return json.loads(run("compare", reference, image, "--json"))["relative_mse"]


def render_reference(scene, options, target, path):
    """For pictures of at least this error; see above. Returns the relMSE that it is still wrong by,
    at most, and how many pixels it has."""
    made = render(scene, options.crop, target, REFERENCE_SEED, path)
    pixels = pixel_count(made)
    count = max(options.reference_samples,
                math.ceil(REFERENCE_GROWTH * made["rounds"][-1]["sample_count"] / pixels))
    flags = ["--crop", options.crop] if options.crop else []
    left = render_frame(scene, flags, REFERENCE_SEED, path, "--samples", count,
                        "--one-sequence")["progress"]["relative_mse"]
    print(f"{os.path.basename(scene)}: reference of {count} samples a pixel has relMSE of at "
          f"most {left:.2e}", flush=True)
    return left, pixels


def measure(scene, options, folder):
    """Rows (target, reached, overshoot or None, samples a pixel)."""
    targets = sorted((float(t) for t in options.targets.split(",")), reverse=True)
    reference = os.path.join(folder, "reference.exr")
    left, pixels = render_reference(scene, options, targets[-1], reference)
    rows = []
    for target in targets:
        errors, samples, rounds = [], [], []
        for seed in range(1, options.runs + 1):
            image = os.path.join(folder, "image.exr")
            frame = render(scene, options.crop, target, seed, image)
            errors.append(relative_mse(reference, image) - left)
            samples.append(frame["rounds"][-1]["sample_count"] / pixels)
            rounds.append(len(frame["rounds"]))
            reached = errors[-1] <= target
            overshoot = target / errors[-1] - 1 if rounds[-1] > 1 else None
            rows.append((target, reached, overshoot, samples[-1]))
        print(f"  target {target:<6g} true {min(errors):.5f} to {max(errors):.5f}, "
              f"{sum(e <= target for e in errors)} of {len(errors)} reached, "
              f"{statistics.median(samples):7.1f} samples, {max(rounds)} rounds", flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--targets", default="0.1,0.05,0.02,0.01")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--reference-samples", type=int, default=REFERENCE_SAMPLES_MIN)
    parser.add_argument("--crop")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    rows = []
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            rows += measure(scene, options, folder)
    reached = sum(row[1] for row in rows) / len(rows)
    overshoots = [row[2] for row in rows if row[2] is not None]
    overshoot = statistics.median(overshoots) if overshoots else 0
    print(f"{len(rows)} runs: {100 * reached:.1f} % reached their target; overshoot in cost of the "
          f"{len(overshoots)} beyond the first round: median {100 * overshoot:.0f} %")
    if options.check and (reached < REACHED_MIN or overshoot > OVERSHOOT_MAX):
        sys.exit(1)


if __name__ == "__main__":
    main()
