#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The autoscaler's decisions, with an engine and a coordinator in simulated time; and what its
engines read and run. Needs neither gRPC nor the built programs.
"""
import dataclasses
import logging
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

from simulated_pool import SimJob, SimPool, simulate
from sheaf_autoscaler import controller as controllers
from sheaf_autoscaler import demand
from sheaf_autoscaler.__main__ import duration, make_engine, parser
from sheaf_autoscaler.controller import Bounds, Controller
from sheaf_autoscaler.engine import EngineError, Instance, InstanceState
from sheaf_autoscaler.local import LocalEngine
from sheaf_autoscaler.look import JobWork
from sheaf_autoscaler.slurm import SlurmEngine, SlurmOptions
from sheaf_autoscaler.slurm_text import instances_of, line_of, seconds_of

COOL_DOWN = 120.0
BOUNDS = Bounds(0, 8, 1, cool_down_seconds=COOL_DOWN, queue_seconds=600)


def quoted_jobs(random):
    """Ten jobs over an hour, with quotes whose bands hold in 8 of 10 cases, and deadlines that a
    pool of 1 to 8 workers makes for some and not for others.
    """
    jobs, at = [], 0.0
    for number in range(10):
        quoted = random.uniform(600, 3000)
        deviation = random.uniform(0.05, 0.2)
        at += random.uniform(0, 500)
        jobs.append(SimJob(f"jobs/{number + 1}", quoted,
                           quoted * random.lognormvariate(0, deviation), deviation,
                           deadline=at + random.uniform(1200, 6000), submit_time=at))
    return jobs


class DeadlineTest(unittest.TestCase):
    def run_jobs(self, seed, preempted=False):
        pool = SimPool([], seed=seed)
        pool = SimPool(quoted_jobs(pool.random), seed=seed)
        bounds = dataclasses.replace(BOUNDS, workers_min=1)
        controller = Controller(pool, pool, bounds)
        promised, steps = {}, [0]

        def note():
            steps[0] += 1
            if preempted and steps[0] % 120 == 0:  # Every ten minutes.
                pool.preempt()
            # The words of submit: whether the largest pool makes it, by the band.
            jobs = [job.work() for job in pool.open_jobs()]
            ends = demand.ends_of(jobs, bounds.workers_max * 0.95) if jobs else {}
            for job in pool.open_jobs():
                if job.name not in promised:
                    promised[job.name] = (pool.now + bounds.start_seconds + demand.TAIL_SECONDS
                                          + ends[job.name] <= job.deadline)
        simulate(pool, controller, each=note)
        sure = [job for job in pool.jobs if promised[job.name]]
        met = [job for job in sure if job.end_time <= job.deadline]
        return len(met), len(sure), pool

    def test_deadlines_are_met_where_the_band_says_so(self):
        met = sure = 0
        for seed in range(5):
            of_run, promised, pool = self.run_jobs(seed)
            met, sure = met + of_run, sure + promised
            self.assertGreaterEqual(of_run, 0.8 * promised, f"seed {seed}")
            # Paid time of workers against the time that the work takes them at least.
            least = sum(job.true_seconds for job in pool.jobs) / 0.95
            self.assertLessEqual(pool.worker_seconds / least, 1.25, f"seed {seed}")
            self.assertLessEqual(pool.peak, 8)
        self.assertGreaterEqual(sure, 40, "the test needs deadlines that can be made")
        self.assertGreaterEqual(met, 0.85 * sure)

    def test_preemption_does_not_cost_deadlines(self):
        met = sure = 0
        for seed in range(3):
            of_run, promised, _ = self.run_jobs(seed, preempted=True)
            met, sure = met + of_run, sure + promised
        self.assertGreaterEqual(met, 0.8 * sure)

    def test_no_more_than_a_deadline_needs(self):
        # 3,000 s of CPU time in 3,000 s: two workers for the band, not eight.
        pool = SimPool([SimJob("jobs/1", 3000, 3000, 0.1, deadline=3000)])
        simulate(pool, Controller(pool, pool, BOUNDS))
        self.assertLessEqual(pool.jobs[0].end_time, pool.jobs[0].deadline)
        self.assertEqual(pool.peak, 2)

    def test_a_missed_deadline_is_told_and_gets_all(self):
        job = JobWork("jobs/1", 10_000, 0.1, deadline=1000.0, task_count=1000)
        want = demand.wanted([job], 0.0, threads_max=8, thread_use=1, queue_seconds=600,
                             start_seconds=30, threads_step=1)
        self.assertEqual((want.threads, want.at_risk), (8, ("jobs/1",)))
        late = demand.wanted([job], 2000.0, threads_max=8, thread_use=1, queue_seconds=5000,
                             start_seconds=30, threads_step=1)
        self.assertEqual((late.threads, late.at_risk), (2, ()), "it is queued like others")

    def test_shares_and_priorities_count(self):
        jobs = [JobWork("a", 100, 0, user="u"), JobWork("b", 100, 0, user="u"),
                JobWork("c", 100, 0, user="v"), JobWork("first", 100, 0, priority=1)]
        ends = demand.ends_of(jobs, 1)
        self.assertAlmostEqual(ends["first"], 100)
        self.assertAlmostEqual(ends["c"], 300)  # v has half of the time, u the other half.
        self.assertAlmostEqual(ends["a"], 400)

    def test_weights_count(self):
        # As SharedFarmTest has it: shows 3 : 1, and within the first users 1 : 4.
        jobs = [JobWork("a", 100, 0, show="s", user="u", show_weight=3),
                JobWork("b", 100, 0, show="s", user="v", show_weight=3, user_weight=4),
                JobWork("c", 100, 0, show="t", user="u")]
        ends = demand.ends_of(jobs, 1)
        self.assertAlmostEqual(ends["b"], 100 / (3 / 4 * 4 / 5))
        self.assertAlmostEqual(ends["a"], ends["b"] + (100 - ends["b"] * 3 / 20) / (3 / 4))
        self.assertAlmostEqual(ends["c"], 300)
        even = [dataclasses.replace(job, show_weight=1, user_weight=1) for job in jobs]
        self.assertAlmostEqual(demand.ends_of(even, 1)["c"], 200)

    def test_many_jobs_are_played_as_one(self):
        jobs = [JobWork(f"jobs/{n}", 10, 0.1, user=f"u{n % 7}", deadline=None if n else 500.0,
                        task_count=9) for n in range(3000)]
        begin = time.process_time()
        want = demand.wanted(jobs, 0.0, threads_max=4000, thread_use=1, queue_seconds=600,
                             start_seconds=30, threads_step=4)
        self.assertLess(time.process_time() - begin, 5)
        self.assertAlmostEqual(want.for_queue, 29_990 / 600)


class PoolTest(unittest.TestCase):
    def test_from_nothing_to_nothing(self):
        pool = SimPool([SimJob("jobs/1", 8000, 8000, 0.2)])
        controller = Controller(pool, pool, BOUNDS)
        simulate(pool, controller)
        self.assertEqual(pool.peak, 8)
        self.assertEqual(pool.count(), 0)
        self.assertLess(pool.now - pool.jobs[0].end_time, COOL_DOWN + 10)
        self.assertEqual(pool.worker_seconds > 0, True)

    def test_no_cool_down(self):
        pool = SimPool([SimJob("jobs/1", 1000, 1000, 0.2)])
        simulate(pool, Controller(pool, pool, dataclasses.replace(BOUNDS, cool_down_seconds=0)))
        self.assertLess(pool.now - pool.jobs[0].end_time, 20)

    def test_the_floor_stays(self):
        pool = SimPool([SimJob("jobs/1", 100, 100, 0.2)])
        simulate(pool, Controller(pool, pool, dataclasses.replace(BOUNDS, workers_min=2)))
        self.assertEqual(pool.count(), 2)

    def test_no_more_workers_than_tasks(self):
        pool = SimPool([SimJob("jobs/1", 20_000, 20, 0.2)])  # Two leases.
        simulate(pool, Controller(pool, pool, BOUNDS))
        self.assertLessEqual(pool.peak, 2)

    def test_busy_workers_stay_until_the_work_is_done(self):
        pool = SimPool([SimJob("jobs/1", 8000, 8000, 0.2)])
        controller, drained = Controller(pool, pool, BOUNDS), []

        def note():
            if pool.jobs[0].end_time is None and pool.jobs[0].leased_seconds < 7990:
                drained.extend(i.name for i in pool.instances.values() if i.leaving)
        simulate(pool, controller, each=note)
        self.assertEqual(drained, [])

    def test_a_controller_that_is_killed_at_any_time(self):
        pool = SimPool([SimJob("jobs/1", 3000, 3000, 0.2)])
        while not pool.done():
            Controller(pool, pool, BOUNDS).step()  # A new one each time.
            pool.play(5)
            self.assertLessEqual(pool.count(), 8)
        controller = Controller(pool, pool, BOUNDS)
        begin = pool.now
        simulate(pool, controller)
        self.assertLessEqual(pool.now - begin, COOL_DOWN + 15)

    def test_an_engine_that_does_not_answer_changes_nothing(self):
        pool = SimPool([SimJob("jobs/1", 3000, 3000, 0.2)])
        controller = Controller(pool, pool, BOUNDS)
        for step in range(2000):
            pool.fails = step % 3 == 1
            try:
                controller.step()
            except EngineError:
                pass
            pool.fails = False
            pool.play(5)
            self.assertLessEqual(pool.count(), 8)
        self.assertTrue(pool.done())
        self.assertEqual(pool.count(), 0)

    def test_leaving_workers_are_taken_back(self):
        pool = SimPool([SimJob("jobs/1", 4000, 4000, 0.2)])
        controller = Controller(pool, pool, BOUNDS)
        for _ in range(20):
            controller.step()
            pool.play(5)
        before = set(pool.instances)
        pool.drain(["workers/" + name for name in before])
        step = controller.step()
        self.assertEqual((step.kept, step.grown), (step.target, 0))
        self.assertGreater(step.kept, 4)
        self.assertEqual(sum(not i.leaving for i in pool.instances.values()), step.kept)

    def test_instances_that_end_at_once_are_asked_for_ever_less(self):
        pool = SimPool([SimJob("jobs/1", 4000, 4000, 0.2)], start_seconds=(1e9, 1e9))
        controller, grown = Controller(pool, pool, BOUNDS), 0
        logging.getLogger("sheaf-autoscaler").addHandler(logging.NullHandler())
        with self.assertLogs("sheaf-autoscaler", "WARNING"):
            for _ in range(720):  # An hour.
                grown += controller.step().grown > 0
                pool.play(5)
                pool.instances.clear()
        self.assertLess(grown, 25)

    def test_stuck_and_unconnected_instances_are_ended(self):
        pool = SimPool([SimJob("jobs/1", 1000, 1000, 0.2)], start_seconds=(1e9, 1e9))
        controller, ended = Controller(pool, pool, BOUNDS), []
        for _ in range(200):
            ended += controller.step().ended
            pool.play(5)
        self.assertGreaterEqual(len(ended), 2)
        stuck = Instance("instance.slurm.1.0", InstanceState.STUCK)
        self.assertTrue(Controller._is_broken(stuck, {}))

    def test_other_workers_of_the_pool_count(self):
        pool = SimPool([SimJob("jobs/1", 4000, 4000, 0.2)])
        other = controllers.WorkerState("workers/desk", 4, 4)
        look = pool.look()
        with mock.patch.object(pool, "look", lambda: dataclasses.replace(look, workers=(other,))):
            self.assertEqual(Controller(pool, pool, BOUNDS).step().target, 4)
            of_slurm = dataclasses.replace(other, tags=("instance.slurm.1.0",))
            with mock.patch.object(pool, "look",
                                   lambda: dataclasses.replace(look, workers=(of_slurm,))):
                self.assertEqual(
                    Controller(pool, pool, BOUNDS, "instance.local.").step().target, 4)

    def test_thread_use_is_measured(self):
        pool = SimPool([SimJob("jobs/1", 4000, 4000, 0.2)], thread_use=0.5)
        controller = Controller(pool, pool, BOUNDS)
        for _ in range(100):
            controller.step()
            pool.play(5)
        self.assertAlmostEqual(controller._thread_use.value, 0.5, delta=0.1)


class SlurmTest(unittest.TestCase):
    def test_lines_of_squeue(self):
        for line, expected in (
                ("7_0|PENDING|0:00||x|Priority", (InstanceState.WAITING, 0)),
                ("7_1|PENDING|0:00||x|launch failed requeued held", (InstanceState.STUCK, 0)),
                ("7_1|PENDING|0:00||x|JobHeldUser", (InstanceState.STUCK, 0)),
                ("7_2|RUNNING|1-02:03:04|n1|x|None", (InstanceState.RUNNING, 93784)),
                ("7_2|CONFIGURING|0:01|n1|x|None", (InstanceState.WAITING, 0)),
                ("7_2|COMPLETING|0:09|n1|x|None", None), ("7_2|NODE_FAIL|0:09||x|x|y", None),
                ("7_2|REQUEUE_HOLD|0:00||x|x", (InstanceState.STUCK, 0)),
                ("7_2|REQUEUED|0:00||x|x", (InstanceState.WAITING, 0))):
            found = instances_of(line_of(line))
            self.assertEqual([(f.state, f.running_seconds) for f in found],
                             [expected] if expected else [], line)
        joined = instances_of(line_of("12_[3-4]|PENDING|0:00||x|None"))
        self.assertEqual([found.name for found in joined],
                         ["instance.slurm.12.3", "instance.slurm.12.4"])
        self.assertEqual([seconds_of(t) for t in ("0:05", "1:00:00", "INVALID")], [5, 3600, 0])

    def test_commands(self):
        with tempfile.TemporaryDirectory() as folder:
            for program in ("sbatch", "squeue", "scancel"):
                path = os.path.join(folder, program)
                with open(path, "w", encoding="utf-8") as file:
                    file.write(f'#!/bin/sh\necho "$(basename "$0") $*" >> {folder}/calls\n'
                               "[ $(basename $0) != sbatch ] || "
                               f"{{ cat > {folder}/script; echo 7; }}\n")
                os.chmod(path, stat.S_IRWXU)
            options = parser().parse_args(
                ["--engine", "slurm", "--threads", "4", "--slurm-partition", "render",
                 "--slurm-account", "film", "--slurm-qos", "low", "--slurm-constraint", "avx2",
                 "--slurm-exclusive", "--slurm-option=--nice=50",
                 "--cache-dir", "/scratch/$SLURM_JOB_USER/$SLURMD_NODENAME",
                 "--worker-option=a b"])
            engine = make_engine(options, "farm:7400")
            with mock.patch.dict(os.environ, PATH=f"{folder}:{os.environ['PATH']}"):
                engine.grow(3)
                engine.shrink(["instance.slurm.7.1", "instance.slurm.7.2", "instance.local.x.1"])
                # Only one of the three was not cancelled, and squeue does not show it yet.
                self.assertEqual([i.name for i in engine.describe()], ["instance.slurm.7.0"])
            with open(os.path.join(folder, "calls"), encoding="utf-8") as file:
                sbatch, scancel, squeue = file.read().splitlines()
            for word in ("--array=0-2", "--requeue", "--signal=B:TERM@60", "--partition=render",
                         "--account=film", "--qos=low", "--constraint=avx2", "--exclusive",
                         "--cpus-per-task=4", "--nice=50", "--job-name=sheaf-default-"):
                self.assertIn(word, sbatch)
            self.assertEqual(scancel, "scancel --quiet 7_1 7_2")
            self.assertIn("--me --all", squeue)
            with open(os.path.join(folder, "script"), encoding="utf-8") as file:
                script = file.read()
            self.assertIn('"/scratch/$SLURM_JOB_USER/$SLURMD_NODENAME"', script)
            self.assertIn("'a b'", script)
            self.assertTrue(script.startswith("#!/bin/bash\nexec sheaf-worker "))
            self.assertIn("instance.slurm.$SLURM_ARRAY_JOB_ID.$SLURM_ARRAY_TASK_ID", script)

    def test_no_shell_in_paths(self):
        with self.assertRaises(EngineError):
            SlurmEngine(SlurmOptions("x"), ["worker", "$SLURM_JOB_ID`id`"])

    def test_a_missing_slurm_is_an_error_with_a_remedy(self):
        with mock.patch.dict(os.environ, PATH="/nowhere"):
            with self.assertRaisesRegex(EngineError, "install Slurm's client"):
                SlurmEngine(SlurmOptions("x"), ["worker"]).count()


class LocalTest(unittest.TestCase):
    def test_processes_are_found_again_and_stopped(self):
        with tempfile.TemporaryDirectory() as folder:
            pool = f"test{os.getpid()}"
            # It renames nothing: its arguments stay as a worker's do.
            worker = [sys.executable, "-c", "import time; time.sleep(60)"]
            engine = LocalEngine(pool, worker, os.path.join(folder, "log"))
            self.assertEqual(engine.count(), 0)
            engine.grow(2)
            children = engine._children
            again = LocalEngine(pool, worker, os.path.join(folder, "log"))
            described = again.describe()
            self.assertEqual(len(described), 2)
            again.shrink([described[0].name])
            children[described[0].name].wait(100)
            self.assertEqual([i.name for i in engine.describe()], [described[1].name])
            self.assertEqual(LocalEngine(pool + "x", worker, "log").count(), 0)
            engine.shrink([described[1].name])
            for child in children.values():
                self.assertEqual(child.wait(100), -signal.SIGTERM)
            self.assertEqual(engine.count(), 0)

    def test_a_process_is_counted_as_soon_as_it_is_started(self):
        with tempfile.TemporaryDirectory() as folder:
            worker = [sys.executable, "-c", "import time; time.sleep(60)"]
            engine = LocalEngine(f"soon{os.getpid()}", worker, os.path.join(folder, "log"))
            for count in range(1, 31):
                engine.grow(1)
                newest = list(engine._children.values())[-1]
                with open(f"/proc/{newest.pid}/cmdline", "rb") as arguments:
                    self.assertIn(b"--tag", arguments.read())
                self.assertEqual(engine.count(), count)
            children = list(engine._children.values())
            engine.shrink([instance.name for instance in engine.describe()])
            for child in children:
                self.assertEqual(child.wait(100), -signal.SIGTERM)

    def test_a_worker_that_cannot_start(self):
        engine = LocalEngine("none", ["/nowhere/sheaf-worker"], os.devnull)
        with self.assertRaisesRegex(EngineError, "--worker"):
            engine.grow(1)


class CommandLineTest(unittest.TestCase):
    def test_durations(self):
        self.assertEqual([duration(t) for t in ("90s", "10m", "1h30m", "45")],
                         [90, 600, 5400, 45])

    def test_refusals(self):
        for words in (["--threads", "0"], ["--threads", "2", "--max", "0"],
                      ["--threads", "2", "--pool", "a b"], ["--threads", "2", "--cool-down", "5x"],
                      ["--threads", "2", "--look-every", "0s"]):
            done = subprocess.run(
                [sys.executable, "-m", "sheaf_autoscaler", "--engine", "local", *words],
                env=dict(os.environ, PYTHONPATH=sys.path[0]), capture_output=True, text=True,
                timeout=600, check=False)
            self.assertEqual(done.returncode, 2, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
