#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Compares the lines of product code that the short form of the tests runs with those of all tests.

    tests/harness/coverage.py [--jobs N] [--only-short] [--build TARGET]... [ctest arguments ...]
    tests/harness/coverage.py --build sheaf_base_test -R '^(LabelTest|FileTest)'

Builds with gcov's counters in build/coverage, which takes about as long as the release, runs the
short form, and then the tests of tests/long_tests.md. Prints a row for each module. Exits with 1
where the short form runs over two points fewer of all lines. Tests that fail are named and count:
counters slow programs down.
"""
import argparse
import collections
import concurrent.futures
import gzip
import json
import os
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.join(ROOT, "build", "coverage")
PRODUCT = ("common/", "worker/", "coordinator/", "cli/")
POINTS_MAX = 2
# A program that is killed writes no counters, so the farms of tests stop theirs in order.
ENVIRONMENT = {**os.environ, "SHEAF_ORDERLY_END": "1"}


def build(jobs, targets):
    subprocess.run(["cmake", "-S", ROOT, "-B", BUILD, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                    "-DSHEAF_BUILD_TESTS=ON", "-DSHEAF_COVERAGE=ON", "-DSHEAF_TEST_TIME_SCALE=4"],
                   check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["ninja", f"-j{jobs}", "-C", BUILD, *targets], check=True)
    for path in counter_files():
        os.remove(path)


def counter_files():
    return [os.path.join(folder, name) for folder, _, names in os.walk(BUILD)
            for name in names if name.endswith(".gcda")]


def run_tests(jobs, label, arguments):
    environment = dict(ENVIRONMENT)
    if label[0] == "-L":
        environment["SHEAF_ALL_TESTS"] = "1"
    subprocess.run(["ctest", "--test-dir", BUILD, "-j", str(jobs), *label, *arguments],
                   env=environment, stdin=subprocess.DEVNULL, check=False)


def is_product(path):
    return path.startswith(PRODUCT) and not path.endswith("_test.cc") and "/tests/" not in path


def lines_of(counters):
    """{(file, line): whether it ran} of a file of counters."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["gcov", "--json-format", counters], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for name in os.listdir(folder):
            with gzip.open(os.path.join(folder, name), "rt", encoding="utf-8") as file:
                for source in json.load(file)["files"]:
                    path = os.path.relpath(os.path.join(ROOT, source["file"]), ROOT)
                    if is_product(path):
                        for line in source["lines"]:
                            key = path, line["line_number"]
                            found[key] = found.get(key, False) or line["count"] > 0
    return found


def collect(jobs):
    lines = {}
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(lines_of, counter_files()):
            for key, ran in found.items():
                lines[key] = lines.get(key, False) or ran
    return lines


def module_of(path):
    return "/".join(path.split("/")[:2])


def print_table(short, whole):
    """Returns by how many points the short form runs less of all lines."""
    counts = collections.defaultdict(lambda: [0, 0, 0])
    for key, ran in whole.items():
        for name in (module_of(key[0]), "all"):
            counts[name][0] += 1
            counts[name][1] += short.get(key, False)
            counts[name][2] += ran
    print("| module | lines | short form % | all tests % |\n|---|---|---|---|")
    for name, (lines, by_short, by_all) in sorted(counts.items()):
        print(f"| {name} | {lines} | {100 * by_short / lines:.1f} | {100 * by_all / lines:.1f} |")
    lines, by_short, by_all = counts["all"]
    return 100 * (by_all - by_short) / max(1, lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=os.cpu_count() + 1)
    parser.add_argument("--only-short", action="store_true")
    parser.add_argument("--build", action="append", metavar="TARGET",
                        help="build this alone, for a part of the tests; can be given repeatedly")
    options, arguments = parser.parse_known_args()
    long = [] if options.only_short else ["long_tests"]
    build(options.jobs, [*options.build, "sheaf_test_timer"] if options.build else ["all", *long])
    run_tests(options.jobs, ["-LE", "^long$"], arguments)
    short = collect(options.jobs)
    if options.only_short:
        print_table(short, short)
        return 0
    run_tests(options.jobs, ["-L", "^long$"], arguments)
    points = print_table(short, collect(options.jobs))
    print(f"the short form runs {points:.1f} points fewer")
    return 1 if points > POINTS_MAX else 0


if __name__ == "__main__":
    sys.exit(main())
