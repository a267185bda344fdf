# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Engine: what starts workers on machines. An instance is what it starts for one worker: an array
task of Slurm, or a process of this machine.
"""
from __future__ import annotations

import dataclasses
import enum
from typing import Protocol, Sequence


# Names of instances begin with it. A worker has the name of its instance as a tag.
INSTANCE_PREFIX = "instance."


class EngineError(Exception):
    """The engine did not answer, or refused. The text says what, why and what to do."""


class InstanceState(enum.Enum):
    WAITING = "waiting"  # For a machine.
    RUNNING = "running"
    STUCK = "stuck"  # Will not start by itself.


@dataclasses.dataclass(frozen=True)
class Instance:
    name: str  # Its worker has this tag.
    state: InstanceState
    running_seconds: float = 0.0
    where: str = ""  # The machine, or why it waits.


class Engine(Protocol):
    """All calls may raise EngineError; any change is then visible in describe()."""

    def count(self) -> int:
        """Instances that run or wait to run."""

    def grow(self, count: int) -> None:
        """Requests `count` more workers. Those that wait for a machine count at once."""

    def shrink(self, names: Sequence[str]) -> None:
        """Ends these. A worker gets SIGTERM and returns its work; unknown names are ignored."""

    def describe(self) -> list[Instance]:
        """All that count() counts."""
