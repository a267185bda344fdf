# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Inputs and outputs of Slurm's programs: options, variables, lines. Pure."""
from __future__ import annotations

import dataclasses
import re
from typing import Mapping, Sequence

from .engine import INSTANCE_PREFIX, EngineError, Instance, InstanceState

# States of squeue(1) that no longer hold a machine, or only until the node is cleaned; tasks that
# are queued again have other states.
GONE_STATES = frozenset(("COMPLETING", "COMPLETED", "CANCELLED", "FAILED", "TIMEOUT", "BOOT_FAIL",
                         "DEADLINE", "OUT_OF_MEMORY", "STAGE_OUT", "NODE_FAIL", "PREEMPTED",
                         "REVOKED", "LAUNCH_FAILED", "RECONFIG_FAIL"))
HELD_STATES = frozenset(("REQUEUE_HOLD", "SPECIAL_EXIT", "RESV_DEL_HOLD"))
RUNNING_STATES = frozenset(("RUNNING", "SUSPENDED", "STOPPED", "RESIZING", "SIGNALING"))
# For squeue --format: the reason is last, because it may hold any character.
FORMAT = "%i|%T|%M|%N|%j|%r"
# Options of sbatch that the autoscaler gives itself, or with which nothing is started.
OWN_OPTIONS = {"--array": "-a", "--job-name": "-J", "--wait": "-W", "--test-only": "",
               "--help": "-h", "--usage": "", "--version": "-V"}
# squeue and scancel take filters from the environment, which would hide tasks; SBATCH_WAIT would
# make sbatch wait for the end of the workers. The cluster is an option of all three instead.
_DROPPED_PREFIXES = ("SQUEUE_", "SCANCEL_")
_DROPPED = frozenset(("SLURM_CLUSTERS", "SBATCH_CLUSTERS", "SBATCH_WAIT"))
TASKS_OF_LINE_MAX = 100_000


@dataclasses.dataclass(frozen=True)
class QueueLine:
    """A line of squeue: tasks of a job array, or of a job that is none."""
    job: str
    tasks: tuple[int, ...]
    state: str
    running_seconds: float
    node: str
    job_name: str
    reason: str


def line_of(text: str) -> QueueLine | None:
    """None if it is not a line of FORMAT."""
    parts = text.strip().split("|", 5)
    if len(parts) < 6:
        return None
    identifier, state, used, node, name, reason = parts
    job, has_tasks, tasks = identifier.partition("_")
    numbers = tasks_of(tasks) if has_tasks else ()
    if not re.fullmatch(r"\d{1,20}", job, re.ASCII) or numbers is None or not state:
        return None
    return QueueLine(job, numbers, state, seconds_of(used), node, name, reason)


def tasks_of(text: str) -> tuple[int, ...] | None:
    """Parses "3" or the short form "[1,3-5,8-12:2%4]"; None if it is neither."""
    if re.fullmatch(r"\d{1,9}", text, re.ASCII):
        return (int(text),)
    match = re.fullmatch(r"\[([\d,:-]+)(?:%\d+)?\]", text, re.ASCII)
    found: list[int] = []
    for part in match[1].split(",") if match else ():
        run = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9})(?::(\d{1,9}))?)?", part, re.ASCII)
        if run is None:
            return None
        first, last, step = int(run[1]), int(run[2] or run[1]), int(run[3] or 1)
        if step < 1 or last < first or len(found) + (last - first) // step >= TASKS_OF_LINE_MAX:
            return None
        found += range(first, last + 1, step)
    return tuple(found) or None


def instances_of(line: QueueLine) -> list[Instance]:
    """None of tasks that have ended. Those in states that are unknown here count as waiting."""
    if line.state in GONE_STATES:
        return []
    where, running = line.reason, 0.0
    if line.state == "PENDING" or line.state in HELD_STATES:
        # Held: by a user, or by Slurm after failed launches. Others wait for a machine.
        held = line.state in HELD_STATES or "held" in line.reason.lower()
        state = InstanceState.STUCK if held else InstanceState.WAITING
    elif line.state in RUNNING_STATES:
        state, running, where = InstanceState.RUNNING, line.running_seconds, line.node
    else:
        state, where = InstanceState.WAITING, f"{line.state} {line.reason}"
    return [Instance(name_of(line.job, task), state, running, where) for task in line.tasks]


def name_of(job: str, task: int) -> str:
    return f"{INSTANCE_PREFIX}slurm.{job}.{task}"


def seconds_of(text: str) -> float:
    """Parses squeue's times: "1-02:03:04", "02:03:04", "03:04"; 0 for others, as "INVALID"."""
    match = re.fullmatch(r"(?:(\d{1,6})-)?(?:(\d{1,6}):)?(\d{1,6}):(\d{1,6})", text.strip())
    if match is None:
        return 0.0
    days, hours, minutes, seconds = (int(part or 0) for part in match.groups())
    return float(((days * 24 + hours) * 60 + minutes) * 60 + seconds)


def job_of(answer: str) -> tuple[str, str] | None:
    """The job and its cluster, which is empty if sbatch names none. Parses `sbatch --parsable`, or
    a site's wrapper that prints sbatch's usual words; other lines are a site's messages to its
    users.
    """
    for line in reversed(answer.splitlines()):
        match = (re.fullmatch(r"\s*(\d{1,20})(?:;(\S+))?\s*", line, re.ASCII)
                 or re.search(r"Submitted batch job (\d{1,20})(?: on cluster (\S+))?", line))
        if match:
            return match[1], match[2] or ""
    return None


def cluster_of(more: Sequence[str], environment: Mapping[str, str]) -> str:
    """The cluster that sbatch would submit to; empty for the one of this machine."""
    cluster = environment.get("SLURM_CLUSTERS") or environment.get("SBATCH_CLUSTERS") or ""
    for at, word in enumerate(more):
        option, equal, value = word.partition("=")
        if word.startswith("-M") and len(word) > 2:
            cluster = word[2:].removeprefix("=")
        elif word == "-M" or _is_short_for(option, "--clusters"):
            cluster = value if equal else "".join(more[at + 1:at + 2])
    if cluster == "all" or "," in cluster:
        raise EngineError(f"the clusters {cluster}: a pool is on one cluster; name one with "
                          "--slurm-option=--clusters=NAME, and run one sheaf-autoscaler for each, "
                          "with a --pool of its own")
    return cluster


def check_options(more: Sequence[str]) -> None:
    """Refuses what would start other tasks than the autoscaler counts."""
    for word in more:
        for option, short in OWN_OPTIONS.items():
            name = word.partition("=")[0]
            if _is_short_for(name, option) or (short and word.startswith(short)):
                raise EngineError(f"--slurm-option={word}: sheaf-autoscaler gives {option} itself, "
                                  "or cannot count what sbatch starts with it; leave it out")


def environment_of(environment: Mapping[str, str]) -> dict[str, str]:
    """For Slurm's programs."""
    kept = {name: value for name, value in environment.items()
            if not name.startswith(_DROPPED_PREFIXES) and name not in _DROPPED}
    # Otherwise squeue shortens the tasks of an array to 64 characters.
    return {**kept, "SLURM_BITSTR_LEN": "0"}


def _is_short_for(word: str, option: str) -> bool:
    """As getopt_long takes "--arr" for "--array". sbatch refuses what is short for several."""
    return len(word) >= 4 and option.startswith(word)
