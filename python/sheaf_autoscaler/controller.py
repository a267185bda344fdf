# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Controller: compares the pool with what is wanted, and asks the engine for the difference.

Its state between steps only saves work for the engine: after a restart the pool shrinks later, by
at most one cool-down.
"""
from __future__ import annotations

import collections
import dataclasses
import logging
import math
from typing import Protocol, Sequence

from .demand import Wanted, wanted
from .engine import INSTANCE_PREFIX, Engine, Instance, InstanceState
from .look import Look, WorkerState

LOG = logging.getLogger("sheaf-autoscaler")

# An instance that has run for this long without a connected worker is ended.
UNCONNECTED_SECONDS_MAX = 300.0
# How often instances are described to find those, and those that are stuck.
INSPECT_SECONDS = 60.0
# Waits between attempts to grow while instances end before their workers connect.
GROW_WAIT_SECONDS_MIN, GROW_WAIT_SECONDS_MAX = 5.0, 300.0
# CPU seconds that a thread gives a second: as the coordinator assumes before it is measured
# (kUsualThreadUse), its least value, and the weight of a new measurement.
USUAL_THREAD_USE, THREAD_USE_MIN, THREAD_USE_WEIGHT = 0.95, 0.1, 0.2
# A measurement needs this many thread-seconds of workers with leases.
MEASURED_THREAD_SECONDS_MIN = 30.0


@dataclasses.dataclass(frozen=True)
class Bounds:
    workers_min: int = 0
    workers_max: int = 8
    threads: int = 1  # Per worker.
    cool_down_seconds: float = 300.0  # A worker ends when it was not needed for this long.
    queue_seconds: float = 600.0  # Work without a deadline should take at most this long.
    start_seconds: float = 30.0  # From the wish for a worker to its first lease.


class Farm(Protocol):
    """The coordinator. Calls may raise FarmError."""

    def look(self) -> Look: ...

    def drain(self, workers: Sequence[str]) -> None:
        """They finish their leases and end."""

    def undrain(self, workers: Sequence[str]) -> None:
        """Those that have not ended yet get work again."""


class FarmError(Exception):
    """The coordinator did not answer, or refused."""


@dataclasses.dataclass(frozen=True)
class Step:
    """The observations and actions of a step."""
    wanted: Wanted
    count: int  # Instances before, without those that leave.
    target: int  # Instances that are wanted.
    grown: int = 0
    kept: int = 0  # Leaving workers that got work again.
    ended: tuple[str, ...] = ()  # Instances that the engine was told to end.
    drained: tuple[str, ...] = ()  # Workers.


class ThreadUse:
    """CPU seconds that a busy thread gives a second, measured between looks."""

    def __init__(self) -> None:
        self.value = USUAL_THREAD_USE
        self._since: Look | None = None
        self._thread_seconds = 0.0
        self._last: Look | None = None

    def note(self, look: Look) -> None:
        if self._last is None or self._since is None:
            self._since = self._last = look
            return
        before = sum(w.threads for w in self._last.workers if w.lease_count >= w.threads)
        self._thread_seconds += before * max(0.0, look.steady - self._last.steady)
        self._last = look
        if self._thread_seconds < MEASURED_THREAD_SECONDS_MIN:
            return
        measured = (look.cpu_seconds_done - self._since.cpu_seconds_done) / self._thread_seconds
        if measured > 0:  # Otherwise jobs have gone from the list.
            measured = min(1.0, max(THREAD_USE_MIN, measured))
            self.value += THREAD_USE_WEIGHT * (measured - self.value)
        self._since, self._thread_seconds = look, 0.0


class Controller:
    """Call step() every few seconds, from one thread. prefix: starts the names of the instances, so
    that workers of other engines count as workers of others.
    """

    def __init__(self, farm: Farm, engine: Engine, bounds: Bounds,
                 prefix: str = INSTANCE_PREFIX) -> None:
        self._farm, self._engine, self._bounds, self._prefix = farm, engine, bounds, prefix
        self._targets: collections.deque[tuple[float, int]] = collections.deque()
        self._thread_use = ThreadUse()
        self._inspected = -math.inf
        self._grow_wait = 0.0  # Doubles while instances end before their workers connect.
        self._grow_after = -math.inf
        self._expected = 0  # Instances, if none has ended by itself.
        self._is_tried = True  # Whether a worker has connected since the pool last grew.

    def step(self) -> Step:
        """Looks, decides and acts once. Raises FarmError and EngineError; call it again then."""
        look = self._farm.look()
        self._thread_use.note(look)
        ours, others = self._split(look)
        # Whichever sees more: an engine that was asked wrongly must not make the pool grow.
        count = max(self._engine.count(), len(ours))
        leaving = [worker for worker in ours if worker.leaving]
        staying = max(0, count - len(leaving))
        want = self._wanted(look, others)
        target = self._target(want, ours, others)
        self._note_target(look.steady, target, staying)
        step = Step(want, staying, target)
        self._note_losses(look, staying, bool(ours))
        if target > staying:
            step = self._grow(step, look, count, leaving)
        keep = max(value for _, value in self._targets)
        if staying > keep or look.steady - self._inspected >= INSPECT_SECONDS:
            step = self._shrink(step, look, ours, keep)
        self._expected = staying + step.grown + step.kept - len(step.ended) - len(step.drained)
        return step

    def _split(self, look: Look) -> tuple[list[WorkerState], list[WorkerState]]:
        """Workers of instances of this engine, and others of the pool."""
        ours = [w for w in look.workers if any(t.startswith(self._prefix) for t in w.tags)]
        return ours, [w for w in look.workers if w not in ours and not w.leaving]

    def _wanted(self, look: Look, others: Sequence[WorkerState]) -> Wanted:
        bounds = self._bounds
        all_threads = bounds.workers_max * bounds.threads + sum(w.threads for w in others)
        return wanted(look.jobs, look.time, threads_max=all_threads,
                      thread_use=self._thread_use.value, queue_seconds=bounds.queue_seconds,
                      start_seconds=bounds.start_seconds, threads_step=bounds.threads)

    def _target(self, want: Wanted, ours: Sequence[WorkerState],
                others: Sequence[WorkerState]) -> int:
        """Instances. Threads that are busy now stay; other workers of the pool count."""
        threads = self._bounds.threads
        busy = sum(min(w.lease_count, w.threads) for w in ours if not w.leaving)
        missing = want.threads - sum(w.threads for w in others)
        # Sums of floats may exceed a whole number of workers by their last bit.
        target = math.ceil(max(missing, busy) / threads - 1e-9)
        return min(self._bounds.workers_max, max(self._bounds.workers_min, target))

    def _note_target(self, now: float, target: int, staying: int) -> None:
        if not self._targets:  # After a start, what is there stays for a cool-down.
            self._targets.append((now, min(staying, self._bounds.workers_max)))
        self._targets.append((now, target))
        while (len(self._targets) > 1
               and now - self._targets[0][0] >= self._bounds.cool_down_seconds):
            self._targets.popleft()

    def _note_losses(self, look: Look, staying: int, is_connected: bool) -> None:
        if is_connected:
            self._grow_wait, self._is_tried = 0.0, True
        lost = self._expected - staying
        if self._is_tried or lost <= 0:
            return
        self._is_tried = True
        self._grow_wait = min(GROW_WAIT_SECONDS_MAX,
                              max(GROW_WAIT_SECONDS_MIN, 2 * self._grow_wait))
        self._grow_after = look.steady + self._grow_wait
        LOG.warning("%d instances ended before their workers connected; asking for others in "
                    "%.0f s. The log of a worker says why it ended", lost, self._grow_wait)

    def _grow(self, step: Step, look: Look, count: int, leaving: Sequence[WorkerState]) -> Step:
        missing = step.target - step.count
        kept = [worker.name for worker in leaving][:missing]
        if kept:
            self._farm.undrain(kept)
        # Those that leave hold machines until they have gone.
        more = min(missing - len(kept), self._bounds.workers_max - count)
        if more <= 0 or look.steady < self._grow_after:
            return dataclasses.replace(step, kept=len(kept))
        self._engine.grow(more)
        self._is_tried = False
        return dataclasses.replace(step, grown=more, kept=len(kept))

    def _shrink(self, step: Step, look: Look, ours: Sequence[WorkerState], keep: int) -> Step:
        self._inspected = look.steady
        instances = self._engine.describe()
        by_tag = {tag: worker for worker in ours for tag in worker.tags}
        ended = [i.name for i in instances if self._is_broken(i, by_tag)]
        waiting = [i.name for i in instances if i.state is InstanceState.WAITING]
        running = sorted((by_tag[i.name] for i in instances if i.name in by_tag
                          and i.name not in ended and not by_tag[i.name].leaving),
                         key=lambda worker: worker.lease_count)
        # Instances without a worker do not count here: they start, or have just been left.
        surplus = len(waiting) + len(running) - keep
        ended += waiting[:max(0, surplus)]
        surplus -= min(max(0, surplus), len(waiting))
        # Busy workers go only where the pool is larger than it may be.
        beyond = step.count - self._bounds.workers_max
        drained = [w.name for n, w in enumerate(running[:max(0, surplus)])
                   if w.lease_count == 0 or n < beyond]
        if ended:
            self._engine.shrink(ended)
        if drained:
            self._farm.drain(drained)
        return dataclasses.replace(step, ended=tuple(ended), drained=tuple(drained))

    @staticmethod
    def _is_broken(instance: Instance, by_tag: dict[str, WorkerState]) -> bool:
        if instance.state is InstanceState.STUCK:
            return True
        return (instance.state is InstanceState.RUNNING and instance.name not in by_tag
                and instance.running_seconds > UNCONNECTED_SECONDS_MAX)
