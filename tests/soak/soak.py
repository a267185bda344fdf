#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A farm that works for a long time, with faults at random, while its coordinator is measured.

    tests/soak/soak.py --minutes 60 [--workers 50] [--seed 7]
    tests/soak/soak.py --short          # a number of actions instead of minutes, as ctest runs it

Jobs are submitted, cancelled and followed; workers and the coordinator are killed (kill -9) and
started again; the disk limit makes the coordinator remove old jobs. The printed seed decides which
actions follow each other, and events decide when: a slow machine takes longer and does the same.
Fails where an image differs from that of one process, a job fails, or something that the
coordinator holds grows (README.md).
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
# More than a test lasts: such a job only ends by its cancellation.
ENDLESS_SAMPLES = 1 << 18
# Unfinished jobs; a submission beyond them waits.
LIVE_JOBS_MAX = 8
# Ends what hangs.
JOB_SECONDS_MAX = 1800
# Actions, and how often each comes in a round; every round has an order of its own.
ACTIONS = {"submit": 12, "cancel": 2, "kill a worker": 2, "kill the coordinator": 1}
# Rounds of the short form.
SHORT_ROUNDS = 3
DISK_LIMIT = "48M"


class Soak:
    def __init__(self, f, choice):
        self.farm = f
        self.choice = choice
        self.folder = f.path("soak")
        os.mkdir(self.folder)
        self.live = {}  # Name of job to (scene, samples, time of submission).
        self.expected = {}  # (scene, samples) to the digest of one process.
        self.round = []  # Actions left of this round.
        self.rounds = 0  # Begun.
        self.counts = {"submitted": 0, "delivered": 0, "cancelled": 0, "worker kills": 0,
                       "coordinator kills": 0}
        self.delivered_at_kill = 0  # Jobs delivered when the coordinator was last killed.
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
            self.rounds += 1
        action = self.round.pop()
        if action == "submit":
            self.wait_for(lambda: len(self.live) < LIVE_JOBS_MAX, "the end of a job")
            self.submit(self.choice.choice(SAMPLES))
        elif action == "cancel":
            self.cancel()
        elif action == "kill a worker":
            self.farm.kill(self.choice.choice(self.farm.workers))
            self.start_worker()
            self.counts["worker kills"] += 1
        elif action == "kill the coordinator":
            self.kill_coordinator()

    def wait_for(self, condition, what):
        """Collects images until the condition holds."""
        def collected():
            self.collect()
            return condition()

        farm.wait_until(collected, JOB_SECONDS_MAX, what)

    def submit(self, samples):
        """The name of the new job."""
        scene = self.choice.randrange(SCENE_COUNT)
        done = self.farm.sheaf("submit", self.scene(scene), "--samples", samples, "--tile-size", 16,
                               "--json")
        name = json.loads(done.stdout.splitlines()[-1])["name"]
        self.live[name] = scene, samples, time.monotonic()
        self.counts["submitted"] += 1
        return name

    def cancel(self):
        """Cancels a job, either at once or while its samples are rendered."""
        name = self.submit(ENDLESS_SAMPLES)
        if self.choice.random() < 0.5:
            self.farm.sheaf("priority", name, 10)
            farm.wait_until(lambda: self.farm.acknowledged(name), JOB_SECONDS_MAX,
                            f"a result of {name}")
        self.farm.sheaf("cancel", name)
        del self.live[name]
        self.counts["cancelled"] += 1

    def kill_coordinator(self):
        """Kills a coordinator that has delivered a job since it started."""
        if not self.live:
            self.submit(min(SAMPLES))
        self.wait_for(lambda: self.counts["delivered"] > self.delivered_at_kill, "a delivered job")
        self.farm.kill(self.farm.coordinator)
        self.farm.start_coordinator()
        self.delivered_at_kill = self.counts["delivered"]
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
                if time.monotonic() - since > JOB_SECONDS_MAX * farm.PATIENCE:
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
        soak = Soak(f, choice)
        for _ in range(arguments.workers):
            soak.start_worker()
        for scene in range(SCENE_COUNT):
            for samples in SAMPLES:
                soak.expect(scene, samples)
        sampler = Sampler(f, arguments.sample_seconds)
        end = time.monotonic() + 60 * arguments.minutes

        def goes_on():
            if arguments.short:
                return soak.rounds < SHORT_ROUNDS or soak.round
            return time.monotonic() < end

        while goes_on():
            soak.act()
            soak.collect()
            sampler.sample()
            time.sleep(choice.uniform(0, arguments.pause_seconds))
        soak.wait_for(lambda: not soak.live, "the end of all jobs")
        sampler.sample()
        return soak.counts, sampler.rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--workers", type=int, default=50)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 32))
    parser.add_argument("--sample-seconds", type=float, default=5)
    parser.add_argument("--pause-seconds", type=float, default=0.5)
    parser.add_argument("--short", action="store_true",
                        help=f"{SHORT_ROUNDS} rounds of actions with 4 workers")
    parser.add_argument("--table", help="a file for all samples, as JSON lines")
    arguments = parser.parse_args()
    if arguments.short:
        arguments.workers, arguments.sample_seconds, arguments.pause_seconds = 4, 0, 0
    length = f"{SHORT_ROUNDS} rounds" if arguments.short else f"{arguments.minutes:g} minutes"
    print(f"seed {arguments.seed}, {arguments.workers} workers, {length}", flush=True)
    counts, rows = run(arguments)
    if arguments.table:
        with open(arguments.table, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)
    print(", ".join(f"{count} {name}" for name, count in counts.items()))
    found = verdicts(rows)
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
