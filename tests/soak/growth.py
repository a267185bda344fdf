# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Measures what a coordinator holds, and judges whether it grows. For soak.py.

A quantity grows where the slope of a line through its samples (Theil 1950, Sen 1968: the median of
the slopes of all pairs, which no few samples bend) is beyond its limit, and so is the rise from the
first third of the samples to the last, as a median. Samples of the warm-up do not count. A killed
coordinator begins anew, so memory, files and threads are judged by their age-independent level: the
first samples of each coordinator are left out.
"""
import os
import statistics
import time

# Part of the run in which caches fill.
WARM_UP_PART = 0.3
# Samples of a coordinator before the first that counts.
YOUNG_SAMPLES = 3
SAMPLES_MIN = 9
# Pairs of samples of which slopes are taken, evenly spread, at most.
PAIRS_MAX = 200_000
# (name, unit, rise that is no growth, slope an hour that is none beyond it). The rise is what a
# short run may show for reasons that end: caches, tables, a job more than before.
LIMITS = (
    ("memory", "MiB", 24, 16),
    ("open files", "", 24, 12),
    ("threads", "", 24, 12),
    ("disk", "MiB", 56, 24),
    ("database", "MiB", 4, 4),
)


class Sampler:
    """Takes a row whenever the time has come: {"seconds", "age", and each quantity}; the age is the
    number of earlier rows of the same coordinator.
    """

    def __init__(self, farm, interval_seconds):
        self.farm = farm
        self.interval = interval_seconds
        self.begin = time.monotonic()
        self.next = self.begin
        self.rows = []
        self.pid, self.age = None, 0

    def sample(self):
        now = time.monotonic()
        if now < self.next:
            return
        self.next = now + self.interval
        pid = self.farm.coordinator.pid
        self.age = self.age + 1 if self.pid == pid else 0
        self.pid = pid
        row = measure(pid, self.farm.path("state"))
        self.rows.append({"seconds": now - self.begin, "age": self.age, **row})


def measure(pid, state):
    with open(f"/proc/{pid}/status", encoding="utf-8") as file:
        status = dict(line.split(":", 1) for line in file)
    disk = database = 0
    for folder, _, names in os.walk(state):
        for name in names:
            try:
                size = os.stat(os.path.join(folder, name)).st_size
            except FileNotFoundError:
                continue  # Removed meanwhile.
            disk += size
            database += size if name.startswith("farm.db") else 0
    return {"memory": int(status["VmRSS"].split()[0]) / 1024,
            "open files": len(os.listdir(f"/proc/{pid}/fd")),
            "threads": int(status["Threads"]),
            "disk": disk / 2**20, "database": database / 2**20}


def slope(points):
    """Theil-Sen slope of (time, value) points."""
    count = len(points)
    step = max(1, count * (count - 1) // 2 // PAIRS_MAX)
    slopes = []
    pair = 0
    for i in range(count):
        for j in range(i + 1, count):
            pair += 1
            if pair % step == 0 and points[j][0] > points[i][0]:
                slopes.append((points[j][1] - points[i][1]) / (points[j][0] - points[i][0]))
    return statistics.median(slopes)


class Verdict:
    def __init__(self, name, unit, rise_max, slope_max, points):
        third = len(points) // 3
        self.name, self.unit = name, unit
        self.count = len(points)
        self.before = statistics.median(value for _, value in points[:third])
        self.after = statistics.median(value for _, value in points[-third:])
        self.hourly = 3600 * slope(points)
        words = " " + unit if unit else ""
        self.limit = f"{slope_max:g}{words} an hour, and a rise of {rise_max:g}{words}"
        self.grows = self.after - self.before > rise_max and self.hourly > slope_max

    def row(self):
        unit = " " + self.unit if self.unit else ""
        mark = " **grows**" if self.grows else ""
        levels = f"{self.before:.1f}{unit} | {self.after:.1f}{unit}"
        return (f"| {self.name} | {self.count} | {levels} | {self.hourly:+.1f}{unit}{mark} | "
                f"{self.limit} |")


def verdicts(rows):
    """One for each quantity of which there are enough samples."""
    found = []
    warm = WARM_UP_PART * rows[-1]["seconds"]
    for name, unit, rise_max, slope_max in LIMITS:
        points = [(row["seconds"], row[name]) for row in rows
                  if row["seconds"] >= warm and row["age"] >= YOUNG_SAMPLES]
        if len(points) >= SAMPLES_MIN:
            found.append(Verdict(name, unit, rise_max, slope_max, points))
    return found
