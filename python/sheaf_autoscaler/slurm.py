# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""SlurmEngine: workers as tasks of requeueable job arrays, by sbatch, squeue and scancel.

Slurm sends SIGTERM to the batch script before preemption, the time limit and a cancellation; the
script has become the worker by exec, so the worker finishes or returns its tasks. A task of a node
that fails, or that is preempted, is queued again by Slurm and starts another worker.
"""
from __future__ import annotations

import dataclasses
import re
import shlex
import subprocess
from typing import Sequence

from .engine import INSTANCE_PREFIX, EngineError, Instance, InstanceState

COMMAND_SECONDS_MAX = 30
# Tasks of one array: below the least MaxArraySize that sites set.
ARRAY_TASKS_MAX = 500
# States of squeue(1) that hold a machine no more, or only until the node is cleaned; those of tasks
# that are queued again are others.
GONE_STATES = frozenset(("COMPLETING", "COMPLETED", "CANCELLED", "FAILED", "TIMEOUT", "BOOT_FAIL",
                         "DEADLINE", "OUT_OF_MEMORY", "STAGE_OUT", "NODE_FAIL", "PREEMPTED",
                         "REVOKED"))
HELD_STATES = frozenset(("REQUEUE_HOLD", "SPECIAL_EXIT"))
_NAME = re.compile(re.escape(INSTANCE_PREFIX) + r"slurm\.(\d+)\.(\d+)")


@dataclasses.dataclass(frozen=True)
class SlurmOptions:
    job_name: str  # Tells this pool's arrays from the user's other jobs.
    partition: str = ""
    account: str = ""
    qos: str = ""
    constraint: str = ""
    exclusive: bool = False  # One worker a node; otherwise one for each set of `cpus` processors.
    cpus: int = 1
    memory: str = ""  # Of the task, as sbatch --mem.
    output: str = "/dev/null"  # Of the workers, as sbatch --output.
    # Seconds from Slurm's signal to the end: preemption, the time limit.
    notice_seconds: int = 60
    more: tuple[str, ...] = ()  # Further options of sbatch.


class SlurmEngine:
    """command: the worker's. Variables of Slurm in it are replaced on the node."""

    def __init__(self, options: SlurmOptions, command: Sequence[str]) -> None:
        self._options = options
        words = " ".join(_quoted(word) for word in command)
        tag = f'"{INSTANCE_PREFIX}slurm.$SLURM_ARRAY_JOB_ID.$SLURM_ARRAY_TASK_ID"'
        self._script = f"#!/bin/bash\nexec {words} --tag {tag}\n"

    def count(self) -> int:
        return len(self.describe())

    def grow(self, count: int) -> None:
        while count > 0:
            some = min(count, ARRAY_TASKS_MAX)
            self._run(["sbatch", "--parsable", *self._arguments(some)], self._script)
            count -= some

    def shrink(self, names: Sequence[str]) -> None:
        found = [_NAME.fullmatch(name) for name in names]
        tasks = [f"{match[1]}_{match[2]}" for match in found if match]
        for at in range(0, len(tasks), ARRAY_TASKS_MAX):
            self._run(["scancel", "--quiet", *tasks[at:at + ARRAY_TASKS_MAX]])

    def describe(self) -> list[Instance]:
        # %r, the reason, is last, because it may hold spaces.
        text = self._run(["squeue", "--noheader", "--array", "--me",
                          f"--name={self._options.job_name}", "--states=all",
                          "--format=%i|%T|%M|%N|%r"])
        instances = (instance_of(line) for line in text.splitlines() if line.strip())
        return [instance for instance in instances if instance is not None]

    def _arguments(self, count: int) -> list[str]:
        options = self._options
        chosen = [f"--{name}={value}" for name, value in
                  (("partition", options.partition), ("account", options.account),
                   ("qos", options.qos), ("constraint", options.constraint),
                   ("mem", options.memory)) if value]
        return [f"--array=0-{count - 1}", f"--job-name={options.job_name}", "--requeue",
                "--open-mode=append", f"--output={options.output}", "--nodes=1", "--ntasks=1",
                f"--cpus-per-task={options.cpus}", f"--signal=B:TERM@{options.notice_seconds}",
                *(["--exclusive"] if options.exclusive else []), *chosen, *options.more]

    @staticmethod
    def _run(command: list[str], script: str = "") -> str:
        try:
            done = subprocess.run(command, input=script, capture_output=True, encoding="utf-8",
                                  errors="replace", timeout=COMMAND_SECONDS_MAX, check=False)
        except FileNotFoundError as error:
            raise EngineError(f"{command[0]}: there is no such program; install Slurm's client "
                              "programs on this machine") from error
        except subprocess.TimeoutExpired as error:
            raise EngineError(f"{command[0]}: no answer in {COMMAND_SECONDS_MAX} s; is slurmctld "
                              "up? (scontrol ping)") from error
        if done.returncode:
            raise EngineError(f"{command[0]}: {done.stderr.strip() or 'failed without a reason'}")
        return done.stdout


def instance_of(line: str) -> Instance | None:
    """Of a line of squeue; None if its task has ended."""
    identifier, state, used, node, reason = line.strip().split("|", 4)
    job, _, task = identifier.partition("_")
    if state in GONE_STATES or not task.isdigit():
        return None
    name = f"{INSTANCE_PREFIX}slurm.{job}.{task}"
    if state == "PENDING" or state in HELD_STATES:
        # Held: by a person, or by Slurm after failed launches. Others wait for a machine.
        held = state in HELD_STATES or "held" in reason.lower()
        return Instance(name, InstanceState.STUCK if held else InstanceState.WAITING, 0.0, reason)
    if state in ("RUNNING", "SUSPENDED", "STOPPED"):
        return Instance(name, InstanceState.RUNNING, seconds_of(used), node)
    return Instance(name, InstanceState.WAITING, 0.0, f"{state} {reason}")


def seconds_of(text: str) -> float:
    """Of squeue's times: "1-02:03:04", "02:03:04", "03:04"; 0 for others, as "INVALID"."""
    match = re.fullmatch(r"(?:(\d+)-)?(?:(\d+):)?(\d+):(\d+)", text.strip())
    if match is None:
        return 0.0
    days, hours, minutes, seconds = (int(part or 0) for part in match.groups())
    return float(((days * 24 + hours) * 60 + minutes) * 60 + seconds)


def _quoted(word: str) -> str:
    """For a shell. Variables of Slurm stay, so that paths may name them."""
    if not re.search(r"\$\{?SLURMD?_\w+", word):
        return shlex.quote(word)
    if re.search(r'[`"\\]|\$(?!\{?SLURMD?_)', word):
        raise EngineError(f"{word}: has a variable of Slurm and other characters of a shell; use "
                          "letters, digits, / and - beside the variable")
    return f'"{word}"'
