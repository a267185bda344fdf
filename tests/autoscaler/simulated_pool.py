# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A coordinator and an engine in simulated time, for tests of the autoscaler: workers take a while
to start, render leases of about ten seconds, share jobs evenly, and may be preempted.
"""
import dataclasses
import math
import os
import random
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "python"))

from sheaf_autoscaler.engine import (INSTANCE_PREFIX, EngineError, Instance,  # noqa: E402
                                     InstanceState)
from sheaf_autoscaler.look import JobWork, Look, WorkerState  # noqa: E402

LEASE_SECONDS = 10.0  # For one thread.


@dataclasses.dataclass
class SimJob:
    name: str
    quoted_seconds: float  # CPU time.
    true_seconds: float
    deviation: float  # The quote's.
    deadline: float | None = None
    submit_time: float = 0.0
    done_seconds: float = 0.0
    leased_seconds: float = 0.0  # Done, or held in leases.
    end_time: float | None = None

    def work(self):
        fraction = self.done_seconds / self.true_seconds
        if self.done_seconds > 0:  # Measured: as well as the coordinator knows by then.
            deviation = 0.1 + 0.25 * (1 - fraction)
            expected = self.true_seconds - self.done_seconds
            if self.deviation < deviation:  # The quote knows it better.
                deviation = self.deviation
                expected = self.quoted_seconds * (1 - fraction)
        else:
            expected, deviation = self.quoted_seconds, self.deviation
        return JobWork(self.name, max(expected, 1e-3), deviation, deadline=self.deadline,
                       task_count=max(1, math.ceil(
                           (self.true_seconds - self.done_seconds) / LEASE_SECONDS)))


@dataclasses.dataclass
class SimInstance:
    name: str
    ready: float  # When its worker connects.
    leases: list = dataclasses.field(default_factory=list)  # [job, seconds left, seconds].
    leaving: bool = False
    machine_since: float | None = None


class SimPool:
    """Farm and Engine at once. start_seconds: the range in which machines start."""

    def __init__(self, jobs, threads=1, machines=8, start_seconds=(5, 25), seed=1,
                 thread_use=0.95):
        self.now = 1_000_000.0
        self.steady_offset = 0.0  # For the clock that cannot be set; tests set the other one.
        self.jobs, self.threads, self.machines = list(jobs), threads, machines
        self._start_seconds, self._thread_use = start_seconds, thread_use
        self.random = random.Random(seed)
        self.instances = {}
        self.waiting = []  # Names of instances without a machine.
        self.worker_seconds = 0.0  # Paid: of instances with a machine.
        self.cpu_seconds = 0.0
        self.peak = 0
        self.fails = False  # Whether engine calls do.
        self._number = 0
        for job in self.jobs:
            job.submit_time += self.now
            if job.deadline is not None:
                job.deadline += self.now

    # Farm.
    def look(self):
        workers = tuple(
            WorkerState("workers/" + i.name, self.threads, len(i.leases), (i.name,), i.leaving)
            for i in self.instances.values() if i.ready <= self.now)
        return Look(self.now, self.now + self.steady_offset,
                    tuple(j.work() for j in self.open_jobs()), workers, self.cpu_seconds)

    def drain(self, workers):
        for name in workers:
            self.instances[name.removeprefix("workers/")].leaving = True

    def undrain(self, workers):
        for name in workers:
            self.instances[name.removeprefix("workers/")].leaving = False

    # Engine.
    def count(self):
        self._check()
        return len(self.instances) + len(self.waiting)

    def grow(self, count):
        self._check()
        for _ in range(count):
            self._number += 1
            self.waiting.append(f"{INSTANCE_PREFIX}sim.{self._number}")

    def shrink(self, names):
        self._check()
        self.waiting = [name for name in self.waiting if name not in names]
        for name in names:
            if name in self.instances:
                self._return(self.instances.pop(name))

    def describe(self):
        self._check()
        return [*(Instance(name, InstanceState.WAITING) for name in self.waiting),
                *(Instance(i.name, InstanceState.RUNNING, self.now - i.machine_since)
                  for i in self.instances.values())]

    def _check(self):
        if self.fails:
            raise EngineError("the engine is away")

    # The world.
    def open_jobs(self):
        return [j for j in self.jobs if j.end_time is None and j.submit_time <= self.now]

    def done(self):
        return all(job.end_time is not None for job in self.jobs)

    def preempt(self, count=1):
        """Takes machines away; the engine queues the instances again."""
        for name in self.random.sample(sorted(self.instances), min(count, len(self.instances))):
            self._return(self.instances.pop(name))
            self.waiting.append(name)

    def set_clock(self, seconds):
        """Moves the wall clock; what is under way takes as long as before."""
        self.now += seconds
        self.steady_offset -= seconds
        for job in self.jobs:
            job.submit_time += seconds
        for instance in self.instances.values():
            instance.ready += seconds
            instance.machine_since += seconds

    def play(self, seconds):
        """Plays on by a step of at most a lease."""
        self.now += seconds
        while self.waiting and len(self.instances) < self.machines:
            name = self.waiting.pop(0)
            ready = self.now + self.random.uniform(*self._start_seconds)
            self.instances[name] = SimInstance(name, ready, machine_since=self.now)
        self.peak = max(self.peak, len(self.instances))
        self.worker_seconds += seconds * len(self.instances)
        for instance in list(self.instances.values()):
            if instance.ready <= self.now:
                self._work(instance, seconds)
            if instance.leaving and not instance.leases:
                del self.instances[instance.name]

    def _work(self, instance, seconds):
        leases = instance.leases
        instance.leases = []
        for thread in range(self.threads):
            left = seconds * self._thread_use
            lease = leases[thread] if thread < len(leases) else None
            while left > 0:
                lease = lease or (None if instance.leaving else self._lease())
                if lease is None:
                    break
                job, spent = lease[0], min(left, lease[1])
                left -= spent
                lease[1] -= spent
                job.done_seconds += spent
                self.cpu_seconds += spent
                if job.done_seconds >= job.true_seconds - 1e-6 and job.end_time is None:
                    job.end_time = self.now
                if lease[1] <= 1e-9:
                    lease = None
            lease = lease or (None if instance.leaving else self._lease())
            if lease is not None:
                instance.leases.append(lease)

    def _lease(self):
        """The next lease, or None. Jobs have even shares."""
        ready = [j for j in self.open_jobs() if j.leased_seconds < j.true_seconds - 1e-9]
        if not ready:
            return None
        job = min(ready, key=lambda j: j.leased_seconds)
        length = min(LEASE_SECONDS, job.true_seconds - job.leased_seconds)
        job.leased_seconds += length
        return [job, length, length]

    def _return(self, instance):
        """The tasks that the worker had begun are rendered again."""
        for job, left, length in instance.leases:
            job.leased_seconds -= length
            job.done_seconds -= length - left


def simulate(pool, controller, *, look_seconds=5.0, seconds_max=40_000.0, each=None):
    """Plays until all jobs are done and, without a floor, all instances are gone."""
    begin = pool.now + pool.steady_offset
    while not (pool.done() and pool.count() <= controller_floor(controller)):
        if pool.now + pool.steady_offset - begin > seconds_max:
            raise AssertionError(f"not done after {seconds_max} s: {pool.jobs}, "
                                 f"{pool.count()} instances")
        controller.step()
        if each is not None:
            each()
        pool.play(look_seconds)


def controller_floor(controller):
    return controller._bounds.workers_min
