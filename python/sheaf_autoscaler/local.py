# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""LocalEngine: workers as processes of this machine. They outlive the autoscaler, which finds them
again in /proc by their tag.
"""
from __future__ import annotations

import logging
import os
import secrets
import signal
import subprocess
import time
from typing import Iterator, Sequence

from .engine import INSTANCE_PREFIX, EngineError, Instance, InstanceState

LOG = logging.getLogger("sheaf-autoscaler")
LOG_BYTES_MAX = 16 << 20  # Limit of the workers' log; a longer one is restarted.
ARGUMENTS_SECONDS_MAX = 10  # Until /proc shows the arguments of a process that was started.
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")


class LocalEngine:
    """pool: told apart by its name, in the user's processes. command: the worker's, without tag.
    log_path: of all workers.
    """

    def __init__(self, pool: str, command: Sequence[str], log_path: str) -> None:
        self._prefix = f"{INSTANCE_PREFIX}local.{pool}."
        self._command, self._log_path = list(command), log_path
        self._children: dict[str, subprocess.Popen[bytes]] = {}  # By the name of the instance.

    def count(self) -> int:
        return len(self._processes())

    def grow(self, count: int) -> None:
        try:
            too_long = os.path.getsize(self._log_path) > LOG_BYTES_MAX
        except OSError:  # There is none yet, or opening it says what is wrong.
            too_long = False
        try:
            with open(self._log_path, "wb" if too_long else "ab") as log:
                for _ in range(count):
                    name = self._prefix + secrets.token_hex(4)
                    self._children[name] = subprocess.Popen(
                        [*self._command, "--tag", name],
                        stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
                    _wait_for_arguments(self._children[name])
        except (OSError, ValueError) as error:
            raise EngineError(f"a worker cannot be started: {error}; give --worker the program and "
                              "--log-file a file that can be written") from error

    def shrink(self, names: Sequence[str]) -> None:
        for pid, name in self._processes():
            if name in names:
                try:
                    os.kill(pid, signal.SIGTERM)
                except ProcessLookupError:
                    continue
                except OSError as error:
                    raise EngineError(f"process {pid} cannot be stopped: {error}; it is a worker "
                                      "of this pool that runs as another user") from error

    def describe(self) -> list[Instance]:
        now = time.clock_gettime(time.CLOCK_BOOTTIME)
        instances = []
        for pid, name in self._processes():
            try:
                with open(f"/proc/{pid}/stat", encoding="utf-8", errors="replace") as file:
                    # proc(5): field 22, counted after the name in parentheses, is the start.
                    began = int(file.read().rpartition(")")[2].split()[19]) / CLOCK_TICKS
            except (OSError, ValueError, IndexError):
                continue
            instances.append(Instance(name, InstanceState.RUNNING, now - began, f"process {pid}"))
        return instances

    def _processes(self) -> list[tuple[int, str]]:
        self._children = {n: child for n, child in self._children.items() if child.poll() is None}
        # A program that rewrites its arguments is found as a child only.
        by_name = {name: child.pid for name, child in self._children.items()}
        # Between fork and exec a worker's child has the worker's arguments.
        for pid, name in self._find():
            if name not in self._children:
                by_name[name] = min(pid, by_name.get(name, pid))
        return [(pid, name) for name, pid in by_name.items()]

    def _find(self) -> Iterator[tuple[int, str]]:
        own = os.getuid()
        try:
            entries = list(os.scandir("/proc"))
        except OSError as error:
            raise EngineError(f"/proc: cannot be listed: {error}; the local engine finds its "
                              "workers there") from error
        for entry in entries:
            if not entry.name.isdigit():
                continue
            try:
                if entry.stat().st_uid != own:
                    continue
                with open(f"/proc/{entry.name}/cmdline", "rb") as file:
                    words = file.read().decode("utf-8", "replace").split("\0")
            except OSError:  # It has ended.
                continue
            # The scene processes of a worker have other arguments.
            if len(words) > 2 and words[-3] == "--tag" and words[-2].startswith(self._prefix):
                yield int(entry.name), words[-2]


def _wait_for_arguments(process: subprocess.Popen[bytes]) -> None:
    """Linux lets the parent of a vfork run on before the arguments of the new program can be read:
    until then /proc has none, and a worker just started would not be counted.
    """
    end = time.monotonic() + ARGUMENTS_SECONDS_MAX
    while process.poll() is None and time.monotonic() < end:
        try:
            with open(f"/proc/{process.pid}/cmdline", "rb") as file:
                if file.read(1):
                    return
        except OSError:
            return
        time.sleep(0.001)
