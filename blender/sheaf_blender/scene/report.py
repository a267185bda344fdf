# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The report of an export: what is approximated and what is left out."""
import contextlib
import dataclasses
import os
import traceback

ENTRIES_MAX = 500  # More are counted, not kept: a panel cannot show them.

APPROXIMATED, LEFT_OUT = "approximated", "left out"


@dataclasses.dataclass(frozen=True)
class Entry:
    kind: str  # APPROXIMATED or LEFT_OUT.
    item: str  # As 'material "Gold"'.
    text: str  # What, and what the image has instead.

    def __str__(self):
        return f"{self.item}: {self.text} ({self.kind})"


def cause(error):
    """One line that says what was raised, and where."""
    places = traceback.extract_tb(error.__traceback__)
    where = f"{os.path.basename(places[-1].filename)}:{places[-1].lineno}" if places else "?"
    return f"{str(error).strip() or type(error).__name__} ({type(error).__name__} at {where})"


class Report:
    """Entries in the order of their first mention; repetitions count once."""

    def __init__(self):
        self._entries = {}
        self.omitted = 0  # Entries beyond ENTRIES_MAX.

    def approximated(self, item, text):
        self._add(Entry(APPROXIMATED, item, text))

    def left_out(self, item, text):
        self._add(Entry(LEFT_OUT, item, text))

    @contextlib.contextmanager
    def guard(self, item):
        """An exception ends the work on this item alone, and is its entry."""
        try:
            yield
        except Exception as error:
            self.left_out(item, f"it cannot be exported: {cause(error)}")

    def include(self, other):
        """Adds the entries of another report."""
        for entry in other.entries:
            self._add(entry)
        self.omitted += other.omitted

    @property
    def entries(self):
        return list(self._entries)

    def lines(self):
        lines = [str(entry) for entry in self._entries]
        if self.omitted:
            lines.append(f"{self.omitted} more entries are not shown")
        return lines

    def _add(self, entry):
        if entry in self._entries:
            return
        if len(self._entries) >= ENTRIES_MAX:
            self.omitted += 1
            return
        self._entries[entry] = None
