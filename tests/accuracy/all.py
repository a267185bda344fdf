#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""All claims of docs/accuracy.md that take long to check, on public scenes.

    SHEAF_BIN=build/release/bin SHEAF_PUBLIC_SCENES=DIR tests/accuracy/all.py [--runs 4]
        [--only target_error,quote_accuracy] [--references FOLDER]

Runs the programs of this folder with --check on the eight small scenes, and reports which checks
passed. On two cores quotes take three minutes, targets twelve, one_sequence eight and adaptive_gain
fifty; references take half an hour, and --references keeps them. Exits with 1 if a check fails.
"""
import argparse
import os
import subprocess
import sys
import tempfile

FOLDER = os.path.dirname(os.path.abspath(__file__))
# Scenes with visible small lights need references of 4,096 samples to resolve the emitter
# silhouettes.
LAMPS = ["cornell-box/cornell-box-small", "cornell-box/cornell-box-specular-small",
         "killeroos/killeroo-simple-small", "killeroos/killeroo-moving-small",
         "veach-mis/veach-mis-small"]
OTHERS = ["material-testball/material-testball-small", "staircase2/staircase2-small",
          "teapot-cloud/teapot_cloud-small"]
OTHERS_SAMPLES = 1024
PROGRAMS = {"quote_accuracy": [], "adaptive_gain": ["--runs", "9"],
            "target_error": ["--runs", "{runs}"], "one_sequence": ["--runs", "{runs}"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--only", default=",".join(PROGRAMS))
    parser.add_argument("--references")
    options = parser.parse_args()
    scenes = os.environ.get("SHEAF_PUBLIC_SCENES", "")
    if not os.path.isdir(scenes):
        sys.exit("SHEAF_PUBLIC_SCENES: names no folder of public scenes")
    paths = [os.path.join(scenes, f"{name}.pbrt") for name in LAMPS]
    paths += [os.path.join(scenes, f"{name}.pbrt@{OTHERS_SAMPLES}") for name in OTHERS]
    failed = []
    with tempfile.TemporaryDirectory() as made:
        for name in options.only.split(","):
            flags = [flag.format(runs=options.runs) for flag in PROGRAMS[name]]
            if name != "quote_accuracy":
                flags += ["--references", options.references or made]
            print(f"== {name}", flush=True)
            done = subprocess.run([sys.executable, os.path.join(FOLDER, name + ".py"), *paths,
                                   *flags, "--check"], check=False)
            if done.returncode != 0:
                failed.append(name)
    print("all checks hold" if not failed else f"failed: {', '.join(failed)}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
