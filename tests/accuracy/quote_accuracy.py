#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Accuracy of quotes against actual costs.

    SHEAF_BIN=build/release/bin \\
        tests/accuracy/quote_accuracy.py SCENE... [--targets 0.1,0.05,0.02,0.01]
        [--quotes 3] [--crop X0,Y0,X1,Y1] [--check]

For every scene it renders each target once, makes several quotes with different seeds, and compares
CPU hours. Prints for each target the ratios of actual to quoted cost; over all of them the median
of |ratio - 1| and the fraction within the 80 % bands; and for each scene the quote's own cost over
that of its loosest target. With --check, exits with 1 if the median is above 15 %, the bands
contain fewer than 70 or more than 90 %, or a quote costs more than 3 %.
"""
import json
import os
import statistics
import sys
import tempfile

import target_error

MISS_MAX = 0.15
HELD_MIN, HELD_MAX = 0.7, 0.9
PRICE_MAX = 0.03


def spend(scene, flags, target, seed):
    """CPU hours and samples per pixel that the target took."""
    with tempfile.TemporaryDirectory() as folder:
        frame = target_error.render_frame(scene, flags, seed, os.path.join(folder, "image.exr"),
                                          "--target-error", target)
    progress = frame["progress"]
    return (progress["cpu_duration_seconds"] / 3600,
            progress["sample_count_done"] / target_error.pixel_count(frame))


def measure(scene, options):
    """Rows (ratio, held, fraction of the price)."""
    flags = target_error.crop_flags(options)
    targets = sorted((float(t) for t in options.targets.split(",")), reverse=True)
    happened = {target: spend(scene, flags, target, 1) for target in targets}
    rows, text = [], {target: [] for target in targets}
    for seed in range(101, 101 + options.quotes):
        quote = json.loads(target_error.run("quote", scene, "--local", "--json", "--seed", seed,
                                            "--targets", ",".join(map(str, targets)), *flags))
        price = quote["pilot_cpu_hours"] / happened[targets[0]][0]
        for row in quote["rows"]:
            if row["target_error"] is None:
                continue
            hours, samples = happened[row["target_error"]]
            band = row["cpu_hours"]
            held = band["low"] <= hours <= band["high"]
            rows.append((hours / band["value"], held, price))
            text[row["target_error"]].append(
                f"{hours / band['value']:.2f}{' ' if held else '!'}"
                f"({samples / row['samples']['value']:.2f})")
    print(f"{os.path.basename(scene)}: quotes cost "
          f"{100 * statistics.median(row[2] for row in rows):.1f} % of the loosest target")
    for target in targets:
        print(f"  {target:<6g} {3600 * happened[target][0]:8.2f} CPU s, {happened[target][1]:7.1f} "
              f"samples; over the quote (samples): {' '.join(text[target])}", flush=True)
    return rows


def main():
    parser = target_error.make_parser(__doc__)
    parser.add_argument("--targets", default="0.1,0.05,0.02,0.01")
    parser.add_argument("--quotes", type=int, default=3)
    options = parser.parse_args()
    rows = []
    for scene in options.scenes:
        rows += measure(scene, options)
    miss = statistics.median(abs(row[0] - 1) for row in rows)
    held = sum(row[1] for row in rows) / len(rows)
    price = max(row[2] for row in rows)
    print(f"{len(rows)} quotes of a target: off by {100 * miss:.0f} % in the median, "
          f"{100 * held:.0f} % within their bands; price at most {100 * price:.1f} %")
    if options.check and (miss > MISS_MAX or not HELD_MIN <= held <= HELD_MAX
                          or price > PRICE_MAX):
        sys.exit(1)


if __name__ == "__main__":
    main()
