# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""How many threads the queue and its deadlines need: pure functions of what was seen.

Jobs are played forward as a fluid under the coordinator's policy of sharing, as its forecasts do
(ShareByTime, coordinator/forecast/shared_farm.h): jobs of the highest priority share all threads,
first between shows, then between the users of a show, in proportion to their weights, then between
the jobs of a user.
"""
from __future__ import annotations

import dataclasses
import math
from typing import Callable, Sequence

from .look import JobWork

# The upper end of an 80 % band: the standard normal distribution is below it in 9 of 10 cases.
BAND_DEVIATIONS = 1.2816
# Leases are cut to end together; the last ones end about this much later (docs/scheduling.md).
TAIL_SECONDS = 10.0
# Jobs beyond this many count as one of least priority.
PLAYED_JOBS_MAX = 200


@dataclasses.dataclass(frozen=True)
class Wanted:
    """Threads that the pool should have, and why."""
    threads: float
    for_queue: float
    for_deadlines: float
    at_risk: tuple[str, ...] = ()  # Jobs whose deadline the largest pool is not sure to make.


def upper_cpu_seconds(job: JobWork) -> float:
    """The upper end of the band of its cost."""
    return job.cpu_seconds * math.exp(BAND_DEVIATIONS * job.deviation)


def ends_of(jobs: Sequence[JobWork], threads: float,
            cost: Callable[[JobWork], float] = upper_cpu_seconds) -> dict[str, float]:
    """Seconds from now to the end of each job on this many threads, all fully used."""
    ends: dict[str, float] = {}
    now = 0.0
    for priority in sorted({job.priority for job in jobs}, reverse=True):
        left = {job: cost(job) for job in jobs if job.priority == priority}
        while left:
            shares = _shares(left)
            step = min(work / (threads * shares[job]) for job, work in left.items())
            now += step
            spent = {job: threads * shares[job] * step for job in left}
            for job in [j for j in left if left[j] <= spent[j] * (1 + 1e-9)]:
                ends[job.name] = now
                del left[job]
            for job in left:
                left[job] -= spent[job]
    return ends


def wanted(jobs: Sequence[JobWork], now: float, *, threads_max: float, thread_use: float,
           queue_seconds: float, start_seconds: float, threads_step: float) -> Wanted:
    """threads_max: those of the largest pool. thread_use: CPU seconds that a thread gives a second.
    queue_seconds: target time of work without a deadline. start_seconds: from the wish for a
    worker to its first lease. threads_step: those of one worker.
    """
    jobs = _played(jobs)
    queued = sum(job.cpu_seconds for job in jobs if not _has_deadline(job, now))
    for_queue = queued / (thread_use * queue_seconds)
    useful = sum(job.task_count for job in jobs)
    due = {job.name: job.deadline - now - start_seconds - TAIL_SECONDS for job in jobs
           if job.deadline is not None and _has_deadline(job, now)}
    for_deadlines = 0.0
    at_risk: tuple[str, ...] = ()
    if due:
        for_deadlines, at_risk = _for_deadlines(jobs, due, threads_max, thread_use, threads_step)
    threads = max(for_queue, for_deadlines)
    if jobs:
        threads = max(threads, min(threads_step, useful))
    return Wanted(min(threads, useful, threads_max), for_queue, for_deadlines, at_risk)


def _for_deadlines(jobs: Sequence[JobWork], due: dict[str, float], threads_max: float,
                   thread_use: float, threads_step: float) -> tuple[float, tuple[str, ...]]:
    """The fewest threads that make all deadlines which the largest pool makes; all threads, if
    there are others.
    """
    def makes(threads: float) -> set[str]:
        ends = ends_of(jobs, threads * thread_use)
        return {name for name, seconds in due.items() if ends[name] <= seconds}
    makeable = makes(threads_max)
    at_risk = tuple(sorted(set(due) - makeable))
    if at_risk:
        return threads_max, at_risk
    low, high = 0, max(1, math.ceil(threads_max / threads_step))  # Workers; high is enough.
    while high - low > 1:
        middle = (low + high) // 2
        if makeable <= makes(middle * threads_step):
            high = middle
        else:
            low = middle
    return min(high * threads_step, threads_max), at_risk


def _has_deadline(job: JobWork, now: float) -> bool:
    """A deadline that has passed has no effect: the job is queued like those without one."""
    return job.deadline is not None and job.deadline > now


def _played(jobs: Sequence[JobWork]) -> list[JobWork]:
    some = [job for job in jobs if job.cpu_seconds > 0]
    if len(some) <= PLAYED_JOBS_MAX:
        return some
    # Those with a deadline first, the earliest first.
    some.sort(key=lambda job: (job.deadline is None, job.deadline or 0.0, -job.priority))
    rest = some[PLAYED_JOBS_MAX:]
    return [*some[:PLAYED_JOBS_MAX],
            JobWork("others", sum(j.cpu_seconds for j in rest), max(j.deviation for j in rest),
                    min(j.priority for j in rest), task_count=sum(j.task_count for j in rest))]


def _shares(jobs: dict[JobWork, float]) -> dict[JobWork, float]:
    """The fraction of all threads that each job gets. They sum to 1."""
    shows: dict[str, dict[str, list[JobWork]]] = {}
    for job in jobs:
        shows.setdefault(job.show, {}).setdefault(job.user, []).append(job)
    shares: dict[JobWork, float] = {}
    all_shows = sum(_first(users).show_weight for users in shows.values())
    for users in shows.values():
        of_show = _first(users).show_weight / all_shows
        all_users = sum(of_user[0].user_weight for of_user in users.values())
        for of_user in users.values():
            share = of_show * of_user[0].user_weight / all_users / len(of_user)
            shares.update((job, share) for job in of_user)
    return shares


def _first(users: dict[str, list[JobWork]]) -> JobWork:
    return next(iter(users.values()))[0]
