#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Causes each kind of fault many times to small jobs of small farms, and prints the results.

Usage: faults.py [--times N] [--minutes M] [--farms N] [--kind NAME]... [--seed N]
       [--json FILE] [--journal FILE] [--list]

It runs in network and mount namespaces of its own, so that nothing outside is touched; kinds of
faults that this machine cannot cause are listed with the reason. The exit code is 1 if a job was
lost, an image differs, an acknowledged part was lost or merged twice, or no program reported a
fault that users must learn of. README.md says what each column means.
"""
import argparse
import concurrent.futures
import dataclasses
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from bench import UNDISTURBED_JOBS, Bench, Outcome, farm  # pylint: disable=wrong-import-position
import kinds  # pylint: disable=wrong-import-position
import process_faults  # pylint: disable=wrong-import-position,unused-import
import disk_faults  # pylint: disable=wrong-import-position,unused-import
import database_faults  # pylint: disable=wrong-import-position
import control_group  # pylint: disable=wrong-import-position
import machine_kinds  # pylint: disable=wrong-import-position,unused-import
import network_faults  # pylint: disable=wrong-import-position

INSIDE = "SHEAF_FAULTS_INSIDE"  # Set within the namespaces.
STATE_BYTES = "512m"  # Size of the file system of the coordinator's state.
PROBLEMS_SHOWN_MAX = 5  # For each kind.
FAILURES_MAX = 20  # On one farm; then its remaining faults are left out.


def enter_namespaces():
    """Runs this program again in namespaces of its own, if the machine allows it."""
    if INSIDE in os.environ:
        return
    as_root = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    inside = ["unshare", *as_root, "--net", "--mount"]
    probe = subprocess.run([*inside, "ip", "link", "set", "lo", "up"], capture_output=True,
                           text=True, check=False)
    os.environ[INSIDE] = "1" if probe.returncode == 0 else "0"
    if probe.returncode == 0:
        os.execvp(inside[0], [*inside, sys.executable, os.path.abspath(__file__), *sys.argv[1:]])


def missing():
    """Why this machine cannot provide what kinds need; "" where it can."""
    reasons = {"": "", "mounts": "", "tunnels": "", "groups": control_group.why_not()}
    reasons["sqlite3"] = "" if shutil.which("sqlite3") else "no program sqlite3"
    reasons["recover"] = reasons["sqlite3"] or database_faults.why_not_recover()
    if os.environ[INSIDE] != "1":
        reasons["mounts"] = reasons["tunnels"] = reasons["nft"] = "no namespaces: run as root"
        return reasons
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    if not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        reasons["tunnels"] = "no /dev/net/tun"
    reasons["nft"] = reasons["tunnels"] or ("" if shutil.which("nft") else "no program nft")
    folder = tempfile.mkdtemp()
    mount = subprocess.run(["mount", "-t", "tmpfs", "tmpfs", folder], capture_output=True,
                           text=True, check=False)
    if mount.returncode == 0:
        subprocess.run(["umount", folder], check=True)
    else:
        reasons["mounts"] = mount.stderr.strip()
    os.rmdir(folder)
    return reasons


class MountedBench(Bench):
    """A bench whose coordinator has a file system of its own."""

    def prepare_folder(self):
        state = self.farm.path("state")
        os.mkdir(state)
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=" + STATE_BYTES, "tmpfs", state],
                       check=True)
        self.stack.callback(shutil.rmtree, self.farm.folder, ignore_errors=True)
        self.stack.callback(subprocess.run, ["umount", "--lazy", state], check=False)


def make_bench(name, arguments, seed, with_mounts, undisturbed):
    bench_class = MountedBench if name == "disk" and with_mounts else Bench
    return bench_class(arguments.library, seed, network_faults.BENCHES.get(name, farm.Farm),
                       undisturbed, min(UNDISTURBED_JOBS, arguments.times))


def earlier_outcomes(journal, kind):
    """Those of earlier runs with the same journal."""
    if not journal or not os.path.exists(journal):
        return []
    with open(journal, encoding="utf-8") as file:
        notes = [json.loads(line) for line in file]
    return [Outcome(**of_one["outcome"]) for of_one in notes if of_one["kind"] == kind.name]


def note(journal, kind, outcome):
    if journal:
        with open(journal, "a", encoding="utf-8") as file:
            file.write(json.dumps({"kind": kind.name, "outcome": dataclasses.asdict(outcome)})
                       + "\n")


def run_bench(name, chosen, arguments, with_mounts, report):
    """Causes all kinds of one bench, in turns. A farm that a fault left unusable is replaced."""
    outcomes = {kind.name: earlier_outcomes(arguments.journal, kind) for kind in chosen}
    left = [kind for i in range(arguments.times) for kind in chosen
            if i >= len(outcomes[kind.name])]
    failures = 0
    undisturbed = None

    def goes_on():
        return left and failures < FAILURES_MAX and time.monotonic() < arguments.end

    while goes_on():
        seed = arguments.seed + len(left)
        with make_bench(name, arguments, seed, with_mounts, undisturbed) as bench:
            undisturbed = bench.undisturbed
            while goes_on():
                kind = left.pop(0)
                outcome = bench.run(kind.cause)
                if kind.must_tell and not outcome.told and not outcome.problem:
                    outcome.problem = "no program reported it"
                outcomes[kind.name].append(outcome)
                note(arguments.journal, kind, outcome)
                report(kind, outcome)
                failures += not outcome.survived
                if kind.spoils or not outcome.survived:
                    break
    return outcomes


def row_of(kind, outcomes):
    recoveries = [o.recovery_seconds for o in outcomes if o.survived] or [0.0]
    return {
        "kind": kind.name,
        "times": len(outcomes),
        "survived": sum(o.survived for o in outcomes),
        "told": sum(o.told for o in outcomes),
        "must_tell": kind.must_tell,
        "recovery_seconds_median": round(statistics.median(recoveries), 3),
        "recovery_seconds_max": round(max(recoveries), 3),
        "repeated_percent": round(100 * statistics.fmean([o.repeated for o in outcomes]), 1),
        "hash_equal": sum(o.hash_equal for o in outcomes),
        "acknowledged_lost": sum(o.lost for o in outcomes),
        "merged_twice": sum(o.twice for o in outcomes),
        "problems": [o.problem for o in outcomes if o.problem],
    }


def is_good(row):
    return (row["survived"] == row["hash_equal"] == row["times"] and not row["problems"]
            and row["acknowledged_lost"] == row["merged_twice"] == 0
            and (not row["must_tell"] or row["told"] == row["times"]))


def print_table(rows):
    columns = (("times", "times"), ("survived", "survived"), ("told", "told"),
               ("recovery_seconds_median", "recovery s"), ("recovery_seconds_max", "max s"),
               ("repeated_percent", "repeated %"), ("hash_equal", "hash equal"),
               ("acknowledged_lost", "lost"), ("merged_twice", "twice"))
    width = max(len(row["kind"]) for row in rows)
    print("  ".join([f"{'fault':{width}}", *(title for _, title in columns)]))
    for row in rows:
        cells = [f"{row[key]:>{len(title)}}" for key, title in columns]
        print("  ".join([f"{row['kind']:{width}}", *cells]))
    for row in rows:
        for problem in row["problems"][:PROBLEMS_SHOWN_MAX]:
            print(f"{row['kind']}: {problem}")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=50, help="occurrences of each kind")
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="ends then, with the faults so far; the exit code is 1")
    parser.add_argument("--farms", type=int, default=4, help="farms that work at the same time")
    parser.add_argument("--kind", action="append", default=[],
                        help="only kinds whose names contain this")
    parser.add_argument("--seed", type=int, default=int(time.time()) % 1_000_000)
    parser.add_argument("--json", metavar="FILE", help="writes the table as JSON too")
    parser.add_argument("--journal", metavar="FILE",
                        help="notes each outcome there; those of earlier runs count too")
    parser.add_argument("--list", action="store_true", help="prints the kinds and ends")
    parser.add_argument("--library", default=None, help="the built machine_faults library")
    return parser.parse_args()


def find_library():
    for folder in (os.path.join(os.path.dirname(farm.programs()), "tests"), farm.programs()):
        path = os.path.join(folder, "libsheaf_machine_faults.so")
        if os.path.exists(path):
            return path
    sys.exit("no libsheaf_machine_faults.so: build sheaf_machine_faults first")


def choose(arguments):
    """The kinds to cause, and rows of why others are left out."""
    reasons = missing()
    if not os.path.exists(os.path.join(farm.programs(), "sheaf_slow_tunnel")):
        reasons["tunnels"] = reasons["tunnels"] or "sheaf_slow_tunnel is not built"
    named = [k for k in kinds.KINDS
             if not arguments.kind or any(part in k.name for part in arguments.kind)]
    if not named:
        sys.exit("no such kind; --list prints them")
    skipped = [(k.name, reasons[k.needs]) for k in named if reasons[k.needs]]
    return [k for k in named if not reasons[k.needs]], skipped, not reasons["mounts"]


def main():
    arguments = parse_arguments()
    if arguments.list:
        print("\n".join(kind.name for kind in kinds.KINDS))
        return 0
    enter_namespaces()
    arguments.library = os.path.abspath(arguments.library or find_library())
    chosen, skipped, with_mounts = choose(arguments)
    print(f"seed {arguments.seed}", flush=True)
    begin = time.monotonic()
    arguments.end = begin + 60 * arguments.minutes
    done = 0

    def report(kind, outcome):
        nonlocal done
        done += 1
        if outcome.problem or sys.stderr.isatty():
            print(f"[{done}/{arguments.times * len(chosen)}] {kind.name}: "
                  f"{outcome.problem or 'survived'}", file=sys.stderr, flush=True)

    benches = dict.fromkeys(kind.bench for kind in chosen)
    outcomes = {}
    with concurrent.futures.ThreadPoolExecutor(arguments.farms) as pool:
        running = [pool.submit(run_bench, name, [k for k in chosen if k.bench == name], arguments,
                               with_mounts, report) for name in benches]
        for finished in running:
            outcomes.update(finished.result())
    rows = [row_of(kind, outcomes[kind.name]) for kind in chosen if outcomes[kind.name]]
    print_table(rows)
    for name, reason in skipped:
        print(f"skipped: {name}: {reason}")
    print(f"{sum(row['times'] for row in rows)} faults in {time.monotonic() - begin:.0f} s")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"seed": arguments.seed, "kinds": rows, "skipped": skipped}, file, indent=1)
    complete = all(row["times"] == arguments.times for row in rows) and len(rows) == len(chosen)
    return 0 if complete and all(map(is_good, rows)) else 1


if __name__ == "__main__":
    sys.exit(main())
