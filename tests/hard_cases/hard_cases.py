#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of every hard case of docs/hard-cases.md and writes their measurements.

    tests/hard_cases/hard_cases.py [--build build/release] [--out build/release/hard_cases]
        [--short] [--jobs N] [--reports FOLDER]

The folder of --out receives hard-cases.html, a page that loads nothing else, and hard-cases.json,
in which the strings "nan", "inf" and "-inf" stand for numbers that JSON lacks. --short omits the
tests of tests/long_tests.md; SHEAF_LONG_TESTS=1 lengthens the others. --reports takes the results
of tests that ctest ran since they were built. Exits with 1 if a row is red: a test fails, is not
built, or records no figure.
"""
import argparse
import concurrent.futures
import fnmatch
import glob
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree

import catalogue
import page

sys.path.insert(0, os.path.join(catalogue.ROOT, "tests", "harness"))
import register_tests  # noqa: E402  pylint: disable=wrong-import-position

PROGRAM_SECONDS_MAX = 14400
LIST_SECONDS_MAX = 60
# The same as kStandardErrorsMax of tests/support/hard_case.h.
STANDARD_ERRORS_MAX = 5
RECORD_PREFIX = "hard_case "


def list_tests(program):
    """Names "Suite.Name" of the tests in a program."""
    listed = subprocess.run([program, "--gtest_list_tests"], capture_output=True, text=True,
                            timeout=LIST_SECONDS_MAX, check=True).stdout
    tests, suite = [], ""
    for line in listed.splitlines():
        words = line.split()
        if not words:
            continue
        if line.startswith("  "):
            tests.append(suite + words[0])
        elif words[0].endswith("."):
            suite = words[0]
    return tests


def find_tests(bin_folder):
    """{test: program} for all built test programs."""
    programs = sorted(os.path.join(bin_folder, name) for name in os.listdir(bin_folder)
                      if name.startswith("sheaf_") and name.endswith("_test"))
    return {test: program for program in programs for test in list_tests(program)}


def run_program(program, tests):
    """{test: its object of GoogleTest's JSON}, and a message if the program itself failed."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        environment = {**os.environ, "GTEST_FILTER": ":".join(tests),
                       "GTEST_OUTPUT": "json:" + report, "SHEAF_SOURCE": catalogue.ROOT}
        try:
            done = subprocess.run([program], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                  timeout=PROGRAM_SECONDS_MAX, check=False)
        except subprocess.TimeoutExpired:
            return {}, f"took over {PROGRAM_SECONDS_MAX} s"
        if not os.path.exists(report):
            return {}, f"ended with {done.returncode}: {done.stdout[-500:]}"
        with open(report, encoding="utf-8") as file:
            suites = json.load(file)["testsuites"]
    return {f"{suite['name']}.{test['name']}": test
            for suite in suites for test in suite["testsuite"]}, ""


def report_of(case):
    """A test's result in GoogleTest's XML as an object of its JSON."""
    report = {"result": case.get("result", "").upper(), "time": case.get("time", "0") + "s",
              **{p.get("name"): p.get("value") for p in case.iter("property")}}
    failures = [failure.get("message") for failure in case.iter("failure")]
    return {**report, "failures": failures} if failures else report


def read_reports(folder, program_of, tests):
    """{test: its report} of those that have a complete one, newer than the program."""
    found, wanted = {}, set(tests)
    for path in sorted(glob.glob(os.path.join(folder, "*.xml")), key=os.path.getmtime):
        try:
            root = xml.etree.ElementTree.parse(path).getroot()
        except (FileNotFoundError, xml.etree.ElementTree.ParseError):
            continue  # ctest runs it just now.
        for case in root.iter("testcase"):
            test = f"{case.get('classname')}.{case.get('name')}"
            if test in wanted and os.path.getmtime(path) >= os.path.getmtime(program_of[test]):
                found[test] = report_of(case)
    return found


def run_tests(program_of, tests, jobs):
    """{test: its report} and {program: failure}."""
    by_program = {}
    for test in tests:
        by_program.setdefault(program_of[test], []).append(test)
    reports, failures = {}, {}
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        runs = {pool.submit(run_program, program, names): program
                for program, names in by_program.items()}
        for run in concurrent.futures.as_completed(runs):
            found, failure = run.result()
            reports.update(found)
            if failure:
                failures[runs[run]] = failure
    return reports, failures


def float_ulp(value):
    """The spacing of single-precision floats at the value."""
    return 2.0 ** max(math.floor(math.log2(abs(value))) - 23, -149) if value else 2.0 ** -149


def is_within(value, expected, bar):
    return abs(value - expected) <= bar


def figure_of(words, record, test):
    """A figure of the output JSON, from a test's record."""
    record = json.loads(record)
    number = {key: float(value) for key, value in record.items() if key != "naive_by"}
    bar = STANDARD_ERRORS_MAX * number["standard_error"] + number["tolerance"]
    off = number["measured"] - number["expected"]
    figure = {"figure": words, "test": test, **number, "bar": bar,
              "holds": is_within(number["measured"], number["expected"], bar),
              "z": off / number["standard_error"] if number["standard_error"] else None,
              "ulps": None, "naive_by": record["naive_by"]}
    if not number["standard_error"] and (number["expected"] or not off):
        figure["ulps"] = abs(off) / float_ulp(number["expected"])
    if "naive" in number:
        figure["naive_holds"] = is_within(number["naive"], number["expected"], bar)
    return figure


