#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Durable parts and completions per second on PostgreSQL against SQLite, in turns.

    tests/engines/postgresql/bench.py [--seconds 3] [--rounds 3]

The server commits with fsync, on the same disk as the parts.
"""
import argparse
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "..", "integration")]
import farm  # noqa: E402
import postgres  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=float, default=3, help="of each row of store_bench")
    parser.add_argument("--rounds", type=int, default=3, help="of completions_bench")
    arguments = parser.parse_args()
    if postgres.programs() is None:
        print("skipped: PostgreSQL's server is not installed (tests/engines/postgresql/install)")
        return 0
    with postgres.Server() as server, tempfile.TemporaryDirectory() as folder:
        for name, url in (("SQLite", []), ("PostgreSQL", [server.url]), ("SQLite", []),
                          ("PostgreSQL", [server.url])):
            print(name, flush=True)
            subprocess.run([os.path.join(farm.programs(), "store_bench"),
                            os.path.join(folder, "store"), str(arguments.seconds), *url],
                           check=True)
        environment = dict(os.environ, SHEAF_BENCH_DATABASE=server.url,
                           SHEAF_BENCH_ROUNDS=str(arguments.rounds))
        subprocess.run([os.path.join(farm.programs(), "completions_bench"),
                        "--gtest_filter=*Databases"], env=environment, check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
