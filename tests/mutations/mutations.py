#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Shows that the short form of the tests finds defects: plants them one by one.

Each patch of this folder names a defect, the test that finds it, as ctest knows it, and what is
built for that test. It is applied to a copy of the tree; the test must pass there before, and fail
then. The copy and its build stay in build/mutations.

  tests/mutations/mutations.py              all mutations
  tests/mutations/mutations.py NAME...      some
  tests/mutations/mutations.py --check      only whether all patches still apply
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

TREE = os.path.join(ROOT, "build", "mutations")
TEST_SECONDS_MAX = 1800


class Mutation:
    def __init__(self, name):
        self.name = name
        with open(os.path.join(HERE, name + ".patch"), encoding="utf-8") as file:
            head = file.read().partition("diff --git")[0]
        self.what = head.splitlines()[0]
        self.test = re.search(r"^Found by: (\S+)$", head, re.MULTILINE)[1]
        builds = re.search(r"^Builds: (.+)$", head, re.MULTILINE)
        self.targets = builds[1].split() if builds else ["sheaf_proto"]


def passes(tree, test):
    """Whether all tests of the short form with this name, or of this suite, pass."""
    done = subprocess.run(["ctest", "--test-dir", tree.build_folder, "--no-tests=error", "-LE",
                           "^long$", "-R", f"^{test}([.@]|$)"], capture_output=True, text=True,
                          timeout=TEST_SECONDS_MAX, check=False)
    if "No tests were found" in done.stdout + done.stderr:
        raise SystemExit(f"{test}: there is no such test in the short form")
    return done.returncode == 0


def measure(mutation, tree, jobs):
    """Prints a row for the mutation; returns whether it was found."""
    targets = [*mutation.targets, "sheaf_test_timer"]
    tree.build(targets, jobs)
    if not passes(tree, mutation.test):
        raise SystemExit(f"{mutation.test} fails without a mutation")
    applied = tree.apply(mutation.name)
    if applied.returncode != 0:
        raise SystemExit(f"{mutation.name} does not apply: {applied.stderr}")
    begin = time.monotonic()
    try:
        tree.build(targets, jobs)
        built = time.monotonic()
        found = not passes(tree, mutation.test)
    finally:
        tree.apply(mutation.name, "--reverse")
    seconds = f"{built - begin:.0f} + {time.monotonic() - built:.0f}"
    print(f"| {mutation.name} | {mutation.what} | {mutation.test} | "
          f"{'yes' if found else '**no**'} | {seconds} |", flush=True)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="names of patches; all where none is given")
    parser.add_argument("--check", action="store_true", help="only try whether the patches apply")
    parser.add_argument("--tree", default=TREE, help="where the copy of the tree is made")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    options = parser.parse_args()
    tree = PatchedTree(HERE, options.tree)
    if options.check:
        return tree.check()
    names = options.names or tree.names()
    unknown = set(names) - set(tree.names())
    if unknown:
        parser.error(f"no such mutation: {', '.join(sorted(unknown))}")
    tree.update()
    tree.configure()
    print("| mutation | what is wrong | test | found | seconds to build and to run |\n"
          "|---|---|---|---|---|", flush=True)
    found = sum(measure(Mutation(name), tree, options.jobs) for name in names)
    print(f"\n{found} of {len(names)} mutations were found")
    return 0 if found == len(names) else 1


if __name__ == "__main__":
    sys.exit(main())
