#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Measures what the simulator of the farm finds: plants bugs one by one and looks for them.

Each patch of tests/sim/planted_bugs is applied to a copy of the tree, farm_sim is built there and
runs seeds, from 1 on, until one fails. Prints a row of a table for each bug: how many seeds that
took. The copy and its build stay in build/planted_bugs, so that only the first build takes minutes:
then a bug costs the sources that it changes, which are compiled alone.

  tests/sim/planted_bugs.py           all bugs
  tests/sim/planted_bugs.py BUG...    some
  tests/sim/planted_bugs.py --check   only whether all patches still apply
"""
import argparse
import os
import re
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "harness"))
from patched_tree import ROOT, PatchedTree  # noqa: E402

PATCHES = os.path.join(HERE, "planted_bugs")
TREE = os.path.join(ROOT, "build", "planted_bugs")
# Targets with bugs; of all others, joined sources are compiled as everywhere, and often cached.
UNJOINED = ";".join("sheaf_" + name for name in (
    "agent", "base", "coordinator_farm", "coordinator_scheduling", "coordinator_store"))
FOUND_TEXT_MAX = 80


def run(tree, seeds, steps):
    """Returns the first seed that failed, or None, and what it said."""
    program = os.path.join(tree.bin, "farm_sim")
    result = subprocess.run([program, "--seeds", f"1-{seeds}", "--steps", str(steps),
                             "--no-shorten"], capture_output=True, text=True)
    failed = re.search(r"^seed (\d+): (.*)$", result.stdout, re.M)
    if failed:
        return int(failed[1]), failed[2]
    if result.returncode != 0:
        raise SystemExit(f"farm_sim ended with {result.returncode}: {result.stderr[-2000:]}")
    return None, ""


def measure_bug(name, tree, options):
    """Prints a row for the bug; returns whether it was found."""
    begin = time.monotonic()
    applied = tree.apply(name)
    if applied.returncode != 0:
        raise SystemExit(f"{name} does not apply: {applied.stderr}")
    try:
        tree.build(["farm_sim"], options.jobs)
        built = time.monotonic()
        seed, text = run(tree, options.seeds, options.steps)
    finally:
        tree.apply(name, "--reverse")
    end = time.monotonic()
    if len(text) > FOUND_TEXT_MAX:
        text = text[:FOUND_TEXT_MAX] + " ..."
    print(f"| {name} | {seed or f'none of {options.seeds}'} | {built - begin:.0f} + "
          f"{end - built:.0f} | {text} |", flush=True)
    return seed is not None


def measure(names, tree, options):
    """Returns how many bugs were not found."""
    tree.update()
    tree.configure(f"-DSHEAF_UNJOINED_TARGETS={UNJOINED}")
    if not options.skip_clean:
        tree.build(["farm_sim"], options.jobs)
        seed, text = run(tree, options.seeds, options.steps)
        if seed:
            raise SystemExit(f"seed {seed} fails without a bug: {text}")
    print("| bug | seeds until it is found | seconds to build and to run | what is seen |\n"
          "|---|---|---|---|", flush=True)
    found = sum(measure_bug(name, tree, options) for name in names)
    print(f"\n{found} of {len(names)} planted bugs were found")
    return len(names) - found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bugs", nargs="*", help="names of patches; all where none is given")
    parser.add_argument("--check", action="store_true", help="only try whether the patches apply")
    parser.add_argument("--tree", default=TREE, help="folder of the tree's copy")
    parser.add_argument("--seeds", type=int, default=2000, help="the most seeds for a bug")
    parser.add_argument("--steps", type=int, default=600, help="as farm_sim has it")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    parser.add_argument("--skip-clean", action="store_true",
                        help="do not run the tree without a bug first")
    options = parser.parse_args()
    tree = PatchedTree(PATCHES, options.tree)
    unknown = set(options.bugs) - set(tree.names())
    if unknown:
        parser.error(f"no such bug: {', '.join(sorted(unknown))}; see tests/sim/planted_bugs")
    if options.check:
        return tree.check()
    if os.path.isdir(options.tree) and os.path.samefile(options.tree, ROOT):
        parser.error("--tree is this tree, whose files would be changed; name another folder")
    return 1 if measure(options.bugs or tree.names(), tree, options) else 0


if __name__ == "__main__":
    sys.exit(main())
