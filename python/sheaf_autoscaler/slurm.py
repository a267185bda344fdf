# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""SlurmEngine: workers as tasks of requeueable job arrays, by sbatch, squeue and scancel.

Slurm sends SIGTERM to the batch script before preemption, the time limit and a cancellation; the
script has become the worker by exec, so the worker finishes or returns its tasks. A task of a node
that fails, or that is preempted, is queued again by Slurm and starts another worker.
"""
from __future__ import annotations

import dataclasses
import logging
import os
import re
import shlex
import subprocess
import time
from typing import Callable, Sequence

from .engine import INSTANCE_PREFIX, EngineError, Instance, InstanceState
from .slurm_text import (FORMAT, QueueLine, check_options, cluster_of, environment_of,
                         instances_of, job_of, line_of, name_of)

LOG = logging.getLogger("sheaf-autoscaler")
COMMAND_SECONDS_MAX = 30
# Tasks of one array: below the least MaxArraySize that sites set.
ARRAY_TASKS_MAX = 500
# Arrays that were started are known by their numbers, too: a plug-in may rename jobs.
OWN_ARRAYS_MAX = 10_000
# slurmctld is asked for tasks that squeue does not show after this long, one array per look.
UNSEEN_SECONDS = 60.0
_NAME = re.compile(re.escape(INSTANCE_PREFIX) + r"slurm\.(\d+)\.(\d+)", re.ASCII)


@dataclasses.dataclass(frozen=True)
class SlurmOptions:
    job_name: str  # Tells this pool's arrays from the user's other jobs.
    partition: str = ""
    account: str = ""
    qos: str = ""
    constraint: str = ""
    exclusive: bool = False  # One worker a node; otherwise one for each set of `cpus` processors.
    cpus: int = 1
    memory: str = ""  # For the task, as sbatch --mem.
    output: str = "/dev/null"  # For the workers, as sbatch --output.
    # Seconds from Slurm's signal to the end: preemption, the time limit.
    notice_seconds: int = 60
    more: tuple[str, ...] = ()  # Further options of sbatch.


@dataclasses.dataclass
class Array:
    """A job array started by sbatch."""
    cluster: str
    asked: float  # When it was started, or slurmctld was last asked for it.
    unseen: set[int]  # Its tasks that squeue has not shown yet: they count until it does.


class SlurmEngine:
    """command: the worker's. Variables of Slurm in it are replaced on the node."""

    def __init__(self, options: SlurmOptions, command: Sequence[str],
                 clock: Callable[[], float] = time.monotonic) -> None:
        check_options(options.more)
        self._options, self._clock = options, clock
        self._cluster = cluster_of(options.more, os.environ)
        words = " ".join(_quoted(word) for word in command)
        tag = f'"{INSTANCE_PREFIX}slurm.$SLURM_ARRAY_JOB_ID.$SLURM_ARRAY_TASK_ID"'
        self._script = f"#!/bin/bash\nexec {words} --tag {tag}\n"
        self._arrays: dict[str, Array] = {}
        self._nameless = 0  # Tasks of which sbatch told no number, and squeue showed none.
        self._known: set[tuple[str, int]] = set()  # Tasks of this pool at the last look.
        self._told: set[str] = set()  # Messages logged once.

    def count(self) -> int:
        return len(self.describe())

    def grow(self, count: int) -> None:
        while count > 0:
            some = min(count, ARRAY_TASKS_MAX)
            self._note_started(self._run(["sbatch", "--parsable", *self._arguments(some),
                                          *self._at(self._cluster)], self._script), some)
            count -= some

    def shrink(self, names: Sequence[str]) -> None:
        by_cluster: dict[str, list[tuple[str, int]]] = {}
        for match in filter(None, map(_NAME.fullmatch, names)):
            array = self._arrays.get(match[1])
            cluster = array.cluster if array else self._cluster
            by_cluster.setdefault(cluster, []).append((match[1], int(match[2])))
        for cluster, tasks in by_cluster.items():
            for at in range(0, len(tasks), ARRAY_TASKS_MAX):
                some = tasks[at:at + ARRAY_TASKS_MAX]
                self._run(["scancel", "--quiet", *self._at(cluster),
                           *(f"{job}_{task}" for job, task in some)])
                for job, task in some:
                    if job in self._arrays:
                        self._arrays[job].unseen.discard(task)

    def describe(self) -> list[Instance]:
        instances: list[Instance] = []
        known: set[tuple[str, int]] = set()
        # --all: those of hidden partitions, too.
        for line in self._queue(self._cluster, ["--me", "--all"]):
            array = self._arrays.get(line.job)
            if array is not None and array.cluster != self._cluster:
                array = None  # Its number counts elsewhere.
            if line.job_name == self._options.job_name:
                tasks = {(line.job, task) for task in line.tasks}
                if array is None:
                    self._nameless = max(0, self._nameless - len(tasks - self._known))
                known |= tasks
            elif array is None:
                continue  # A job of the user.
            else:
                self._tell("renamed", "Slurm calls job %s %s instead of %s, so that a new start of "
                           "sheaf-autoscaler counts only those of its workers that have connected",
                           line.job, line.job_name, self._options.job_name)
            if array is not None:
                array.unseen.difference_update(line.tasks)
            instances += instances_of(line)
        self._known = known
        self._ask_for_unseen()
        unseen = [name_of(job, task) for job, array in self._arrays.items()
                  for task in sorted(array.unseen)]
        unseen += [f"{INSTANCE_PREFIX}slurm.unknown.{number}" for number in range(self._nameless)]
        return instances + [Instance(name, InstanceState.WAITING, 0.0, "squeue does not show it")
                            for name in unseen]

    def _note_started(self, answer: str, count: int) -> None:
        started = job_of(answer)
        if started is None:
            self._nameless += count
            self._tell("nameless", 'sbatch answered "%s", which is not the number of a job; its %d '
                       "tasks count as workers until squeue shows them", answer.strip()[:200],
                       count)
            return
        job, cluster = started
        if cluster and not self._cluster and not self._arrays:
            self._cluster = cluster
        elif cluster not in ("", self._cluster):
            self._tell("cluster", "sbatch has submitted job %s to the cluster %s, not to %s; give "
                       "--slurm-option=--clusters=%s", job, cluster,
                       self._cluster or "that of this machine", cluster)
        while len(self._arrays) >= OWN_ARRAYS_MAX:
            del self._arrays[next(iter(self._arrays))]
        self._arrays[job] = Array(cluster or self._cluster, self._clock(), set(range(count)))

    def _ask_for_unseen(self) -> None:
        """Forgets tasks that have ended before squeue showed them: their cluster knows best."""
        now = self._clock()
        waiting = [(array.asked, job) for job, array in self._arrays.items()
                   if array.unseen and now - array.asked >= UNSEEN_SECONDS]
        if not waiting:
            return
        job = min(waiting)[1]
        array = self._arrays[job]
        array.asked = now
        try:
            for line in self._queue(array.cluster, [f"--jobs={job}", "--all"]):
                if line.job == job and not instances_of(line):
                    array.unseen.difference_update(line.tasks)
        except EngineError as error:
            if "invalid job id" not in str(error).lower():
                raise
            array.unseen.clear()
        if array.unseen:
            self._tell("unseen", "squeue does not show %d tasks of job %s, which sbatch has "
                       "started; they count as workers. Is it asked at the same cluster?",
                       len(array.unseen), job)

    def _queue(self, cluster: str, which: list[str]) -> list[QueueLine]:
        text = self._run(["squeue", "--noheader", "--array", *which, *self._at(cluster),
                          "--states=all", f"--format={FORMAT}"])
        lines = []
        for words in text.splitlines():
            line = line_of(words)
            if line is not None:
                lines.append(line)
            elif words.strip() and not words.startswith("CLUSTER:"):
                self._tell("line", 'skipped a line of squeue that is none of a job: "%s"; others '
                           "are skipped without a word", words.strip()[:200])
        return lines

    def _tell(self, what: str, text: str, *values: object) -> None:
        if what not in self._told:
            self._told.add(what)
            LOG.warning(text, *values)

    @staticmethod
    def _at(cluster: str) -> list[str]:
        return [f"--clusters={cluster}"] if cluster else []

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
                                  errors="replace", timeout=COMMAND_SECONDS_MAX, check=False,
                                  env=environment_of(os.environ))
        except FileNotFoundError as error:
            raise EngineError(f"{command[0]}: there is no such program; install Slurm's client "
                              "programs on this machine") from error
        except subprocess.TimeoutExpired as error:
            raise EngineError(f"{command[0]}: no answer in {COMMAND_SECONDS_MAX} s; is slurmctld "
                              "up? (scontrol ping)") from error
        except (OSError, ValueError) as error:
            raise EngineError(f"{command[0]}: cannot be run: {error}") from error
        if done.returncode:
            raise EngineError(f"{command[0]}: {done.stderr.strip() or 'failed without a reason'}")
        return done.stdout


def _quoted(word: str) -> str:
    """For a shell. Variables of Slurm stay, so that paths may name them."""
    if not re.search(r"\$\{?SLURMD?_\w+", word):
        return shlex.quote(word)
    if re.search(r'[`"\\]|\$(?!\{?SLURMD?_)', word):
        raise EngineError(f"{word}: has a variable of Slurm and other characters of a shell; use "
                          "letters, digits, / and - beside the variable")
    return f'"{word}"'
