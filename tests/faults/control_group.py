# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A control group with a limit of memory, of version 1 or 2, where the machine allows one."""
import contextlib
import os
import time

ROOT = "/sys/fs/cgroup"
VERSION_1 = os.path.join(ROOT, "memory")
LEAVE_SECONDS_MAX = 5


def _parent():
    """The folder of the group in which new groups are made."""
    return VERSION_1 if os.path.isdir(VERSION_1) else ROOT


def why_not():
    """Why there can be no such group; "" where there can."""
    try:
        with ControlGroup() as group:
            group.limit(1 << 30)
        return ""
    except OSError as error:
        return f"no control group for memory: {error}"


class ControlGroup:
    """Use with `with`: at the end its processes go back to where the first came from."""
    made = 0

    def __enter__(self):
        ControlGroup.made += 1
        self.home = None
        self.folder = os.path.join(_parent(), f"sheaf_faults_{os.getpid()}_{ControlGroup.made}")
        os.mkdir(self.folder)
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError):
            self.limit(None)
        end = time.monotonic() + LEAVE_SECONDS_MAX
        while True:
            self._empty()
            try:
                os.rmdir(self.folder)
                return
            except OSError:  # A process that ends is in it for a moment still.
                if time.monotonic() > end:
                    raise
                time.sleep(0.02)

    def _empty(self):
        with open(os.path.join(self.folder, "cgroup.procs"), encoding="ascii") as file:
            for pid in file.read().split():
                self._move(pid, self.home or _parent())

    def _move(self, pid, folder):
        with contextlib.suppress(ProcessLookupError):
            with open(os.path.join(folder, "cgroup.procs"), "w", encoding="ascii") as file:
                file.write(str(pid))

    def add(self, pids):
        for pid in pids:
            self.home = self.home or self._group_of(pid)
            self._move(pid, self.folder)

    def _group_of(self, pid):
        marks = (":memory:", "0::") if _parent() == VERSION_1 else ("0::",)
        with open(f"/proc/{pid}/cgroup", encoding="ascii") as file:
            lines = file.read().splitlines()
        for mark in marks:
            for line in lines:
                if mark in line:
                    return _parent() + line.partition(mark)[2]
        return _parent()

    def limit(self, max_bytes):
        """Limits the memory of all its processes together; None: no limit."""
        if _parent() == VERSION_1:
            name, text = "memory.limit_in_bytes", "-1" if max_bytes is None else str(max_bytes)
        else:
            name, text = "memory.max", "max" if max_bytes is None else str(max_bytes)
        with open(os.path.join(self.folder, name), "w", encoding="ascii") as file:
            file.write(text)