def figures_of(row_name, reports):
    """The records of this row, also those of tests with other names."""
    prefix = f"{RECORD_PREFIX}{row_name} "
    return [figure_of(key[len(prefix):], value, test)
            for test, report in sorted(reports.items())
            for key, value in report.items() if key.startswith(prefix)]


def seconds_of(report):
    return float(report.get("time", "0s").rstrip("s"))


def judge(row, tests, left_out, reports):
    """The row's object in the output JSON."""
    own = catalogue.tests_of(row, tests)
    problems = [f"{pattern} names no test that is built" for pattern in row.patterns
                if not any(catalogue.matches(pattern, test) for test in tests)]
    results = []
    for test in own:
        report = reports.get(test)
        result = {"test": test, "result": "left out", "seconds": 0}
        if report is not None:
            result = {"test": test, "result": "failed" if report.get("failures") else
                      "passed" if report.get("result") == "COMPLETED" else "skipped",
                      "seconds": seconds_of(report)}
        elif test not in left_out:
            result["result"] = "failed"
        if result["result"] == "failed":
            problems.append(f"{test} failed")
        results.append(result)
    figures = figures_of(row.name, reports)
    if not own:
        problems.append("no test")
    if not figures:
        problems.append("no figure was recorded")
    problems += [f"{f['figure']}: beyond its bar" for f in figures if not f["holds"]]
    if figures and not row.no_naive and not any("naive" in f for f in figures):
        problems.append("no naive value, and the document does not say why")
    return {"name": row.name, "section": row.section, "case": row.case, "why": row.why,
            "expected": row.expected, "source": row.source, "no_naive": row.no_naive,
            "verdict": "red" if problems else "green", "problems": problems,
            "seconds": sum(result["seconds"] for result in results), "figures": figures,
            "tests": results}


def summarize(cases, short, seconds):
    figures = [figure for case in cases for figure in case["figures"]]
    naive = [figure for figure in figures if "naive" in figure]
    ran = {test["test"] for case in cases for test in case["tests"]
           if test["result"] != "left out"}
    return {"cases": len(cases), "green": sum(case["verdict"] == "green" for case in cases),
            "red": [case["name"] for case in cases if case["verdict"] == "red"],
            "figures": len(figures), "tests": len(ran), "naive": len(naive),
            "naive_wrong": sum(not figure["naive_holds"] for figure in naive),
            "cases_with_naive": sum(any("naive" in f for f in case["figures"]) for case in cases),
            "short": short, "seconds": seconds}


def for_json(value):
    """Replaces numbers that JSON lacks by strings."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {key: for_json(item) for key, item in value.items()}
    return [for_json(item) for item in value] if isinstance(value, list) else value


def measure(rows, build, short, jobs, reports_folder):
    """The complete output JSON."""
    started = time.monotonic()
    program_of = find_tests(os.path.join(build, "bin"))
    wanted = sorted({test for row in rows for test in catalogue.tests_of(row, program_of)})
    long = register_tests.read_long_tests() if short else []
    left_out = {test for test in wanted
                if any(fnmatch.fnmatchcase(test, pattern) for pattern in long)}
    wanted = [test for test in wanted if test not in left_out]
    known = read_reports(reports_folder, program_of, wanted) if reports_folder else {}
    reports, failures = run_tests(program_of, [t for t in wanted if t not in known], jobs)
    reports.update(known)
    cases = [judge(row, list(program_of), left_out, reports) for row in rows]
    for program, failure in failures.items():
        print(f"{program} {failure}", file=sys.stderr)
    return {"summary": summarize(cases, short, time.monotonic() - started), "cases": cases}


def summary_line(summary):
    red = f" Red: {', '.join(summary['red'])}." if summary["red"] else ""
    return (f"{summary['green']} of {summary['cases']} cases hold, by {summary['figures']} figures "
            f"and {summary['tests']} tests in {summary['seconds']:.0f} s"
            f"{' (short form)' if summary['short'] else ''}.{red} The naive formula is beyond the "
            f"error bar in {summary['naive_wrong']} of the {summary['naive']} figures that have "
            f"one ({summary['cases_with_naive']} cases).")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=os.path.abspath,
                        default=os.path.join(catalogue.ROOT, "build", "release"),
                        help="the build folder, whose bin has the test programs")
    parser.add_argument("--out", help="where to write; default: hard_cases in the build folder")
    parser.add_argument("--short", action="store_true", help="leave out the longest tests")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)),
                        help="programs at a time; default: one for each processor")
    parser.add_argument("--reports", metavar="FOLDER", help="where ctest leaves results as XML")
    options = parser.parse_args()
    if not os.path.isdir(os.path.join(options.build, "bin")):
        sys.exit(f"{options.build}: no folder bin with test programs; ./tests/run builds them")
    result = measure(catalogue.read_rows(), options.build, options.short, options.jobs,
                     options.reports)
    out = options.out or os.path.join(options.build, "hard_cases")
    os.makedirs(out, exist_ok=True)
    with open(os.path.join(out, "hard-cases.json"), "w", encoding="utf-8") as file:
        json.dump(for_json(result), file, indent=1, ensure_ascii=False, allow_nan=False)
    with open(os.path.join(out, "hard-cases.html"), "w", encoding="utf-8") as file:
        file.write(page.render(result, summary_line(result["summary"])))
    for case in result["cases"]:
        for problem in case["problems"]:
            print(f"{case['name']}: {problem}", file=sys.stderr)
    print(summary_line(result["summary"]))
    print(f"wrote {os.path.join(out, 'hard-cases.html')}")
    return 0 if result["summary"]["green"] == result["summary"]["cases"] else 1


if __name__ == "__main__":
    sys.exit(main())
