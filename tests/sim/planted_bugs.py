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
import filecmp
import os
import re
import shutil
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PATCHES = os.path.join(ROOT, "tests", "sim", "planted_bugs")
TREE = os.path.join(ROOT, "build", "planted_bugs")
# Targets with bugs; of all others, joined sources are compiled as everywhere, and often cached.
UNJOINED = "sheaf_base;sheaf_coordinator_farm;sheaf_coordinator_scheduling;sheaf_coordinator_store"
FOUND_TEXT_MAX = 80


def patch_path(name):
    return os.path.join(PATCHES, name + ".patch")


def all_bugs():
    return sorted(f[:-len(".patch")] for f in os.listdir(PATCHES) if f.endswith(".patch"))


def apply(tree, name, *flags):
    return subprocess.run(["git", "apply", *flags, patch_path(name)], cwd=tree,
                          capture_output=True, text=True)


def check():
    failed = [(name, result.stderr) for name in all_bugs()
              if (result := apply(ROOT, name, "--check")).returncode != 0]
    for name, why in failed:
        print(f"{name}: does not apply: {why.strip()}")
    print(f"{len(all_bugs()) - len(failed)} of {len(all_bugs())} patches apply")
    return 1 if failed else 0


def tracked_files(folder):
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=folder, capture_output=True, check=True)
    return {os.fsdecode(name) for name in listed.stdout.split(b"\0") if name}


def update_copy(tree):
    """Makes the copy equal to the tracked files as they are now; files that are equal keep their
    times, and so their objects."""
    if not os.path.isdir(os.path.join(tree, ".git")):
        os.makedirs(tree, exist_ok=True)
        subprocess.run(["git", "init", "-q"], cwd=tree, check=True)  # "git apply" looks for one.
    wanted = {name for name in tracked_files(ROOT) if os.path.isfile(os.path.join(ROOT, name))}
    for name in wanted:
        source, copy = os.path.join(ROOT, name), os.path.join(tree, name)
        if os.path.isfile(copy) and filecmp.cmp(source, copy, shallow=False):
            continue
        os.makedirs(os.path.dirname(copy), exist_ok=True)
        shutil.copyfile(source, copy)
        shutil.copymode(source, copy)
    for folder, folders, names in os.walk(tree):
        folders[:] = [f for f in folders if os.path.join(folder, f) not in
                      (os.path.join(tree, ".git"), os.path.join(tree, "build"))]
        for name in names:
            path = os.path.join(folder, name)
            if os.path.relpath(path, tree) not in wanted:
                os.remove(path)


def configure(tree):
    subprocess.run(["cmake", "--preset", "dev", f"-DSHEAF_UNJOINED_TARGETS={UNJOINED}"], cwd=tree,
                   check=True, stdout=subprocess.DEVNULL)


def build(tree, jobs):
    built = subprocess.run(["ninja", f"-j{jobs}", "-C", os.path.join(tree, "build", "dev"),
                            "farm_sim"], capture_output=True, text=True)
    if built.returncode != 0:
        raise SystemExit("farm_sim does not build:\n" + built.stdout[-4000:])


def run(tree, seeds, steps):
    """Returns the first seed that failed, or None, and what it said."""
    program = os.path.join(tree, "build", "dev", "bin", "farm_sim")
    result = subprocess.run([program, "--seeds", f"1-{seeds}", "--steps", str(steps),
                             "--no-shorten"], capture_output=True, text=True)
    failed = re.search(r"^seed (\d+): (.*)$", result.stdout, re.M)
    if failed:
        return int(failed[1]), failed[2]
    if result.returncode != 0:
        raise SystemExit(f"farm_sim ended with {result.returncode}: {result.stderr[-2000:]}")
    return None, ""


def measure_bug(name, options):
    """Prints a row for the bug; returns whether it was found."""
    begin = time.monotonic()
    applied = apply(options.tree, name)
    if applied.returncode != 0:
        raise SystemExit(f"{name} does not apply: {applied.stderr}")
    try:
        build(options.tree, options.jobs)
        built = time.monotonic()
        seed, text = run(options.tree, options.seeds, options.steps)
    finally:
        apply(options.tree, name, "--reverse")
    end = time.monotonic()
    if len(text) > FOUND_TEXT_MAX:
        text = text[:FOUND_TEXT_MAX] + " ..."
    print(f"| {name} | {seed or f'none of {options.seeds}'} | {built - begin:.0f} + "
          f"{end - built:.0f} | {text} |", flush=True)
    return seed is not None


def measure(names, options):
    """Returns how many bugs were not found."""
    update_copy(options.tree)
    configure(options.tree)
    if not options.skip_clean:
        build(options.tree, options.jobs)
        seed, text = run(options.tree, options.seeds, options.steps)
        if seed:
            raise SystemExit(f"seed {seed} fails without a bug: {text}")
    print("| bug | seeds until it is found | seconds to build and to run | what is seen |\n"
          "|---|---|---|---|", flush=True)
    found = sum(measure_bug(name, options) for name in names)
    print(f"\n{found} of {len(names)} planted bugs were found")
    return len(names) - found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bugs", nargs="*", help="names of patches; all where none is given")
    parser.add_argument("--check", action="store_true", help="only try whether the patches apply")
    parser.add_argument("--tree", default=TREE, help="where the copy of the tree is or shall be")
    parser.add_argument("--seeds", type=int, default=2000, help="the most seeds for a bug")
    parser.add_argument("--steps", type=int, default=600, help="as farm_sim has it")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    parser.add_argument("--skip-clean", action="store_true",
                        help="do not run the tree without a bug first")
    options = parser.parse_args()
    unknown = set(options.bugs) - set(all_bugs())
    if unknown:
        parser.error(f"no such bug: {', '.join(sorted(unknown))}; see tests/sim/planted_bugs")
    if options.check:
        return check()
    if os.path.isdir(options.tree) and os.path.samefile(options.tree, ROOT):
        parser.error("--tree is this tree, whose files would be changed; name another folder")
    return 1 if measure(options.bugs or all_bugs(), options) else 0


if __name__ == "__main__":
    sys.exit(main())
