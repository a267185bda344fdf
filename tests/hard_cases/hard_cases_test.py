#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Checks of the document of hard cases, the names of tests, and the page for given results."""
import fnmatch
import json
import os
import re
import tempfile
import unittest
import xml.sax.saxutils

import catalogue
import hard_cases
import page

CASE_COUNT = 113
# From a figure's row to the end of its call.
CALL = re.compile(r"\.row = \"(\w+)\"(.*?)\}\);", re.DOTALL)


def record(expected=1, measured=1, standard_error=0, tolerance=0, **naive):
    return json.dumps({"expected": expected, "measured": measured, "naive_by": "a form",
                       "standard_error": standard_error, "tolerance": tolerance, **naive})


def row(patterns=("Suite.G1*",), no_naive=None):
    return catalogue.Row("G1", "Geometry", "a case", "a reason", "1", list(patterns), "a book",
                         no_naive)


def report(failed=False, **records):
    found = {"result": "COMPLETED", "time": "0.5s",
             **{f"hard_case {name} words": text for name, text in records.items()}}
    return {**found, "failures": [{}]} if failed else found


class DocumentTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rows = catalogue.read_rows()
        cls.texts = [text for _, text in catalogue.sources()]
        cls.tests = [f"{suite}.{name}" for text in cls.texts
                     for suite, name in catalogue.TEST.findall(text)]

    def test_every_case_has_one_whole_line(self):
        names = [r.name for r in self.rows]
        self.assertEqual(len(set(names)), CASE_COUNT)
        self.assertEqual(len(names), CASE_COUNT)
        for r in self.rows:
            self.assertTrue(all((r.case, r.why, r.expected, r.patterns, r.source)), r.name)

    def test_every_name_in_the_document_is_a_test(self):
        missing = [f"{r.name}: {pattern}" for r in self.rows for pattern in r.patterns
                   if not any(catalogue.matches(pattern, test) for test in self.tests)]
        self.assertEqual(missing, [])

    def test_every_test_of_a_case_stands_in_its_line(self):
        by_name = {r.name: r for r in self.rows}
        missing = []
        for test in self.tests:
            case = catalogue.CASE_OF_TEST.match(test.split(".")[1])
            if case and (case[1] not in by_name
                         or not catalogue.tests_of(by_name[case[1]], [test])):
                missing.append(test)
        self.assertEqual(missing, [])

    def test_every_case_is_recorded_and_nothing_else(self):
        recorded = {name for text in self.texts for name in catalogue.RECORD.findall(text)}
        self.assertEqual(recorded, {r.name for r in self.rows})

    def test_rows_without_a_naive_value_are_those_that_say_why(self):
        with_naive = {name for text in self.texts for name, call in CALL.findall(text)
                      if ".naive = " in call}
        self.assertEqual({r.name for r in self.rows} - with_naive,
                         {r.name for r in self.rows if r.no_naive})

    def test_long_tests_leave_every_row_a_test(self):
        long = hard_cases.register_tests.read_long_tests()
        for r in self.rows:
            short = [test for test in catalogue.tests_of(r, self.tests)
                     if not any(fnmatch.fnmatchcase(test, pattern) for pattern in long)]
            self.assertTrue(short, r.name)


