# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The rows of docs/hard-cases.md, and the tests that they name."""
import collections
import functools
import os
import re

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DOCUMENT = os.path.join(ROOT, "docs", "hard-cases.md")
SOURCE_FOLDERS = ("cli", "common", "coordinator", "tests", "worker")

# A test that is named after a case: G1SpawnedRays..., M2_ARoughMirror...
CASE_OF_TEST = re.compile(r"([GCRMLVA]\d{1,2})(?=[A-Z_])")
TEST = re.compile(r"^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", re.MULTILINE)
RECORD = re.compile(r"\.row = \"(\w+)\"")
NO_NAIVE_TITLE = "Rows without a naive value"

# name: "G1"; patterns: of the tests, "Suite.G1*"; no_naive: why there is no naive value.
Row = collections.namedtuple("Row", "name section case why expected patterns source no_naive")


def table_rows(text):
    """(section, cells) of every line of a table except its header."""
    section = ""
    previous = ""
    for line in text.splitlines():
        if line.startswith("## "):
            section = line[3:].strip()
        is_row = line.startswith("|") and previous.startswith("|")
        if is_row and not set(line) <= set("|- "):
            yield section, [cell.strip() for cell in line.strip("|").split("|")]
        previous = line


def read_rows(path=DOCUMENT):
    """Rows in the document's order."""
    with open(path, encoding="utf-8") as file:
        cells_of = list(table_rows(file.read()))
    reasons = {cells[0]: cells[1] for section, cells in cells_of if section == NO_NAIVE_TITLE}
    rows = []
    for section, cells in cells_of:
        if section == NO_NAIVE_TITLE:
            continue
        name, case, why, expected, tests, source = cells
        patterns = re.findall(r"`([^`]+)`", tests)
        rows.append(Row(name, section, case, why, expected, patterns, source, reasons.get(name)))
    return rows


@functools.lru_cache(maxsize=None)  # Every pattern meets thousands of tests.
def expression_of(pattern):
    expression = re.escape(pattern).replace(r"\*", ".*")
    return re.compile(re.sub(r"(?<=\d)\.\*", r"(?!\\d).*", expression))


def matches(pattern, test):
    """Whether "Suite.G1*" matches the test "Suite.G1Name"; it does not match "Suite.G10Name"."""
    return expression_of(pattern).fullmatch(test) is not None


def tests_of(row, tests):
    return [test for test in tests if any(matches(pattern, test) for pattern in row.patterns)]


def sources():
    """(path, text) of every C++ test."""
    for folder in SOURCE_FOLDERS:
        for at, _, names in os.walk(os.path.join(ROOT, folder)):
            for name in sorted(names):
                if name.endswith("_test.cc"):
                    path = os.path.join(at, name)
                    with open(path, encoding="utf-8") as file:
                        yield os.path.relpath(path, ROOT), file.read()
