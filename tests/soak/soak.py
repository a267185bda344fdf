#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A farm that works for a long time, with faults at random, while its coordinator is measured.

    tests/soak/soak.py --minutes 60 [--workers 50] [--seed 7]
    tests/soak/soak.py --short          # 45 s, as ctest runs it

Jobs are submitted, cancelled and followed; workers and the coordinator are killed (kill -9) and
started again; the disk limit makes the coordinator remove old jobs. The choices follow from the
printed seed, their times from the machine. Fails where an image differs from that of one process,
a job fails, or something that the coordinator holds grows (README.md).
"""
import argparse
import json
import os
import random
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "integration")]
import farm  # noqa: E402
from growth import LIMITS, Sampler, verdicts  # noqa: E402

SCENE = """Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" 48 "integer yresolution" 48
WorldBegin
LightSource "infinite" "rgb L" [%g 0.6 0.7]
Translate 0 0 3
Material "diffuse" "rgb reflectance" [0.2 0.4 0.8]
Shape "sphere"
"""
SCENE_COUNT = 3
SAMPLES = (16, 64, 256)
# Unfinished jobs; a submission beyond them waits.
LIVE_JOBS_MAX = 8
JOB_SECONDS_MAX = 180
# Actions, and how often each comes in a round; every round has an order of its own.
ACTIONS = {"submit": 12, "cancel": 2, "kill a worker": 2, "kill the coordinator": 1}
# Time from a submission to its cancellation.
CANCEL_SECONDS_MAX = 0.3
# Time between two kills of the coordinator: it must also work.
COORDINATOR_SECONDS_MIN = 10
DISK_LIMIT = "48M"


class Soak:
    def __init__(self, f, arguments, choice):
        self.farm = f
        self.choice = choice
        self.folder = f.path("soak")
        os.mkdir(self.folder)
        self.live = {}  # Name of job to (scene, samples, time of submission).
        self.expected = {}  # (scene, samples) to the digest of one process.
        self.round = []  # Actions left of this round.
        self.counts = {"submitted": 0, "delivered": 0, "cancelled": 0, "worker kills": 0,
                       "coordinator kills": 0}
        self.last_kill = time.monotonic()
        self.worker_count = arguments.workers
        for number in range(SCENE_COUNT):
            with open(self.scene(number), "w", encoding="utf-8") as file:
                file.write(SCENE % (0.5 + 0.1 * number))

    def scene(self, number):
        return os.path.join(self.folder, f"scene-{number}.pbrt")

    def expect(self, scene, samples):
        """The digest of the image that one process renders."""
        key = scene, samples
        if key not in self.expected:
            path = os.path.join(self.folder, "alone.exr")
            farm.render(self.scene(scene), path, "--samples", samples, "--threads", 1)
            self.expected[key] = farm.image_digest(path)
        return self.expected[key]

    def start_worker(self):
        self.farm.start_worker("--queued-leases-max", "1", "--sandbox", "best")

    def act(self):
        if not self.round:
            self.round = [name for name, count in ACTIONS.items() for _ in range(count)]
            self.choice.shuffle(self.round)
        action = self.round.pop()
        if action == "submit":
            self.submit(self.choice.choice(SAMPLES))
        elif action == "cancel":
            name = self.submit(max(SAMPLES))
            time.sleep(self.choice.uniform(0, CANCEL_SECONDS_MAX))
            self.cancel(name or self.choice.choice(sorted(self.live)))
        elif action == "kill a worker":
            self.farm.kill(self.choice.choice(self.farm.workers))
            self.start_worker()
            self.counts["worker kills"] += 1
        elif action == "kill the coordinator":
            self.kill_coordinator()

    def submit(self, samples):
        """The name of the new job; None where enough are unfinished."""
        if len(self.live) >= LIVE_JOBS_MAX:
            return None
        scene = self.choice.randrange(SCENE_COUNT)
        done = self.farm.sheaf("submit", self.scene(scene), "--samples", samples, "--tile-size", 16,
                               "--json")
        name = json.loads(done.stdout.splitlines()[-1])["name"]
        self.live[name] = scene, samples, time.monotonic()
        self.counts["submitted"] += 1
        return name

    def cancel(self, name):
        done = self.farm.sheaf("cancel", name, check=False)
        if done.returncode == 0:
            del self.live[name]
            self.counts["cancelled"] += 1
        elif "only an unfinished job can" not in done.stderr:
            raise AssertionError(done.stderr)

    def kill_coordinator(self):
        if time.monotonic() - self.last_kill < COORDINATOR_SECONDS_MIN:
            return
        self.farm.kill(self.farm.coordinator)
        self.farm.start_coordinator()
        self.last_kill = time.monotonic()
        self.counts["coordinator kills"] += 1

    def collect(self):
        """Compares the images of jobs that have ended."""
        states = {}
        for line in self.farm.sheaf("list", "--json").stdout.splitlines():
            job = json.loads(line)
            states[job["name"]] = job
        for name, (scene, samples, since) in list(self.live.items()):
            state = states[name]["state"] if name in states else "removed before its end"
            if state in ("queued", "running"):
                if time.monotonic() - since > JOB_SECONDS_MAX * farm.TIME_SCALE:
                    raise AssertionError(f"{name} is {state} after {JOB_SECONDS_MAX} s: "
                                         f"{states[name]['waiting_reason']}")
                continue
            if state != "succeeded":
                raise AssertionError(f"{name} is {state}: {states.get(name)}")
            shown = json.loads(self.farm.sheaf("show", name, "--json").stdout)
            digest = shown["frames"][0]["image_digest"]
            if digest != self.expect(scene, samples):
                raise AssertionError(f"{name} (scene {scene}, {samples} samples) has another image")
            del self.live[name]
            self.counts["delivered"] += 1


def run(arguments):
    choice = random.Random(arguments.seed)
    with farm.Farm(["--disk-limit", DISK_LIMIT, "--keep-parts", "20s"]) as f:
        soak = Soak(f, arguments, choice)
        for _ in range(arguments.workers):
            soak.start_worker()
        for scene in range(SCENE_COUNT):
            for samples in SAMPLES:
                soak.expect(scene, samples)
        sampler = Sampler(f, arguments.sample_seconds)
        end = time.monotonic() + 60 * arguments.minutes
        while time.monotonic() < end:
            soak.act()
            soak.collect()
            sampler.sample()
            time.sleep(choice.uniform(0, arguments.pause_seconds))
        last = time.monotonic() + JOB_SECONDS_MAX * farm.TIME_SCALE
        while soak.live and time.monotonic() < last:
            soak.collect()
            sampler.sample()
            time.sleep(0.2)
        if soak.live:
            raise AssertionError(f"without an end: {sorted(soak.live)}")
        return soak.counts, sampler.rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--workers", type=int, default=50)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 32))
    parser.add_argument("--sample-seconds", type=float, default=5)
    parser.add_argument("--pause-seconds", type=float, default=0.5)
    parser.add_argument("--short", action="store_true", help="about 45 s with 4 workers")
    parser.add_argument("--table", help="a file for all samples, as JSON lines")
    arguments = parser.parse_args()
    if arguments.short:
        arguments.minutes, arguments.workers, arguments.sample_seconds = 0.6, 4, 0.5
    print(f"seed {arguments.seed}, {arguments.workers} workers, {arguments.minutes:g} minutes",
          flush=True)
    counts, rows = run(arguments)
    if arguments.table:
        with open(arguments.table, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)
    print(", ".join(f"{count} {name}" for name, count in counts.items()))
    found = verdicts(rows, 60 * arguments.minutes)
    print("| quantity | samples | after warm-up | at the end | growth an hour | limit |\n"
          "|---|---|---|---|---|---|")
    for verdict in found:
        print(verdict.row())
    grown = [verdict.name for verdict in found if verdict.grows]
    missing = [name for name in ("delivered", "cancelled", "worker kills", "coordinator kills")
               if counts[name] == 0]
    if len(found) < len(LIMITS):
        print("too few samples to judge; let it run longer")
    if missing:
        print(f"nothing was {', '.join(missing)}: let it run longer, or choose another seed")
    if grown:
        print(f"grows: {', '.join(grown)}")
    return 1 if grown or missing or len(found) < len(LIMITS) else 0


if __name__ == "__main__":
    sys.exit(main())
