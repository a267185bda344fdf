#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Times what a newcomer runs, at two commits in turn: ./deploy/demo, then ./tests/run, and
./tests/run alone, each from a fresh clone and without the compiler cache.

    tests/bench/whole_run.py BASE [CHANGED] [--only demo] [--folder DIR]

CHANGED: default HEAD. The times depend on the machine, so the figures are ratios. Takes hours: the
packages must be there already, and nothing else may run.
"""
import argparse
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from urllib.request import urlopen

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
POLL_SECONDS = 0.2


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def clone(commit, folder):
    subprocess.run(["git", "clone", "-q", ROOT, folder], check=True)
    subprocess.run(["git", "checkout", "-q", commit], cwd=folder, check=True)


def first_tile_seconds(http_port, begin, found, stop):
    """Notes when the page has the first samples."""
    while not stop.is_set():
        try:
            text = urlopen(f"http://127.0.0.1:{http_port}/metrics", timeout=5).read().decode()
        except OSError:
            text = ""
        if re.search(r"^sheaf_results_accepted_total [1-9]", text, re.MULTILINE):
            found.append(time.monotonic() - begin)
            return
        time.sleep(POLL_SECONDS)


def run(command, folder, **environment):
    """Seconds of a command, which must succeed."""
    begin = time.monotonic()
    with open(os.path.join(folder, "build.out"), "ab") as log:
        done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=log,
                              stderr=log, env={**os.environ, "CCACHE_DISABLE": "1", **environment},
                              check=False)
    if done.returncode != 0:
        print(f"{' '.join(command)} in {folder}: exit code {done.returncode}", file=sys.stderr)
    return time.monotonic() - begin


def measure(commit, folder, only):
    """{what: seconds} of the commit."""
    times = {}
    with tempfile.TemporaryDirectory(dir=folder) as place:
        clone(commit, os.path.join(place, "demo"))
        ports = free_port(), free_port()
        found, stop = [], threading.Event()
        watch = threading.Thread(target=first_tile_seconds,
                                 args=(ports[1], time.monotonic(), found, stop))
        watch.start()
        run(["./deploy/demo"], os.path.join(place, "demo"), SHEAF_PORT=str(ports[0]),
            SHEAF_HTTP_PORT=str(ports[1]))
        stop.set()
        watch.join()
        times["demo to the first tile"] = found[0] if found else float("nan")
        if only != "demo":
            times["tests/run after the demo"] = run(["./tests/run"], os.path.join(place, "demo"))
            clone(commit, os.path.join(place, "alone"))
            times["tests/run alone"] = run(["./tests/run"], os.path.join(place, "alone"))
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("base")
    parser.add_argument("changed", nargs="?", default="HEAD")
    parser.add_argument("--only", choices=["demo"], help="the demo alone")
    parser.add_argument("--folder", default=os.path.join(ROOT, "build"), help="where to clone to")
    options = parser.parse_args()
    os.makedirs(options.folder, exist_ok=True)
    base, changed = (measure(commit, options.folder, options.only)
                     for commit in (options.base, options.changed))
    whole = base.get("tests/run alone")
    print("| what | base s | changed s | ratio | part of the base's tests/run alone |\n"
          "|---|---|---|---|---|")
    for what, seconds in changed.items():
        part = f"{seconds / whole:.2f}" if whole else ""
        ratio = seconds / base[what]
        print(f"| {what} | {base[what]:.0f} | {seconds:.0f} | {ratio:.2f} | {part} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
