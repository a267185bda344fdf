# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Standard streams of a program: open from its start, and checked at its end."""
from __future__ import annotations

import contextlib
import io
import os
import sys
from typing import Callable, Iterator

OUTPUT_EXIT_CODE = 6  # "A file cannot be read or written", as of sheaf.


class OutputError(Exception):
    """Standard output cannot be written. No OSError, which argparse of Python 3.12 drops."""


class _Output(io.TextIOWrapper):
    def write(self, text: str) -> int:
        with _output_errors():
            return super().write(text)

    def flush(self) -> None:
        with _output_errors():
            super().flush()


@contextlib.contextmanager
def _output_errors() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(error.strerror) from error


def open_standard_streams() -> None:
    """Opens /dev/null for those of the descriptors 0 to 2 that are closed, so that no socket takes
    their numbers. Output that was closed can still not be written.
    """
    for stream, flags in ((0, os.O_WRONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(stream)
        except OSError:
            os.set_inheritable(os.open(os.devnull, flags), True)
    is_terminal = sys.stdout is not None and sys.stdout.isatty()
    sys.stdout = _Output(open(1, "wb", closefd=False), encoding="utf-8",
                         line_buffering=is_terminal)
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False, encoding="utf-8")


def run_program(name: str, main: Callable[[], int]) -> int:
    """The exit code of main, or OUTPUT_EXIT_CODE in place of 0 if what it printed was not written.
    A reader that has closed its pipe is not an error.
    """
    open_standard_streams()
    try:
        code = main()
    except SystemExit as end:  # argparse, after help and errors of usage.
        code = end.code if isinstance(end.code, int) else 1
    except BrokenPipeError:
        code = 0
    except OutputError as error:
        return _report(name, str(error))
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _drop_output()
    except OutputError as error:
        reported = _report(name, str(error))
        return code or reported
    return code


def _report(name: str, why: str) -> int:
    _drop_output()
    print(f"{name}: standard output: not all could be written: {why}; what was printed is "
          "incomplete. Write it to an open file on a disk that has room", file=sys.stderr)
    return OUTPUT_EXIT_CODE


def _drop_output() -> None:
    """So that the interpreter does not flush it again at its end."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.close(null)
