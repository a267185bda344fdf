#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Measures what the simulator of the farm finds: plants bugs one by one and looks for them.

Each patch of tests/sim/planted_bugs is applied to a copy of the tree, farm_sim is built there and
runs seeds until one fails. Prints for each bug whether it was found and by how many seeds.

  tests/sim/planted_bugs.py                     all bugs, in a copy of its own (builds for minutes)
  tests/sim/planted_bugs.py --tree DIR BUG...   some, in a copy that you made, with its build/dev
  tests/sim/planted_bugs.py --check             only whether all patches still apply
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PATCHES = os.path.join(ROOT, "tests", "sim", "planted_bugs")


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


def copy_tree(folder):
    """Copies the tracked files as they are now, and configures a build."""
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    archive = subprocess.Popen(["tar", "-c", "--null", "-T", "-"], cwd=ROOT,
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    unpack = subprocess.Popen(["tar", "-x", "-C", folder], stdin=archive.stdout)
    archive.stdin.write(files.stdout)
    archive.stdin.close()
    if archive.wait() != 0 or unpack.wait() != 0:
        raise SystemExit("copying the tree failed")
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)  # "git apply" looks for one.
    subprocess.run(["cmake", "--preset", "dev"], cwd=folder, check=True, stdout=subprocess.DEVNULL)


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


def measure(tree, names, options):
    """Prints a line for each bug; returns how many were not found."""
    missed = 0
    if not options.skip_clean:
        build(tree, options.jobs)
        seed, text = run(tree, options.seeds, options.steps)
        print(f"{'(no bug)':40} {'fails' if seed else 'none':6} {seed or options.seeds:6}  {text}",
              flush=True)
    for name in names:
        applied = apply(tree, name)
        if applied.returncode != 0:
            raise SystemExit(f"{name} does not apply: {applied.stderr}")
        try:
            build(tree, options.jobs)
            seed, text = run(tree, options.seeds, options.steps)
        finally:
            apply(tree, name, "--reverse")
        missed += seed is None
        print(f"{name:40} {'found' if seed else 'MISSED':6} {seed or options.seeds:6}  {text[:90]}",
              flush=True)
    print(f"{len(names) - missed} of {len(names)} planted bugs were found")
    return missed


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bugs", nargs="*", help="names of patches; all where none is given")
    parser.add_argument("--check", action="store_true", help="only try whether the patches apply")
    parser.add_argument("--tree", help="a copy of the tree, with a build in build/dev")
    parser.add_argument("--seeds", type=int, default=2000, help="the most seeds for a bug")
    parser.add_argument("--steps", type=int, default=600, help="as farm_sim has it")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    parser.add_argument("--skip-clean", action="store_true",
                        help="do not run the tree without a bug first")
    options = parser.parse_args()
    if options.check:
        return check()
    names = options.bugs or all_bugs()
    if options.tree:
        if os.path.samefile(options.tree, ROOT):
            parser.error("--tree is this tree; its files would be changed, so make a copy")
        return 1 if measure(options.tree, names, options) else 0
    with tempfile.TemporaryDirectory(prefix="sheaf-planted-") as folder:
        copy_tree(folder)
        return 1 if measure(folder, names, options) else 0


if __name__ == "__main__":
    sys.exit(main())
