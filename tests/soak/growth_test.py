#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""growth.py tells what grows from what only varies."""
import random
import unittest

from growth import LIMITS, verdicts

HOUR = 3600


def rows(memory):
    """Samples of an hour, each 10 s; memory: a function of the second."""
    level = {name: 10 for name, _, _, _ in LIMITS}
    return [{"seconds": t, "age": 100, **level, "memory": memory(t)} for t in range(0, HOUR, 10)]


def grown(found):
    return [verdict.name for verdict in found if verdict.grows]


class GrowthTest(unittest.TestCase):
    def test_a_leak_is_found_beneath_noise(self):
        noise = random.Random(1)
        found = verdicts(rows(lambda t: 200 + 80 * t / HOUR + noise.uniform(-20, 20)))
        self.assertEqual(grown(found), ["memory"])

    def test_noise_peaks_and_warm_up_are_no_growth(self):
        noise = random.Random(1)
        self.assertEqual(grown(verdicts(rows(lambda t: 200 + noise.uniform(-50, 50)))), [])
        self.assertEqual(grown(verdicts(rows(lambda t: 900 if t % 100 == 0 else 200))), [])
        self.assertEqual(grown(verdicts(rows(lambda t: min(200, t)))), [])

    def test_a_shrinking_process_and_a_young_one_do_not_count(self):
        self.assertEqual(grown(verdicts(rows(lambda t: 900 - t / 10))), [])
        young = [dict(row, age=1) for row in rows(lambda t: t)]
        self.assertEqual(verdicts(young), [])


if __name__ == "__main__":
    unittest.main()
