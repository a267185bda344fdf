#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs all fuzz targets under libFuzzer and prints their runs, coverage and findings.

Usage: fuzz.py --minutes N [-j CORES] [--target NAME]... [--build DIR] [--json FILE]

N are minutes of processor time, shared evenly by the targets; on a busy machine they get less, and
the last line says how much. Build them before:

    cmake --preset fuzz && cmake --build --preset fuzz

Each target starts from tests/fuzz/corpus and tests/fuzz/regressions, and from what earlier runs
found, which is kept in the build folder. A finding is left in DIR/findings/TARGET; the exit code is
then 1. It becomes a file of tests/fuzz/regressions/TARGET together with its fix. Findings of
earlier runs that the target bears by now are removed.
"""
import argparse
import concurrent.futures
import glob
import json
import os
import re
import resource
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
SEEDS = ("corpus", "regressions")
INPUT_BYTES_MAX = 1 << 16
MEMORY_MB_MAX = 2048
INPUT_SECONDS_MAX = 60  # Also on a busy machine; some scenes take seconds under ASan.
OPTIONS = {
    "ASAN_OPTIONS": "detect_stack_use_after_return=1:strict_string_checks=1:allocator_may_return_"
                    "null=1",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
    "LSAN_OPTIONS": "suppressions=" + os.path.join(ROOT, "tests", "support", "lsan.supp"),
}
# Leaks of libraries are told apart by full stacks, which take 2.6 times as long as the rest; the
# preset "asan" looks for leaks in fuzz_replay.
LEAKS_ELSEWHERE = {"image"}


def programs(build, only):
    found = {os.path.basename(path)[:-len("_fuzz")]: path
             for path in sorted(glob.glob(os.path.join(build, "bin", "*_fuzz")))}
    if not found:
        sys.exit(f"no fuzz targets in {build}/bin: cmake --preset fuzz && cmake --build "
                 "--preset fuzz")
    unknown = set(only) - set(found)
    if unknown:
        sys.exit("no such target: " + ", ".join(sorted(unknown)))
    return {name: path for name, path in found.items() if not only or name in only}


def write_volume_seeds(build):
    """The corpora of the targets volume, vdb and pages are too large for the repository."""
    folder = os.path.join(build, "corpus")
    subprocess.run([os.path.join(build, "bin", "volume_seeds"), folder], check=True)


def options(name):
    """The environment of a target."""
    result = dict(os.environ, **OPTIONS)
    if name in LEAKS_ELSEWHERE:
        result["ASAN_OPTIONS"] += ":detect_leaks=0"
    return result


def forget_mended(program, findings, environment):
    """Removes the findings of earlier runs that the target bears by now."""
    for name in os.listdir(findings):
        path = os.path.join(findings, name)
        if name != "log" and subprocess.run(
                [program, f"-rss_limit_mb={MEMORY_MB_MAX}", f"-timeout={INPUT_SECONDS_MAX}", path],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                check=False, env=environment).returncode == 0:
            os.remove(path)


def fuzz(name, program, build, seconds):
    """Runs one target; returns its figures."""
    corpus = os.path.join(build, "corpus", name)
    findings = os.path.join(build, "findings", name)
    for folder in (corpus, findings):
        os.makedirs(folder, exist_ok=True)
    forget_mended(program, findings, options(name))
    seeds = [path for path in (os.path.join(HERE, seed, name) for seed in SEEDS)
             if os.path.isdir(path)]
    dictionary = os.path.join(HERE, "dictionaries", name + ".dict")
    log_path = os.path.join(findings, "log")
    with open(log_path, "w", encoding="utf-8") as log:
        done = subprocess.run(
            [program, f"-max_total_time={max(1, round(seconds))}", f"-max_len={INPUT_BYTES_MAX}",
             f"-rss_limit_mb={MEMORY_MB_MAX}", f"-timeout={INPUT_SECONDS_MAX}",
             f"-report_slow_units={INPUT_SECONDS_MAX}", f"-artifact_prefix={findings}/",
             "-print_final_stats=1",
             "-entropic=0",  # Its table of frequencies takes half of the time.
             *([f"-dict={dictionary}"] if os.path.exists(dictionary) else []), corpus, *seeds],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=log, check=False,
            env=options(name))
    with open(log_path, encoding="utf-8", errors="replace") as log:
        said = log.read()
    runs = re.search(r"number_of_executed_units: (\d+)", said)
    covered = re.findall(r"cov: (\d+) ft: (\d+) corp: (\d+)", said)
    kept = sorted(path for path in os.listdir(findings) if path != "log")
    return {"target": name, "runs": int(runs[1]) if runs else 0,
            "coverage": int(covered[-1][0]) if covered else 0,
            "features": int(covered[-1][1]) if covered else 0,
            "corpus": int(covered[-1][2]) if covered else 0, "findings": kept,
            "failed": done.returncode != 0, "log": log_path}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("-j", type=int, default=os.cpu_count(), help="targets at a time")
    parser.add_argument("--target", action="append", default=[])
    parser.add_argument("--build", default=os.path.join(ROOT, "build", "fuzz"))
    parser.add_argument("--json", metavar="FILE")
    arguments = parser.parse_args()
    build = os.path.abspath(arguments.build)
    targets = programs(build, arguments.target)
    if {"volume", "vdb", "pages"} & set(targets):
        write_volume_seeds(build)
    seconds = 60 * arguments.minutes / len(targets)
    with concurrent.futures.ThreadPoolExecutor(arguments.j) as pool:
        rows = list(pool.map(lambda item: fuzz(*item, build, seconds), targets.items()))
    print(f"{'target':16}  {'runs':>10}  {'edges':>6}  {'features':>8}  {'corpus':>6}  findings")
    for row in rows:
        print(f"{row['target']:16}  {row['runs']:10}  {row['coverage']:6}  {row['features']:8}  "
              f"{row['corpus']:6}  {', '.join(row['findings']) or '-'}")
        if row["failed"]:
            print(f"  see {row['log']}")
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{sum(row['runs'] for row in rows)} runs of {len(rows)} targets in "
          f"{(used.ru_utime + used.ru_stime) / 60:.1f} minutes of processor time, "
          f"{sum(len(row['findings']) for row in rows)} findings")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)
    return 1 if any(row["failed"] or row["findings"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
