#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Counts the instructions that a compiled-in trait costs a scene that does not use it.

Runs each case of sheaf_trait_cost_test under callgrind and compares the instructions of rendering
with the variant that the plan chose and with that variant with the trait compiled out. The counts
do not depend on the machine's load. SHEAF_BIN: the folder of the built programs.
"""
import os
import re
import shutil
import subprocess
import tempfile
import unittest

ALLOWED = 1.01
TEST = os.path.join(os.environ.get("SHEAF_BIN", "build/release/bin"), "sheaf_trait_cost_test")


def cases():
    listed = subprocess.run([TEST, "--gtest_list_tests", "--gtest_filter=Traits/*"],
                            capture_output=True, text=True, check=True).stdout
    return [line.split()[0] for line in listed.splitlines() if line.startswith("  ")]


def inclusive_counts(case, folder):
    """Instructions of RenderAsPlanned and RenderWithout, including their callees."""
    profile = os.path.join(folder, "profile")
    subprocess.run(["valgrind", "--tool=callgrind", "--callgrind-out-file=" + profile, TEST,
                    "--gtest_filter=Traits/CarriedTraitTest." + case],
                   capture_output=True, text=True, check=True)
    table = subprocess.run(["callgrind_annotate", "--inclusive=yes", "--threshold=100", profile],
                           capture_output=True, text=True, check=True).stdout
    counts = []
    for function in ("RenderAsPlanned", "RenderWithout"):
        found = re.search(r"^\s*([\d,]+).*sheaf::render::" + function + r"\(", table, re.MULTILINE)
        counts.append(int(found.group(1).replace(",", "")))
    return counts


class TraitCostTest(unittest.TestCase):
    def test_unused_traits_cost_nothing(self):
        self.assertTrue(shutil.which("valgrind"), "valgrind is needed (deploy/packages.txt, test)")
        names = cases()
        self.assertTrue(names)
        for case in names:
            with self.subTest(case), tempfile.TemporaryDirectory() as folder:
                planned, without = inclusive_counts(case, folder)
                print("%-32s %12d instructions, %12d without, ratio %.4f"
                      % (case, planned, without, planned / without), flush=True)
                self.assertLess(planned / without, ALLOWED)


if __name__ == "__main__":
    unittest.main(verbosity=2)
