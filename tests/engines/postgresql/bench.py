#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Completions per second on PostgreSQL against SQLite, in turns.

    tests/engines/postgresql/bench.py [--seconds 3] [--turns 2] [--rounds 3] [--folder DIR]

A completion is a result of 24 KB whose part is on the disk and whose row is committed with fsync.
First the store alone takes them from threads that do nothing else (store_bench), then a coordinator
from synthetic workers (completions_bench), which render on the same processors. The parts and the
server's data are on one disk: that of DIR. Every group of results also waits for all other writes
to that file system (docs/adr/0075).
"""
import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "..", "integration")]
import farm  # noqa: E402
import postgres  # noqa: E402

COMPLETIONS_WANTED = 1000  # A second, on PostgreSQL.
WRITERS_JUDGED = 100
STORES = ("SQLite", "PostgreSQL")
ROWS_OF_STORE_BENCH = 4
# Limits a run on one store beyond the measured time: its start, stop, and removal of its parts.
OVERHEAD_SECONDS_MAX = 20 * farm.TIME_SCALE
RUN_SECONDS_MAX = 10  # For completions_bench, on one store.
ROW = re.compile(r"\s*(\d+) writers: +(\d+) durable")
RUN = re.compile(r"(SQLite|PostgreSQL): (\d+) results/s")


def lines_of(command, seconds_max, **environment):
    """The lines of a program's output, which are printed as they come."""
    begin = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env=dict(os.environ, **environment)) as process:
        timer = threading.Timer(seconds_max, process.kill)
        timer.start()
        try:
            for line in process.stdout:
                if ROW.match(line) or RUN.match(line):
                    print(f"  {time.monotonic() - begin:5.1f} s  {line.rstrip()}", flush=True)
                yield line
        finally:
            is_late = not timer.is_alive()
            timer.cancel()
    name = os.path.basename(command[0])
    if is_late:
        sys.exit(f"{name} did not end within {seconds_max:.0f} s: run it while the machine does "
                 "nothing else, or allow more by SHEAF_TIME_SCALE")
    if process.returncode != 0:
        sys.exit(f"{name} failed with exit code {process.returncode}")


def measure_stores(url, folder, arguments):
    """{writers: {store: completions per second of each turn}}."""
    found = {}
    for turn in range(arguments.turns):
        for store in STORES:
            print(f"the store alone, turn {turn + 1}: {store}", flush=True)
            command = [os.path.join(farm.programs(), "store_bench"), os.path.join(folder, "store"),
                       str(arguments.seconds), url if store == "PostgreSQL" else "sqlite"]
            most = ROWS_OF_STORE_BENCH * arguments.seconds + OVERHEAD_SECONDS_MAX
            for row in filter(None, map(ROW.match, lines_of(command, most))):
                found.setdefault(int(row[1]), {}).setdefault(store, []).append(int(row[2]))
    return found


def measure_coordinators(url, folder, arguments):
    """{store: completions per second of each round}."""
    print(f"a coordinator with workers, {arguments.rounds} rounds", flush=True)
    found = {}
    command = [os.path.join(farm.programs(), "completions_bench"), "--gtest_filter=*Databases"]
    most = 2 * arguments.rounds * (RUN_SECONDS_MAX + OVERHEAD_SECONDS_MAX)
    for run in filter(None, map(RUN.match, lines_of(
            command, most, SHEAF_BENCH_DATABASE=url, SHEAF_BENCH_ROUNDS=str(arguments.rounds),
            SHEAF_BENCH_SECONDS=str(RUN_SECONDS_MAX), TEST_TMPDIR=folder))):
        found.setdefault(run[1], []).append(int(run[2]))
    return found


def print_table(rows):
    print(f"\n{'completions per second, medians':34}{'SQLite':>10}{'PostgreSQL':>12}{'ratio':>8}")
    for name, rates in rows:
        sqlite, on_postgres = (statistics.median(rates[store]) for store in STORES)
        print(f"{name:34}{sqlite:>10.0f}{on_postgres:>12.0f}{on_postgres / sqlite:>8.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=float, default=3, help="of each row of store_bench")
    parser.add_argument("--turns", type=int, default=2, help="of store_bench")
    parser.add_argument("--rounds", type=int, default=3, help="of completions_bench")
    parser.add_argument("--folder", default="/tmp", help="where the disk to measure is mounted")
    arguments = parser.parse_args()
    if postgres.programs() is None:
        print("skipped: PostgreSQL's server is not installed (tests/engines/postgresql/install)")
        return 0
    with postgres.Server(parent=arguments.folder) as server, \
            tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        by_writers = measure_stores(server.url, folder, arguments)
        by_store = measure_coordinators(server.url, folder, arguments)
    rows = [(f"the store alone, {n} writer{'s' if n > 1 else ''}", by_writers[n])
            for n in sorted(by_writers)]
    print_table([*rows, ("a coordinator with workers", by_store)])
    judged = statistics.median(by_writers[WRITERS_JUDGED]["PostgreSQL"])
    met = judged >= COMPLETIONS_WANTED
    print(f"PostgreSQL with {WRITERS_JUDGED} writers: {judged:.0f} completions a second; at least "
          f"{COMPLETIONS_WANTED} are wanted: {'met' if met else 'NOT met'}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
