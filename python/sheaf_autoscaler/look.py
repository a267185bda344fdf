# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Look: what the coordinator said at one time, as plain values."""
from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class JobWork:
    """The work that a job has left, of which something may be leased now."""
    name: str
    cpu_seconds: float  # Expected, of worker threads.
    deviation: float  # Standard deviation of the logarithm of the true CPU time over that.
    priority: int = 0
    show: str = ""
    user: str = ""
    show_weight: float = 1.0  # The weights of their shares.
    user_weight: float = 1.0
    deadline: float | None = None  # Seconds since 1970.
    task_count: float = 1.0  # Passes of tiles that are left: further threads are useless.


@dataclasses.dataclass(frozen=True)
class WorkerState:
    """A connected worker of the pool that is not lost, sick or in quarantine."""
    name: str
    threads: int
    lease_count: int
    tags: tuple[str, ...] = ()
    leaving: bool = False  # It is drained or stopping, and gets nothing more.


@dataclasses.dataclass(frozen=True)
class Look:
    time: float  # Seconds since 1970, which deadlines are compared with. People set this clock.
    steady: float  # Seconds of a clock that cannot be set, for intervals.
    jobs: tuple[JobWork, ...] = ()
    workers: tuple[WorkerState, ...] = ()
    # CPU time of all results so far, of the jobs that were listed.
    cpu_seconds_done: float = 0.0
