# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A farm on this machine for notebooks and scripts: a coordinator and workers on loopback.

Everybody who can open a socket on the machine may use it, as with any coordinator without
certificates (docs/security.md).
"""
from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import weakref

from sheaf.client import Client, connect
from sheaf.errors import InvalidRequestError, ProgramError
from sheaf.jobs import WorkerState
from sheaf.programs import find_program

START_SECONDS_MAX = 60.0
STOP_SECONDS_MAX = 15.0
LOG_CHARACTERS_SHOWN = 2000
POLL_SECONDS = 0.02


class Farm:
    """Use with `with`: starts a coordinator and workers, and stops them at the end.

        with sheaf.Farm() as farm:
            job = farm.client.wait(farm.client.submit("room.pbrt", samples=64))
            image = farm.client.image(job)

    workers: how many. threads: of each; 0: all processors. folder: keeps jobs and images there; by
    default they are in a temporary folder and end with the farm. programs: the folder of Sheaf's
    programs; default: PATH.
    """

    def __init__(self, workers: int = 1, *, threads: int = 0,
                 folder: str | os.PathLike[str] | None = None,
                 programs: str | os.PathLike[str] | None = None) -> None:
        if workers < 0 or threads < 0:
            raise InvalidRequestError(f"a farm of {workers} workers with {threads} threads: both "
                                      "are at least 0; give other numbers")
        self._worker_count, self._threads = workers, threads
        self._given_folder, self._programs = folder, programs
        self._processes: list[subprocess.Popen[bytes]] = []
        self._folder: pathlib.Path | None = None
        self._client: Client | None = None
        self._page = ""
        self._finalizer: weakref.finalize | None = None

    def __enter__(self) -> Farm:
        if self._finalizer is not None:
            raise InvalidRequestError("the farm runs already; use it, or make another one")
        coordinator = find_program("sheaf-coordinator", self._programs)
        worker = find_program("sheaf-worker", self._programs)
        temporary = self._given_folder is None
        self._folder = pathlib.Path(self._given_folder or tempfile.mkdtemp(prefix="sheaf-farm-"))
        self._folder.mkdir(parents=True, exist_ok=True)
        # Also when the farm is forgotten or the interpreter ends.
        self._finalizer = weakref.finalize(self, _stop, os.getpid(), self._processes,
                                           self._folder, temporary)
        try:
            self._start(coordinator, worker)
        except BaseException:  # Python does not call __exit__ if __enter__ has failed.
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
        if self._finalizer is not None:
            self._finalizer()
            self._finalizer = None

    @property
    def client(self) -> Client:
        if self._client is None:
            raise InvalidRequestError("the farm does not run; use it inside of `with`")
        return self._client

    @property
    def address(self) -> str:
        return self.client.address

    @property
    def page(self) -> str:
        """The address of the page that shows the farm's jobs."""
        return self._page

    def log(self, name: str) -> str:
        """The log of "coordinator", "worker1", "worker2" and so on."""
        if self._folder is None or not (self._folder / f"{name}.log").exists():
            raise InvalidRequestError(f'there is no log of "{name}"; names are "coordinator", '
                                      '"worker1" and so on, while the farm runs')
        return (self._folder / f"{name}.log").read_text("utf-8", "replace")

    def _start(self, coordinator: str, worker: str) -> None:
        assert self._folder is not None
        ports = self._folder / "ports"
        ports.unlink(missing_ok=True)
        self._run("coordinator", [coordinator, "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0",
                                  "--state-dir", str(self._folder / "state"),
                                  "--port-file", str(ports)])
        end = time.monotonic() + START_SECONDS_MAX
        found: dict[str, str] = {}
        while len(found) < 2:
            self._check_started(end)
            time.sleep(POLL_SECONDS)
            if ports.exists():
                found = dict(line.split("=") for line in ports.read_text().split() if "=" in line)
        address = "127.0.0.1:" + found["grpc"]
        self._page = f"http://127.0.0.1:{found['http']}/"
        self._client = connect(address, programs=self._programs)
        for number in range(1, self._worker_count + 1):
            self._run(f"worker{number}", [worker, "--coordinator", address, "--threads",
                                          str(self._threads), "--cache-dir",
                                          str(self._folder / "cache")])
        ready = (WorkerState.IDLE, WorkerState.BUSY)
        while sum(w.state in ready for w in self._client.list_workers()) < self._worker_count:
            self._check_started(end)
            time.sleep(POLL_SECONDS)

    def _run(self, name: str, command: list[str]) -> None:
        assert self._folder is not None
        with open(self._folder / f"{name}.log", "ab") as log:
            # In a session of its own, so that Ctrl-C interrupts the script and not the farm.
            self._processes.append(subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log,
                                                    stderr=log, start_new_session=True))

    def _check_started(self, end: float) -> None:
        for i, process in enumerate(self._processes):
            name = "coordinator" if i == 0 else f"worker{i}"
            if process.poll() is not None:
                raise ProgramError(f"the farm cannot start, because its {name} has ended:\n"
                                   f"{self.log(name)[-LOG_CHARACTERS_SHOWN:]}\nCorrect the cause "
                                   "and start the farm again.")
        if time.monotonic() > end:
            raise ProgramError(f"the farm has not started within {START_SECONDS_MAX:.0f} s:\n"
                               f"{self.log('coordinator')[-LOG_CHARACTERS_SHOWN:]}\nStart it again "
                               "when the machine is less busy.")


def _stop(owner: int, processes: list[subprocess.Popen[bytes]], folder: pathlib.Path,
          temporary: bool) -> None:
    """Workers first, so that they return their work."""
    if os.getpid() != owner:  # A fork of the script has ended.
        return
    end = time.monotonic() + STOP_SECONDS_MAX
    for group in (processes[1:], processes[:1]):
        for process in group:
            if not temporary:
                process.terminate()
            else:
                process.kill()  # It is no longer needed.
        for process in group:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    processes.clear()
    if temporary:
        shutil.rmtree(folder, ignore_errors=True)