class JudgeTest(unittest.TestCase):
    def judge(self, reports, tests=("Suite.G1Name",), left_out=(), **of_row):
        return hard_cases.judge(row(**of_row), list(tests), set(left_out), reports)

    def problems(self, *arguments, **named):
        case = self.judge(*arguments, **named)
        self.assertEqual(case["verdict"], "red" if case["problems"] else "green")
        return case["problems"]

    def test_patterns_know_g1_from_g10(self):
        self.assertTrue(catalogue.matches("Suite.G1*", "Suite.G1Name"))
        self.assertFalse(catalogue.matches("Suite.G1*", "Suite.G10Name"))
        self.assertFalse(catalogue.matches("Suite.G1*", "OtherSuite.G1Name"))
        self.assertTrue(catalogue.matches("Suite.*", "Suite.Name"))

    def test_a_case_that_holds_is_green(self):
        self.assertEqual(self.problems({"Suite.G1Name": report(G1=record(naive="nan"))}), [])

    def test_what_makes_a_case_red(self):
        good = record(naive=0)
        self.assertIn("no test", self.problems({}, tests=["Other.Name"]))
        self.assertIn("no figure was recorded", self.problems({"Suite.G1Name": report()}))
        self.assertIn("Suite.G1Name failed",
                      self.problems({"Suite.G1Name": report(failed=True, G1=good)}))
        self.assertIn("Suite.G1Crashed failed",
                      self.problems({"Suite.G1Name": report(G1=good)},
                                    tests=["Suite.G1Name", "Suite.G1Crashed"]))
        self.assertIn("words: beyond its bar", self.problems(
            {"Suite.G1Name": report(G1=record(measured=1.1, tolerance=0.05, naive=0))}))
        self.assertIn("words: beyond its bar",
                      self.problems({"Suite.G1Name": report(G1=record(measured="nan", naive=0))}))
        self.assertIn("no naive value, and the document does not say why",
                      self.problems({"Suite.G1Name": report(G1=record())}))
        self.assertIn("Gone.G1* names no test that is built",
                      self.problems({"Suite.G1Name": report(G1=good)},
                                    patterns=["Suite.G1*", "Gone.G1*"]))

    def test_tests_that_are_left_out_do_not_fail(self):
        tests = ["Suite.G1Name", "Suite.G1Long"]
        self.assertEqual(self.problems({"Suite.G1Name": report(G1=record(naive=0))}, tests=tests,
                                       left_out=["Suite.G1Long"]), [])

    def test_deviations_are_in_standard_errors_or_ulps(self):
        by_chance = hard_cases.figure_of("words", record(measured=1.5, standard_error=0.25), "t")
        self.assertEqual((by_chance["z"], by_chance["ulps"], by_chance["holds"]), (2, None, True))
        computed = hard_cases.figure_of(
            "words", record(measured=1 + 2 ** -22, tolerance=1, naive="-inf"), "t")
        self.assertEqual((computed["z"], computed["ulps"]), (None, 2))
        self.assertFalse(computed["naive_holds"])


class ReportsTest(unittest.TestCase):
    """Results that ctest left as XML."""
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.program = os.path.join(self.folder.name, "program")
        with open(self.program, "w", encoding="utf-8"):
            os.utime(self.program, (1000, 1000))

    def read(self, inside="", time=2000, name="G1Name"):
        path = os.path.join(self.folder.name, "Suite.G1Name.xml")
        with open(path, "w", encoding="utf-8") as file:
            file.write(f'<testsuites><testsuite name="Suite"><testcase name="{name}" '
                       f'classname="Suite" result="completed" time="0.25">{inside}</testcase>'
                       '</testsuite></testsuites>')
        os.utime(path, (time, time))
        return hard_cases.read_reports(self.folder.name, {"Suite.G1Name": self.program},
                                       ["Suite.G1Name"])

    def test_they_are_those_of_the_program(self):
        value = xml.sax.saxutils.quoteattr(record(naive=0))
        reports = self.read('<properties><property name="hard_case G1 words" '
                            f'value={value}/></properties>')
        case = hard_cases.judge(row(), ["Suite.G1Name"], set(), reports)
        self.assertEqual((case["problems"], case["seconds"]), ([], 0.25))

    def test_failures_are_failures(self):
        case = hard_cases.judge(row(), ["Suite.G1Name"], set(),
                                self.read('<failure message="off"></failure>'))
        self.assertIn("Suite.G1Name failed", case["problems"])

    def test_others_are_run_again(self):
        self.assertEqual(self.read(time=500), {})
        self.assertEqual(self.read(name="G1Other"), {})
        self.assertEqual(self.read("<properties>"), {})


class PageTest(unittest.TestCase):
    def render(self, **records):
        case = hard_cases.judge(row(), ["Suite.G1Name"], set(),
                                {"Suite.G1Name": report(**records)})
        result = {"cases": [case], "summary": hard_cases.summarize([case], True, 1)}
        json.dumps(hard_cases.for_json(result), allow_nan=False)
        return page.render(result, hard_cases.summary_line(result["summary"]))

    def test_it_asks_for_nothing_else(self):
        text = self.render(G1=record(naive="nan"))
        self.assertIsNone(re.search(r"https?:|src=|@import|url\(|<script", text))

    def test_it_shows_what_was_measured(self):
        text = self.render(G1=record(expected=1e-6, measured=1e-6, naive="nan"))
        for words in ("1 of 1 cases hold", "NaN", "1·10<sup>−6</sup>", "a form", "Suite.G1Name",
                      'class="green"', "short form"):
            self.assertIn(words, text)

    def test_red_cases_say_why(self):
        text = self.render()
        self.assertIn('class="red"', text)
        self.assertIn("no figure was recorded", text)

    def test_words_are_escaped(self):
        self.assertIn("&lt;b&gt;", page.text("<b>"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
