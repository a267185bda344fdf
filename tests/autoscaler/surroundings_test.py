#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Whatever sites, users' variables and clocks do, the autoscaler never has more workers than --max,
and never ends by itself. Slurm's programs are stand-ins.
"""
import itertools
import logging
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import types
import unittest
from unittest import mock

from simulated_pool import ROOT, SimJob, SimPool, simulate
from slurm_stand_in import Site
from sheaf_autoscaler.__main__ import make_engine, parser, run
from sheaf_autoscaler.controller import Bounds, Controller, FarmError
from sheaf_autoscaler.engine import EngineError, InstanceState
from sheaf_autoscaler.local import LocalEngine
from sheaf_autoscaler.look import JobWork, Look
from sheaf_autoscaler.slurm_text import (check_options, cluster_of, instances_of, job_of, line_of,
                                         tasks_of)

MAX = 8
# Lines other than jobs that squeue, its libraries and sites' wrappers print.
NOISE = "\n".join((
    "CLUSTER: beta", "JOBID|STATE|TIME|NODELIST|NAME|REASON", "", "   ",
    "squeue: warning: something", "slurm_load_jobs error: Unable to contact slurm controller",
    "Tue Mar 03 04:05:06 2026", "||||||", "_|RUNNING|0:00|n|x|y", "7_[|RUNNING|0:00|n|x|y",
    "9+0|RUNNING|0:00|n|x|y", "x_1|RUNNING|0:00|n|x|y", "7_[0-99999999999]|PENDING|0|n|x|y",
    "7_[5-1]|PENDING|0|n|x|y", "5|RUNNING|INVALID|n|mine|None", "6_1|RUNNING|0:00|n|a|b|c|d",
    "\u0663_\u0661|RUNNING|0:00|n|x|y", "...", "\x00", "\ufffd\ufffd")) + "\n"
# From squeue(1), JOB STATE CODES; the last state of HERE is made up.
GONE = ("BOOT_FAIL", "CANCELLED", "COMPLETED", "COMPLETING", "DEADLINE", "FAILED", "NODE_FAIL",
        "OUT_OF_MEMORY", "PREEMPTED", "REVOKED", "STAGE_OUT", "TIMEOUT", "LAUNCH_FAILED",
        "RECONFIG_FAIL")
HERE = ("CONFIGURING", "PENDING", "RUNNING", "RESV_DEL_HOLD", "REQUEUE_FED", "REQUEUE_HOLD",
        "REQUEUED", "RESIZING", "SIGNALING", "SPECIAL_EXIT", "STOPPED", "SUSPENDED",
        "POWER_UP_NODE", "EXPEDITING", "SOMETHING_NEW")


class WantingFarm:
    """Its jobs want all workers, and none connects; or no job is there."""

    def __init__(self):
        self.now, self.wall, self.idle = 1000.0, 1e9, False

    def look(self):
        self.now += 5
        jobs = () if self.idle else (JobWork("jobs/1", 1e6, 0.1, task_count=1e4),)
        return Look(self.wall + self.now, self.now, jobs)

    def drain(self, workers):
        raise AssertionError("no worker is connected")

    undrain = drain


class LogLines(logging.Handler):
    def __init__(self):
        super().__init__()
        self.lines = []

    def emit(self, record):
        self.lines.append(record.getMessage())


def slurm_engine(*options, clock=time.monotonic):
    engine = make_engine(parser().parse_args(
        ["--engine", "slurm", "--threads", "1", *options]), "farm:7400")
    engine._clock = clock
    return engine


def arguments_of(process):
    with open(f"/proc/{process.pid}/cmdline", "rb") as file:
        return file.read()


class SlurmCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.site = Site(folder.name)
        self.log = LogLines()
        logger = logging.getLogger("sheaf-autoscaler")
        logger.addHandler(self.log)
        self.addCleanup(logger.removeHandler, self.log)

    def play(self, *options, steps=6, variables=None, **settings):
        """The tasks that are there after some steps, which never are more than MAX."""
        self.site.set(**settings)
        with mock.patch.dict(os.environ, self.site.environment(**(variables or {})), clear=True):
            farm = WantingFarm()
            engine = slurm_engine(*options, clock=lambda: farm.now)
            controller = Controller(farm, engine, Bounds(0, MAX, 1, cool_down_seconds=10))
            for _ in range(steps):
                controller.step()
                self.assertLessEqual(len(self.site.live()), MAX, (options, variables, settings))
            live = self.site.live()
            farm.idle = True
            for _ in range(6):
                controller.step()
            self.assertEqual(self.site.live(), [], (options, variables, settings))
        return live


class ClusterTest(SlurmCase):
    def test_all_programs_ask_the_cluster_of_the_options(self):
        for words in (["--clusters=beta"], ["--clusters", "beta"], ["-M", "beta"], ["-Mbeta"]):
            live = self.play(*("--slurm-option=" + word for word in words))
            self.assertEqual([task["cluster"] for task in live], ["beta"] * MAX, words)

    def test_all_programs_ask_the_cluster_of_the_environment(self):
        for name in ("SLURM_CLUSTERS", "SBATCH_CLUSTERS"):
            live = self.play(variables={name: "beta"})
            self.assertEqual([task["cluster"] for task in live], ["beta"] * MAX, name)

    def test_filters_of_the_environment_hide_no_workers(self):
        for name, value in (("SQUEUE_PARTITION", "other"), ("SQUEUE_NAMES", "other"),
                            ("SQUEUE_STATES", "COMPLETED"), ("SQUEUE_FORMAT2", "jobid"),
                            ("SCANCEL_STATE", "RUNNING"), ("SCANCEL_INTERACTIVE", "1")):
            self.assertEqual(len(self.play(variables={name: value})), MAX, name)

    def test_a_plug_in_that_submits_to_another_cluster(self):
        self.assertEqual(len(self.play(forward="gamma")), MAX)
        self.assertEqual(len(self.play("--slurm-option=--clusters=beta", forward="gamma")), MAX)

    def test_several_clusters_are_refused_with_a_remedy(self):
        for words in (["--clusters=all"], ["-M", "a,b"]):
            with self.assertRaisesRegex(EngineError, "one sheaf-autoscaler for each"):
                cluster_of(words, {})

    def test_options_that_change_what_is_counted_are_refused(self):
        for word in ("--array=0-99", "-a0-99", "--arr=0-9", "-J", "--job-name=x", "--wait", "-W",
                     "--test-only"):
            with self.assertRaisesRegex(EngineError, "leave it out"):
                check_options([word])
        check_options(["--wait-all-nodes=1", "--account=film", "-A", "film", "--nice=100",
                       "--hold", "--cluster-constraint=x"])


class BoundTest(SlurmCase):
    def test_jobs_that_a_plug_in_renames(self):
        self.assertEqual(len(self.play(rename="site-job")), MAX)

    def test_tasks_that_squeue_does_not_show(self):
        self.assertEqual(len(self.play(hide=True, steps=40)), MAX)

    def test_tasks_that_squeue_joins(self):
        self.assertEqual(len(self.play(short=True)), MAX)

    def test_answers_of_sbatch(self):
        for settings in ({"words": "Welcome to the cluster.\nsbatch: 42 jobs\n"},
                         {"answer": "Submitted batch job 7"},
                         {"answer": "thanks"}, {"answer": ""}, {"answer": "7;"}):
            self.site.write({"settings": {}, "next": 7, "tasks": []})
            self.assertEqual(len(self.play(**settings, steps=4)), MAX, settings)

    def test_tasks_that_end_before_squeue_shows_them_are_replaced(self):
        with mock.patch.dict(os.environ, self.site.environment(), clear=True):
            farm = WantingFarm()
            engine = slurm_engine(clock=lambda: farm.now)
            controller = Controller(farm, engine, Bounds(0, MAX, 1))
            self.assertEqual(controller.step().grown, MAX)
            self.site.end(purge=True)
            grown = sum(controller.step().grown for _ in range(40))
            self.assertEqual(grown, MAX)

    def test_connected_workers_count_where_the_engine_sees_none(self):
        pool = SimPool([SimJob("jobs/1", 40_000, 40_000, 0.2)], machines=100)
        controller = Controller(pool, pool, Bounds(0, MAX, 1))
        with mock.patch.object(pool, "count", lambda: len(pool.waiting)), \
                mock.patch.object(pool, "describe", lambda: []):
            for _ in range(60):
                controller.step()
                pool.play(5)
                connected = sum(i.ready <= pool.now for i in pool.instances.values())
        self.assertEqual(connected, len(pool.instances))
        before = len(pool.instances)
        with mock.patch.object(pool, "count", lambda: 0), \
                mock.patch.object(pool, "describe", lambda: []):
            for _ in range(100):
                controller.step()
                pool.play(5)
        self.assertEqual(len(pool.instances), before)

    def test_a_worker_that_rewrites_its_arguments(self):
        with tempfile.TemporaryDirectory() as folder:
            worker = os.path.join(folder, "worker")
            with open(worker, "w", encoding="utf-8") as file:
                file.write("#!/bin/sh\nexec sleep 600\n")
            os.chmod(worker, 0o700)
            engine = LocalEngine(f"other{os.getpid()}", [worker], os.path.join(folder, "log"))
            engine.grow(2)
            children = list(engine._children.values())
            try:
                while any(b"worker" in arguments_of(child) for child in children):
                    time.sleep(0.01)
                self.assertEqual(engine.count(), 2)
                engine.shrink([instance.name for instance in engine.describe()])
                for child in children:
                    self.assertEqual(child.wait(100), -signal.SIGTERM)
            finally:
                for child in children:
                    child.kill()
            self.assertEqual(engine.count(), 0)


class LineTest(SlurmCase):
    def test_lines_that_are_none_of_jobs_are_skipped_with_one_note(self):
        live = self.play(noise=NOISE)
        self.assertEqual(len(live), MAX)
        self.assertEqual(sum("skipped a line" in line for line in self.log.lines), 1)

    def test_any_line(self):
        draw = random.Random(48)
        pieces = ["7_0", "7_[0-3]", "|", "_", "[", "]", "-", ",", "RUNNING", "PENDING", "0:01",
                  "INVALID", "n1", "sheaf", " ", "\t", "\x1b", "99999999999999999999", "%", ":"]
        for _ in range(20_000):
            words = "".join(draw.choices(pieces, k=draw.randrange(12)))
            line = line_of(words)
            if line is not None:
                instances_of(line)
            job_of(words)

    def test_states(self):
        for state, is_here in ([(s, False) for s in GONE] + [(s, True) for s in HERE]):
            line = line_of(f"7_2|{state}|1:00|n1|x|None")
            self.assertEqual(len(instances_of(line)), is_here, state)
        for state in ("RUNNING", "RESIZING", "SIGNALING", "SUSPENDED"):
            found = instances_of(line_of(f"7_2|{state}|1:00|n1|x|None"))[0]
            self.assertEqual((found.state, found.running_seconds), (InstanceState.RUNNING, 60))

    def test_tasks_of_arrays(self):
        for text, expected in (("3", (3,)), ("[1,3-5]", (1, 3, 4, 5)), ("[0-6:3%2]", (0, 3, 6)),
                               ("", None), ("[]", None), ("[1-]", None), ("[0-9:0]", None),
                               ("[1,...]", None), ("[0-999999999]", None)):
            self.assertEqual(tasks_of(text), expected, text)


class ClockTest(unittest.TestCase):
    def test_a_clock_that_is_set_changes_nothing(self):
        def play(jumps):
            pool = SimPool([SimJob("jobs/1", 4000, 4000, 0.2)])
            controller = Controller(pool, pool, Bounds(0, MAX, 1, cool_down_seconds=120))
            steps, seen = itertools.count(), []

            def note():
                seen.append((len(pool.instances), len(pool.waiting)))
                pool.set_clock(jumps.get(next(steps), 0))
            simulate(pool, controller, each=note)
            return seen
        steady = play({})
        for jumps in ({2: -3600}, {2: 3600}, {20: -86_400, 60: 30 * 86_400}, {100: -1e8},
                      {n: (-1) ** n * 4000 for n in range(200)}):
            self.assertEqual(play(jumps), steady, jumps)


class EndTest(SlurmCase):
    def run_steps(self, step, count):
        """Calls run(), which steps so often and then gets SIGTERM."""
        calls = itertools.count(1)

        def counted():
            if next(calls) >= count:
                os.kill(os.getpid(), signal.SIGTERM)
            return step()
        options = types.SimpleNamespace(once=False, look_every=0.001)
        before = [(number, signal.getsignal(number)) for number in (signal.SIGTERM, signal.SIGINT)]
        try:
            return run(types.SimpleNamespace(step=counted), options)
        finally:
            for number, handler in before:
                signal.signal(number, handler)

    def test_no_exception_ends_it(self):
        errors = itertools.cycle((ValueError("not enough values to unpack"), KeyError("x"),
                                  FarmError(""), EngineError("away"), OSError(11, "again"),
                                  RecursionError(), UnicodeDecodeError("utf-8", b"\xe9", 0, 1, "")))

        def fail():
            raise next(errors)
        self.assertEqual(self.run_steps(fail, 30), 0)

    def test_sites_at_random(self):
        """Whatever comes together, in any order: never over the bound, never an end."""
        draw = random.Random(2026)
        with mock.patch.dict(os.environ, self.site.environment(SLURM_CLUSTERS="beta"), clear=True):
            farm = WantingFarm()
            engine = slurm_engine("--max", str(MAX), clock=lambda: farm.now)
            controller = Controller(farm, engine, Bounds(0, MAX, 1, cool_down_seconds=20))

            def step():
                some = {"noise": NOISE, "short": True, "hide": True, "rename": "other",
                        "words": "Hello\n", "fail": [draw.choice(("sbatch", "squeue", "scancel"))]}
                self.site.set(**{key: some[key] for key in draw.sample(sorted(some), 2)})
                farm.idle, farm.wall = draw.random() < 0.3, draw.uniform(0, 2e9)
                if draw.random() < 0.1:
                    self.site.end()
                try:
                    return controller.step()
                finally:
                    self.assertLessEqual(len(self.site.live()), MAX)
            self.assertEqual(self.run_steps(step, 60), 0)

    def test_an_ignored_signal_stays_ignored(self):
        code = ("import signal, types\n"
                "from sheaf_autoscaler.__main__ import run\n"
                "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
                "def step(): raise OSError(1, 'once')\n"
                "run(types.SimpleNamespace(step=step), types.SimpleNamespace(once=True))\n"
                "print(signal.getsignal(signal.SIGINT) == signal.SIG_IGN)\n")
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                              env=dict(os.environ, PYTHONPATH=os.path.join(ROOT, "python")),
                              timeout=600, check=False)
        self.assertEqual(done.stdout, "True\n", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
