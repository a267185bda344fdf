#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes the list of tests for ctest, which includes it at each start.

    register_tests.py MANIFEST OUTPUT

MANIFEST is written by cmake/SheafTests.cmake. The cases of GoogleTest programs and of Python's
unittest scripts become tests as follows:

  - a case that tests/long_tests.md lists is a test of its own, with the label "long";
  - a case that tests/costs.txt lists is a test of its own, so that it can run beside others;
  - the other cases of a suite, or of a script, run in one process.

Times come from tests/costs.txt. The longest tests start first. A time limit only ends what hangs.
"""
import collections
import concurrent.futures
import fnmatch
import json
import os
import re
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
TESTS = os.path.dirname(HERE)
# A test that takes ten times its time of tests/costs.txt hangs; other programs may slow it.
HANGS_FACTOR = 10
HANGS_SECONDS_MIN = 1800
# The same of a test of tests/long_tests.md.
LONG_HANGS_SECONDS_MIN = 3600
LIST_SECONDS_MAX = 120
# The time of a test that tests/costs.txt does not list.
COST_SECONDS = 0.1

Test = collections.namedtuple("Test", "name command entry cost long")


def read_costs(path=os.path.join(TESTS, "costs.txt")):
    """{test: (wall seconds, CPU seconds)}."""
    costs = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line.strip() and not line.startswith("#"):
                name, wall, cpu = line.split()
                costs[name] = float(wall), float(cpu)
    return costs


def read_long_tests(path=os.path.join(TESTS, "long_tests.md")):
    """Patterns of the first column of the table, which has names between backquotes."""
    with open(path, encoding="utf-8") as file:
        rows = [line for line in file if line.startswith("| `")]
    return [pattern for row in rows for pattern in re.findall(r"`([^`]+)`", row.split("|")[1])]


def list_program(program):
    """Names "Suite.Case" of a GoogleTest program."""
    listed = subprocess.run([program, "--gtest_list_tests"], capture_output=True, text=True,
                            timeout=LIST_SECONDS_MAX, check=True).stdout
    cases, suite = [], ""
    for line in listed.splitlines():
        name = line.split("#")[0].strip()
        if line.startswith("  "):
            if "DISABLED_" not in suite + name:
                cases.append(suite + name)
        elif name.endswith("."):
            suite = name
    return cases


def list_script(script):
    """Names "Class.test_case" of a unittest script; [] for other scripts."""
    with open(script, encoding="utf-8") as file:
        text = file.read()
    cases, name = [], ""
    for found in re.finditer(r"^class (\w+)\(|^    def (test_\w+)\(", text, re.MULTILINE):
        name = found[1] or name
        if found[2]:
            cases.append(f"{name}.{found[2]}")
    return cases


class Listings:
    """The cases of programs, kept in a file until a program changes."""

    def __init__(self, path):
        self.path = path
        try:
            with open(path, encoding="utf-8") as file:
                self.known = json.load(file)
        except (FileNotFoundError, ValueError):
            self.known = {}

    def fill(self, programs):
        stale = [program for program in programs
                 if self.known.get(program, [None])[0] != os.stat(program).st_mtime_ns]
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            for program, cases in zip(stale, pool.map(list_program, stale)):
                self.known[program] = os.stat(program).st_mtime_ns, cases
        if stale:
            with open(self.path, "w", encoding="utf-8") as file:
                json.dump(self.known, file)

    def cases(self, program):
        return self.known[program][1]


class Registry:
    def __init__(self, manifest, listings):
        self.manifest = manifest
        self.listings = listings
        self.costs = read_costs()
        self.long = read_long_tests()
        self.used = set()  # Patterns that named a case.
        self.tests = []
        self.is_complete = True  # Whether all programs are built.

    def is_long(self, name):
        found = [pattern for pattern in self.long if fnmatch.fnmatchcase(name, pattern)]
        self.used.update(found)
        return bool(found)

    def add(self, entry, name, command, long):
        if any(test.name == name for test in self.tests):
            name += "@" + entry["name"]  # A suite of two programs.
        cost = self.costs.get(name, (COST_SECONDS, 0))[0]
        self.tests.append(Test(name, command, entry, cost, long))

    def add_cases(self, entry, cases, name_of, group_of, command_of):
        """name_of: a case's name as a test; group_of: the name of the test of cases that are not
        alone."""
        groups = collections.defaultdict(list)
        for case in cases:
            name = name_of(case)
            long = self.is_long(name)
            if long or name in self.costs:
                self.add(entry, name, command_of(name, [case]), long)
            else:
                groups[group_of(case)].append(case)
        for name, members in groups.items():
            self.add(entry, name, command_of(name, members), False)

    def add_program(self, entry):
        program = entry["command"][0]
        if not os.path.exists(program):
            self.is_complete = False
            if entry["optional"]:
                return
            self.add(entry, entry["name"] + "_NOT_BUILT", [program], False)
            return

        def command(name, cases):
            report = os.path.join(self.manifest["reports"], name.replace("/", ".") + ".xml")
            return [program, "--gtest_filter=" + ":".join(cases), "--gtest_output=xml:" + report]

        self.add_cases(entry, self.listings.cases(program), lambda case: case,
                       lambda case: case.split(".")[0], command)

    def add_script(self, entry):
        command = entry["command"]
        script = next((word for word in command if word.endswith("_test.py")), None)
        cases = list_script(script) if script and not self.is_long(entry["name"]) else []
        if not cases:
            self.add(entry, entry["name"], command, self.is_long(entry["name"]))
            return
        self.add_cases(entry, cases, lambda case: f"{entry['name']}.{case.split('.')[1]}",
                       lambda case: entry["name"], lambda name, members: command + members)

    def check(self):
        """Fails if a pattern of long_tests.md names nothing."""
        unused = [pattern for pattern in self.long if pattern not in self.used]
        if unused and self.is_complete:
            sys.exit("tests/long_tests.md: no test has the name " + ", ".join(unused))


def quoted(text):
    fence = "=" * next(n for n in range(1, 9) if f"]{'=' * n}]" not in text)
    return f"[{fence}[{text}]{fence}]"


def properties(test, manifest):
    least = LONG_HANGS_SECONDS_MIN if test.long else HANGS_SECONDS_MIN
    timeout = max(least, HANGS_FACTOR * test.cost) * manifest["time_scale"]
    entry = test.entry
    labels = [entry["label"], *(["script"] if entry["script"] else []),
              *(["long"] if test.long else [])]
    values = {"LABELS": ";".join(labels), "TIMEOUT": f"{timeout:.0f}",
              "COST": "-1" if entry["last"] else f"{test.cost:g}",
              "ENVIRONMENT": ";".join(entry["environment"]), "FIXTURES_REQUIRED": entry["needs"],
              "FIXTURES_SETUP": entry["gives"], "SKIP_REGULAR_EXPRESSION": entry["skipped"],
              "WORKING_DIRECTORY": manifest["folder"]}
    return " ".join(f"{key} {quoted(value)}" for key, value in values.items() if value)


def write(tests, manifest, path):
    launcher = [manifest["launcher"], manifest["costs"]]
    with open(path, "w", encoding="utf-8") as file:
        for test in tests:
            command = " ".join(quoted(word) for word in [*launcher, test.name, *test.command])
            file.write(f"add_test({quoted(test.name)} {command})\n"
                       f"set_tests_properties({quoted(test.name)} PROPERTIES "
                       f"{properties(test, manifest)})\n")


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        manifest = json.load(file)
    os.makedirs(manifest["reports"], exist_ok=True)
    listings = Listings(os.path.join(os.path.dirname(sys.argv[2]), "listed_cases.json"))
    listings.fill([entry["command"][0] for entry in manifest["tests"]
                   if entry["cases"] and os.path.exists(entry["command"][0])])
    registry = Registry(manifest, listings)
    for entry in manifest["tests"]:
        (registry.add_program if entry["cases"] else registry.add_script)(entry)
    registry.check()
    write(registry.tests, manifest, sys.argv[2])


if __name__ == "__main__":
    main()
