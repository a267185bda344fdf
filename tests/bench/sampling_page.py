#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/sampling.md: how even the sample points are, and how fast errors fall by them.

    tests/bench/sampling_page.py BIN [SCENE ...] [--minutes 1]

BIN is the folder of a build's programs, with `discrepancy_bench` (target benches) and `sheaf`.
Rates are those that `sheaf study` observes in the scenes.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
SCENES = ["scenes/cornell-box.pbrt", "scenes/showroom.pbrt", "scenes/principled.pbrt"]
COUNTS = [16 << i for i in range(9)]
COLUMNS = (16, 256, 1024, 4096)
# Name in the benchmark, words in the table, color in the chart.
ROWS = [("independent", "independent numbers", "#888888"),
        ("light paths of a pass", "light paths of one pass", "#c44e52"),
        ("replicates", "samples of a pixel, 16 replicates in turn", "#dd8452"),
        ("pairs of slots", "one coordinate of each of two decisions", "#55a868"),
        ("sobol", "Sobol's sequence, not scrambled", "#8172b3"),
        ("slot", "one decision, within a replicate", "#4c72b0")]
WIDTH, HEIGHT, LEFT, TOP = 640, 400, 60, 20

PAGE = """# How even the samples are

Written by `tests/bench/sampling_page.py`. Each decision of a path (a *slot*) has points of its own:
Owen-scrambled Sobol' points in four dimensions, in an order of their own, so that decisions are
uncorrelated (worker/render/sampling/sampler.h). A pixel has 16 replicates, independent of each
other, which its error bars come from. The *discrepancy* of a set of points is the root mean square,
over boxes, of the difference between a box's share of the points and its volume; with independent
numbers it falls as 1 / sqrt(N). `L2-star` takes boxes with a corner at 0 (Warnock 1972),
`wrap-around` all boxes of the torus (Hickernell 1998). Values are the root of the mean square of 16
sets.

![L2-star discrepancy of two-dimensional sets](sampling/discrepancy.svg)

{tables}
It says:

- The points of one decision are as even as Sobol's sequence itself: scrambling and shuffling lose
  nothing.
- Across decisions each coordinate is even by itself, and pairs are better than independent ones.
- Replicates cost up to a factor of 4, the root of 16: N samples are 16 independent sets of N / 16.
  It is the price of error bars that hold for one image.
- Light paths of one pass are as even as independent numbers, since every path has the sequence of
  its own pixel. Sharing one sequence among them was tried: errors of whole images fell by 3 % or
  less.

## How fast errors fall

`sheaf study` fits, in each scene, the rate at which the squared error falls: as 1 / N^rate, 1 for
independent numbers. Smooth integrands gain from even points; edges, many bounces and media gain
less.

| scene | rate | half the error takes | with independent numbers |
|---|---|---|---|
{rates}
"""


def run(command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return done.stdout


def table(sets, dimensions, measure, title):
    lines = [f"| {title} | " + " | ".join(f"N = {count}" for count in COLUMNS) + " |",
             "|---" * (len(COLUMNS) + 1) + "|"]
    for name, words, _ in ROWS:
        if (name, dimensions) not in sets:
            continue
        values = [sets[name, dimensions][measure][COUNTS.index(count)] for count in COLUMNS]
        lines.append(f"| {words} | " + " | ".join(f"{value:.2g}" for value in values) + " |")
    return "\n".join(lines) + "\n\n"


def chart(sets):
    """The two-dimensional sets, both axes logarithmic."""
    low, high = -4, -1

    def place(index, value):
        return (LEFT + index * (WIDTH - LEFT - 20) / (len(COUNTS) - 1),
                TOP + (high - math.log10(value)) * (HEIGHT - TOP - 40) / (high - low))

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
             'font-family="sans-serif" font-size="12">',
             f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>']
    for power in range(low, high + 1):
        _, y = place(0, 10.0 ** power)
        parts.append(f'<line x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - 20}" y2="{y:.1f}" '
                     f'stroke="#dddddd"/><text x="{LEFT - 8}" y="{y + 4:.1f}" '
                     f'text-anchor="end">{10.0 ** power:g}</text>')
    for index, count in enumerate(COUNTS):
        x, _ = place(index, 1)
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - 18}" text-anchor="middle">{count}</text>')
    for line, (name, words, color) in enumerate(ROWS):
        values = sets[name, 2]["l2_star"]
        points = " ".join("%.1f,%.1f" % place(i, value) for i, value in enumerate(values))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{color}" '
                     'stroke-width="2"/>')
        y = HEIGHT - 150 + 16 * line
        parts.append(f'<line x1="{LEFT + 12}" y1="{y - 4}" x2="{LEFT + 36}" y2="{y - 4}" '
                     f'stroke="{color}" stroke-width="2"/>'
                     f'<text x="{LEFT + 42}" y="{y}">{words}</text>')
    parts.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 2}" text-anchor="middle">points</text></svg>')
    return "\n".join(parts) + "\n"


def rate_row(sheaf, scene, minutes):
    with tempfile.TemporaryDirectory() as folder:
        figures = os.path.join(folder, "study.json")
        run([sheaf, "study", os.path.join(ROOT, scene), "--minutes", str(minutes),
             "-o", os.path.join(folder, "study.html"), "--json-output", figures])
        with open(figures, encoding="utf-8") as file:
            entry = json.load(file)["entries"][0]
    name = os.path.splitext(os.path.basename(scene))[0]
    if entry["rate"] is None:
        return f"| {name} | not found in {minutes:g} minutes | | 4 times as long |"
    return (f"| {name} | {entry['rate']:.2f} ± {entry['rate_error']:.2f} | "
            f"{4 ** (1 / max(entry['rate'], .1)):.1f} times as long | 4 times as long |")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin")
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--minutes", type=float, default=1)
    options = parser.parse_args()
    rows = json.loads(run([os.path.join(options.bin, "discrepancy_bench")]))
    sets = {(row["name"], row["dimensions"]): row for row in rows}
    tables = (table(sets, 2, "l2_star", "L2-star, two dimensions") +
              table(sets, 2, "wrap_around", "wrap-around, two dimensions") +
              table(sets, 4, "l2_star", "L2-star, four dimensions"))
    rates = [rate_row(os.path.join(options.bin, "sheaf"), scene, options.minutes)
             for scene in options.scenes]
    os.makedirs(os.path.join(ROOT, "docs", "sampling"), exist_ok=True)
    with open(os.path.join(ROOT, "docs", "sampling", "discrepancy.svg"), "w",
              encoding="utf-8") as file:
        file.write(chart(sets))
    with open(os.path.join(ROOT, "docs", "sampling.md"), "w", encoding="utf-8") as file:
        file.write(PAGE.format(tables=tables, rates="\n".join(rates)))


if __name__ == "__main__":
    main()
