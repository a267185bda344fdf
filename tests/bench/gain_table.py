# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The table of what a set of techniques gains over others, for the benches of one technique."""
import argparse
import os
import tempfile

from error_and_cost import measure
from technique_regions import ROOT, shrink


def print_gains(title, word, techniques, reference, scenes):
    """Measures as the command line says, and prints the error and cost of each set of techniques.

    word: names the first set in the head of the table. The gain is the error times CPU seconds of
    another set over that of the first. reference: the set of the reference and its samples, as a
    multiple.
    """
    parser = argparse.ArgumentParser(description=title)
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="NAME")
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    best, times = reference
    print(f"| scene | techniques | relMSE | without the worst | CPU s | gain of {word} "
          "| without the worst |")
    print("|---|---|---|---|---|---|---|")
    for name in options.scenes or scenes:
        with tempfile.TemporaryDirectory() as folder:
            scene = shrink(os.path.join(ROOT, "scenes", name + ".pbrt"), options.width, folder)
            results = measure(options, scene, folder, times, ("--techniques", best),
                              [("--techniques", choice) for choice in techniques])
        first = results[0]
        for choice, (error, trimmed, seconds) in zip(techniques, results):
            gains = ("", "") if choice == techniques[0] else tuple(
                f"{value * seconds / (own * first.cpu_seconds):.2f}"
                for value, own in zip((error, trimmed), first))
            print(f"| {'' if gains[0] else name} | {choice} | {error:.3g} "
                  f"| {trimmed:.3g} | {seconds:.3g} | {gains[0]} | {gains[1]} |", flush=True)
