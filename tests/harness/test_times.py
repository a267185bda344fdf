#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The times that tests take: expected ones before a run, a profile after it.

    ctest -N | test_times.py plan BUILD      writes BUILD/planned_times.txt, for deploy/progress
    test_times.py profile BUILD              prints where the build and the last run spent time
    test_times.py update BUILD               writes tests/costs.txt from the last run

sheaf_test_timer appends a line to BUILD/test_costs.txt for each test.
"""
import collections
import glob
import os
import re
import sys
import xml.etree.ElementTree

import register_tests

# Tests below are not listed in tests/costs.txt.
LISTED_SECONDS_MIN = 0.5
# Cases from here on get a process of their own, so that they run beside others.
ALONE_SECONDS_MIN = 2
ROWS_MAX = 40
COSTS = os.path.join(register_tests.TESTS, "costs.txt")
HEAD = """# Seconds that tests take beside others: name, wall time, CPU time.
# tests/harness/README.md says how this file is made. A GoogleTest case that is listed here gets a
# process of its own.
"""


def measured(build):
    """{test: (wall seconds, CPU seconds)} of the newest run of each test that passed."""
    found = {}
    try:
        with open(os.path.join(build, "test_costs.txt"), encoding="utf-8") as file:
            for line in file:
                name, wall, cpu, status = line.split("\t")
                if status.strip() == "0":
                    found[name] = float(wall), float(cpu)
    except FileNotFoundError:
        pass
    return found


def plan(build):
    last = measured(build)
    # A test of the list may be slower or faster here. Others are short; that of a suite whose cases
    # have become tests of their own is not what it was.
    known = {name: last.get(name, cost) for name, cost in register_tests.read_costs(COSTS).items()}
    names = re.findall(r"^ *Test +#\d+: (\S+)$", sys.stdin.read(), re.MULTILINE)
    with open(os.path.join(build, "planned_times.txt"), "w", encoding="utf-8") as file:
        for name in names:
            seconds = known.get(name, (register_tests.COST_SECONDS, 0))[0]
            file.write(f"{seconds:.3f} {name}\n")
    # One line for each test, or the file would grow with every run.
    with open(os.path.join(build, "test_costs.txt"), "w", encoding="utf-8") as file:
        for name, (wall, cpu) in last.items():
            file.write(f"{name}\t{wall:.3f}\t{cpu:.3f}\t0\n")


def case_seconds(build):
    """{case: seconds} of GoogleTest's reports."""
    found = {}
    for path in glob.glob(os.path.join(build, "test_reports", "*.xml")):
        try:
            root = xml.etree.ElementTree.parse(path).getroot()
        except xml.etree.ElementTree.ParseError:
            continue
        for case in root.iter("testcase"):
            found[f"{case.get('classname')}.{case.get('name')}"] = float(case.get("time", "0"))
    return found


def table(title, rows):
    print(f"\n| {title} | steps | wall s | CPU s |\n|---|---|---|---|")
    for name, count, wall, cpu in rows:
        print(f"| {name} | {count} | {wall:.1f} | {'' if cpu is None else f'{cpu:.1f}'} |")


KINDS = (("compile tests", r"(_test\.dir|/tests/|^tests/).*\.(o|gch)$"),
         ("compile protos", r"\.pb\."),
         ("compile product", r"\.(o|gch)$"), ("archive", r"\.a$"), ("link", r"(^|/)bin/"))


def build_profile(build):
    steps = {}
    with open(os.path.join(build, ".ninja_log"), encoding="utf-8") as file:
        for line in file:
            if not line.startswith("#"):
                begin, end, _, output, _ = line.rstrip("\n").split("\t")
                steps[begin, end, os.path.dirname(output) if "page" in output else output] = (
                    output, (int(end) - int(begin)) / 1000)
    sums = collections.defaultdict(lambda: [0, 0.0])
    for output, seconds in steps.values():
        kind = next((kind for kind, pattern in KINDS if re.search(pattern, output)), "other")
        sums[kind][0] += 1
        sums[kind][1] += seconds
    table("build", [(kind, count, wall, None) for kind, (count, wall) in
                    sorted(sums.items(), key=lambda item: -item[1][1])])
    longest = sorted(steps.values(), key=lambda step: -step[1])[:ROWS_MAX]
    table("longest steps", [(output.replace("CMakeFiles/", ""), 1, seconds, None)
                            for output, seconds in longest])


def test_profile(build):
    tests = measured(build)
    bands = ((30, "over 30 s"), (5, "5 to 30 s"), (1, "1 to 5 s"), (0, "under 1 s"))
    rows = []
    for i, (low, name) in enumerate(bands):
        high = bands[i - 1][0] if i else float("inf")
        inside = [times for times in tests.values() if low <= times[0] < high]
        rows.append((name, len(inside), sum(t[0] for t in inside), sum(t[1] for t in inside)))
    rows.append(("all", len(tests), sum(t[0] for t in tests.values()),
                 sum(t[1] for t in tests.values())))
    table("tests that take", rows)
    suites = collections.defaultdict(lambda: [0, 0.0, 0.0])
    for name, (wall, cpu) in tests.items():
        suite = suites[name.split(".")[0]]
        suite[0] += 1
        suite[1] += wall
        suite[2] += cpu
    longest = sorted(suites.items(), key=lambda item: -item[1][1])[:ROWS_MAX]
    table("suites", [(name, *times) for name, times in longest])


def update(build):
    """Lists tests that take long, and long cases of suites instead of the suites' sums."""
    tests = measured(build)
    cases = case_seconds(build)
    listed = {}
    for name, (wall, cpu) in tests.items():
        inside = {case: seconds for case, seconds in cases.items()
                  if case.split(".")[0] == name and case not in tests}
        for case, seconds in inside.items():
            if seconds >= ALONE_SECONDS_MIN:
                listed[case] = seconds, seconds
                wall, cpu = wall - seconds, cpu - seconds
        if wall >= LISTED_SECONDS_MIN:
            listed[name] = wall, max(cpu, 0)
    with open(COSTS, "w", encoding="utf-8") as file:
        file.write(HEAD)
        for name, (wall, cpu) in sorted(listed.items()):
            file.write(f"{name} {wall:.1f} {cpu:.1f}\n")


def main():
    action, build = sys.argv[1:3]
    if action == "plan":
        plan(build)
    elif action == "profile":
        build_profile(build)
        test_profile(build)
    elif action == "update":
        update(build)
    else:
        sys.exit(f"{action}: say plan, profile or update")


if __name__ == "__main__":
    main()
