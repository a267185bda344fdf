# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Faults of the machine in running programs, for tests: the other side of
tests/support/machine_faults.cc, which is preloaded.
"""
import struct

# Named points of tests/support/machine_faults.cc.
BEFORE_RENAME, AFTER_RENAME, AFTER_ROW, BEFORE_GROUP, AFTER_GROUP = 1, 2, 3, 4, 5


class MachineFaults:
    """The faults that the programs with this environment have now: none at first."""

    def __init__(self, library, path):
        self.path = path
        self.environment = {"LD_PRELOAD": library, "SHEAF_TEST_FAULTS": path}
        with open(path, "wb") as file:
            file.write(bytes(88))

    def set(self, clock_offset_seconds=0, write_error=0, kill_point=0, kill_path=""):
        """write_error: an error number (errno.ENOSPC); 0: writes succeed."""
        with open(self.path, "r+b") as file:
            file.write(struct.pack("=qqq64s", clock_offset_seconds, write_error, kill_point,
                                   kill_path.encode()))
