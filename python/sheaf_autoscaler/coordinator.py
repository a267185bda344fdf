# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""CoordinatorReader: reads a coordinator's work and workers as a Look; drains workers."""
from __future__ import annotations

import math
import time
from typing import Callable, Mapping, Sequence

import sheaf

from .controller import FarmError
from .demand import BAND_DEVIATIONS
from .look import JobWork, Look, WorkerState

JOBS_READ_MAX = 20_000  # At most 10,000 are unfinished.
# How often all of them are read. In between, those newer than the oldest unfinished one are: a job
# that has ended comes back by a refinement only.
FULL_READ_SECONDS = 60.0
NEW_JOBS_MAX = 200  # Between two looks; more are seen at the next full read.

# A job of unknown cost costs by the sample what the others do on average; without others, this:
# scenes cost 1.3 to 185 microseconds of a thread by the sample (docs/scheduling.md).
UNKNOWN_SAMPLE_SECONDS = 20e-6
UNKNOWN_DEVIATION = 1.0
DEFAULT_TILE_PX, DEFAULT_PASS_SAMPLES = 32, 16  # Defaults of Partition, proto/sheaf/v1/frame.proto.

_WORKING = (sheaf.WorkerState.IDLE, sheaf.WorkerState.BUSY, sheaf.WorkerState.DRAINING)
_LIVE = (sheaf.JobState.QUEUED, sheaf.JobState.RUNNING)


def cost_deviation(done_fraction: float) -> float:
    """As the coordinator's own forecasts: CostDeviation, coordinator/forecast/shared_farm.h."""
    return 0.1 + 0.25 * (1 - min(1.0, max(0.0, done_fraction)))


class CoordinatorReader:
    """A Farm (controller.py). tags, memory_bytes: what the pool's workers have; jobs that require
    more are left to others. memory_bytes 0: enough for all.
    """

    def __init__(self, client: sheaf.Client, pool: str, tags: Sequence[str] = (),
                 memory_bytes: int = 0) -> None:
        self._client, self._pool = client, pool
        self._tags, self._memory_bytes = set(tags), memory_bytes
        self._read_all = -math.inf
        self._read_next = JOBS_READ_MAX
        self._cpu_seconds: dict[str, float] = {}  # By job, at the last look.
        self._cpu_seconds_done = 0.0

    def look(self) -> Look:
        try:
            jobs = self._jobs()
            workers = self._client.list_workers()
            weights = self._client.share_weights()
        except sheaf.SheafError as error:
            raise FarmError(str(error)) from error
        return Look(time.time(), time.monotonic(),
                    tuple(works_of([j for j in jobs if self._is_for_pool(j)], weights)),
                    tuple(_state_of(w) for w in workers
                          if w.message.pool == self._pool and w.state in _WORKING),
                    self._cpu_seconds_done)

    def drain(self, workers: Sequence[str]) -> None:
        self._each(workers, lambda names: self._client.drain(names, then_exit=True))

    def undrain(self, workers: Sequence[str]) -> None:
        self._each(workers, self._client.undrain)

    @staticmethod
    def _each(workers: Sequence[str], call: Callable[[list[str]], object]) -> None:
        for name in workers:  # One by one: some may have gone meanwhile.
            try:
                call([name])
            except sheaf.NotFoundError:
                continue
            except sheaf.SheafError as error:
                raise FarmError(str(error)) from error

    def _jobs(self) -> list[sheaf.Job]:
        now = time.monotonic()
        if now - self._read_all >= FULL_READ_SECONDS:
            self._read_next, self._read_all = JOBS_READ_MAX, now
        jobs = self._client.list_jobs(self._read_next, with_pilots=True)
        oldest = max((n for n, job in enumerate(jobs) if not job.state.has_ended), default=-1)
        self._read_next = min(JOBS_READ_MAX, oldest + 1 + NEW_JOBS_MAX)
        for job in jobs:
            cpu_seconds = job.progress.cpu_seconds
            self._cpu_seconds_done += max(0.0, cpu_seconds - self._cpu_seconds.get(job.name, 0.0))
            self._cpu_seconds[job.name] = cpu_seconds
        if len(self._cpu_seconds) > 2 * JOBS_READ_MAX:
            self._cpu_seconds = {job.name: job.progress.cpu_seconds for job in jobs}
        return jobs

    def _is_for_pool(self, job: sheaf.Job) -> bool:
        needs = job.message.requirements
        enough = not self._memory_bytes or needs.memory_min_bytes <= self._memory_bytes
        return (job.state in _LIVE and not job.message.held and enough
                and (needs.pool or "default") == self._pool and self._tags.issuperset(needs.tags))


def works_of(jobs: Sequence[sheaf.Job], weights: Mapping[str, float]) -> list[JobWork]:
    """The work of jobs of which something may be leased. weights: sheaf.Client.share_weights()."""
    known = [cost for cost in map(_sample_seconds, jobs) if cost is not None]
    usual = sum(known) / len(known) if known else UNKNOWN_SAMPLE_SECONDS
    return [work for job in jobs if (work := _work_of(job, usual, weights)).cpu_seconds > 0]


def _sample_seconds(job: sheaf.Job) -> float | None:
    """Measured, otherwise quoted, otherwise None."""
    done, progress = job.progress.sample_count_done, job.progress
    if done > 0 and progress.cpu_seconds > 0:
        return progress.cpu_seconds / done
    quoted = job.message.deadline.cpu_seconds.value
    return quoted / progress.sample_count_total if quoted > 0 else None


def _work_of(job: sheaf.Job, usual_sample_seconds: float, weights: Mapping[str, float]) -> JobWork:
    progress, message = job.progress, job.message
    left = max(0, progress.sample_count_total - progress.sample_count_done)
    cost = _sample_seconds(job)
    quoted = message.deadline.cpu_seconds
    if cost is None:
        deviation = UNKNOWN_DEVIATION
    elif progress.sample_count_done == 0 and quoted.high > quoted.low > 0:
        deviation = math.log(quoted.high / quoted.low) / (2 * BAND_DEVIATIONS)
    else:
        deviation = cost_deviation(progress.fraction)
    partition = message.partition
    samples_of_task = ((partition.tile_size_px or DEFAULT_TILE_PX) ** 2
                       * (partition.pass_sample_count or DEFAULT_PASS_SAMPLES))
    deadline = message.deadline.time
    return JobWork(
        job.name, left * (usual_sample_seconds if cost is None else cost), deviation, job.priority,
        message.show, job.owner, weights.get(f"show:{message.show}", 1.0),
        weights.get(f"user:{job.owner}", 1.0),
        deadline.seconds + deadline.nanos * 1e-9 if message.HasField("deadline") else None,
        max(1.0, math.ceil(left / samples_of_task)))


def _state_of(worker: sheaf.Worker) -> WorkerState:
    leaving = worker.message.drained or worker.state is sheaf.WorkerState.DRAINING
    return WorkerState(worker.name, worker.thread_count, worker.lease_count,
                       tuple(worker.message.tags), leaving)
