#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Whether --target-error reaches its target, and at what overshoot.

    SHEAF_BIN=build/release/bin \\
        tests/accuracy/target_error.py SCENE... [--targets 0.1,0.05,0.02,0.01]
        [--runs 5] [--reference-samples 4096] [--references FOLDER] [--crop X0,Y0,X1,Y1] [--check]

For every scene it renders the smallest target, then a reference of another seed with 16 times as
many samples in every pixel, by one sequence, and with at least --reference-samples: at the
silhouette of a light the fraction of a pixel that it covers may be one in a thousand, and a
reference that has missed it makes correct images look wrong. Then it renders each target with
several seeds and compares: the true error is the relMSE against the reference minus the reference's
own error. One sequence gives only an upper estimate of the latter, some hundredths of the smallest
target. Prints, for each scene and target, the fraction of runs that reached it, and the overshoot:
the additional cost relative to an error of exactly the target, target / true error - 1 (an upper
bound if errors fall faster than 1 / samples), unless the first round was already enough (no image
has fewer samples than that). With --check, exits with 1 if fewer than 95 % of all runs reach their
target, or if the median overshoot is above 25 %.
"""
import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile

BIN = os.environ.get("SHEAF_BIN", "build/release/bin")
REFERENCE_GROWTH = 16
REFERENCE_SAMPLES_MIN = 4096
REACHED_MIN = 0.95
OVERSHOOT_MAX = 0.25
REFERENCE_SEED = 1_000_003


class Scene(str):
    """A path, or PATH@SAMPLES with the minimum samples of this scene's reference."""
    reference_samples = None

    def __new__(cls, text):
        path, at, samples = text.partition("@")
        scene = super().__new__(cls, path)
        if at:
            scene.reference_samples = int(samples)
        return scene


def reference_samples(scene, options):
    return scene.reference_samples or options.reference_samples


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


def crop_flags(options):
    return ["--crop", options.crop] if options.crop else []


def make_parser(doc, reference_samples=None):
    """Parser for the arguments of this folder's programs: scenes, a crop, --check, and for
    comparisons with a reference its samples and its folder.
    """
    parser = argparse.ArgumentParser(description=doc,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", metavar="SCENE", type=Scene)
    parser.add_argument("--crop")
    parser.add_argument("--check", action="store_true")
    if reference_samples is not None:
        parser.add_argument("--reference-samples", type=int, default=reference_samples)
        parser.add_argument("--references", help="a folder where references are kept, and found "
                            "by the next run with as many samples of the same scene and crop")
    return parser


def render_reference(scene, options, folder, target):
    """Renders a reference for images of at least this error; see above. Returns its path, an upper
    bound of its relMSE, and its number of pixels.
    """
    made = render(scene, options.crop, target, REFERENCE_SEED, os.path.join(folder, "made.exr"))
    pixels = pixel_count(made)
    count = max(reference_samples(scene, options),
                math.ceil(REFERENCE_GROWTH * made["rounds"][-1]["sample_count"] / pixels))
    path, left = make_reference(scene, options, folder, count)
    return path, left, pixels


def make_reference(scene, options, folder, count):
    name = os.path.basename(scene) + (f"-{options.crop}" if options.crop else "") + f"-{count}"
    path = os.path.join(options.references or folder, name + ".exr")
    notes = path + ".json"
    if not os.path.exists(notes):
        frame = render_frame(scene, crop_flags(options), REFERENCE_SEED, path, "--samples", count,
                             "--one-sequence")
        with open(notes, "w", encoding="utf-8") as file:
            json.dump(frame["progress"]["relative_mse"], file)
    with open(notes, encoding="utf-8") as file:
        left = json.load(file)
    print(f"{os.path.basename(scene)}: reference of {count} samples a pixel has relMSE of at "
          f"most {left:.2e}", flush=True)
    return path, left


def measure(scene, options, folder):
    """Rows (target, true error, overshoot or None)."""
    targets = sorted((float(t) for t in options.targets.split(",")), reverse=True)
    reference, left, pixels = render_reference(scene, options, folder, targets[-1])
    runs = []  # Target, true error, samples per pixel, rounds.
    for target in targets:
        for seed in range(1, options.runs + 1):
            image = os.path.join(folder, "image.exr")
            frame = render(scene, options.crop, target, seed, image)
            runs.append((target, relative_mse(reference, image) - left,
                         frame["rounds"][-1]["sample_count"] / pixels, len(frame["rounds"])))
    rows = []
    for target in targets:
        of_target = [run for run in runs if run[0] == target]
        errors = [run[1] for run in of_target]
        over = [target / run[1] - 1 if run[3] > 1 else None for run in of_target]
        rows += zip([target] * len(over), errors, over)
        counted = [o for o in over if o is not None]
        print(f"  target {target:<6g} true {min(errors):.5f} to {max(errors):.5f}, "
              f"{sum(e <= target for e in errors)} of {len(errors)} reached, "
              f"{statistics.median(run[2] for run in of_target):7.1f} samples, "
              f"{max(run[3] for run in of_target)} rounds, overshoot "
              + (f"{100 * statistics.median(counted):.0f} %" if counted else "-"), flush=True)
    return rows


def main():
    parser = make_parser(__doc__, REFERENCE_SAMPLES_MIN)
    parser.add_argument("--targets", default="0.1,0.05,0.02,0.01")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    rows = []
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            rows += measure(scene, options, folder)
    reached = sum(error <= target for target, error, _ in rows) / len(rows)
    overshoots = [row[2] for row in rows if row[2] is not None]
    overshoot = statistics.median(overshoots) if overshoots else 0
    print(f"{len(rows)} runs: {100 * reached:.1f} % reached their target; overshoot in cost of the "
          f"{len(overshoots)} beyond the first round: median {100 * overshoot:.0f} %")
    if options.check and (reached < REACHED_MIN or overshoot > OVERSHOOT_MAX):
        sys.exit(1)


if __name__ == "__main__":
    main()
