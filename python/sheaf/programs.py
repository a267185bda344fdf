# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs Sheaf's programs, which read scenes, renew certificates and make local farms."""
from __future__ import annotations

import json
import logging
import os
import shutil
import subprocess
from typing import Sequence

from sheaf import errors

LOG = logging.getLogger("sheaf")
MESSAGE_CHARACTERS_MAX = 4000  # The end of what a program said that an exception repeats.

# Exit codes of `sheaf`; see sheaf --help.
_ERRORS_BY_EXIT_CODE: dict[int, type[errors.SheafError]] = {
    2: errors.InvalidRequestError,
    3: errors.UnreachableError,
    4: errors.SceneError,
    6: errors.FileError,
}
_LOG_LEVELS = {"info": logging.INFO, "note": logging.WARNING}


def find_program(name: str, folder: str | os.PathLike[str] | None) -> str:
    """The path of a program, in the folder or, without one, in PATH. Raises ProgramError."""
    path = shutil.which(name, path=os.fspath(folder) if folder is not None else None)
    if path is None:
        where = f"in {os.fspath(folder)}" if folder is not None else "in PATH"
        raise errors.ProgramError(
            f"{name}: there is no such program {where}; build Sheaf (./deploy/build release prints "
            "the folder of its programs) and add that folder to PATH, or pass it as programs=")
    return path


def run_sheaf(arguments: Sequence[str], folder: str | os.PathLike[str] | None,
              timeout_seconds: float | None = None) -> str:
    """Runs `sheaf` with --json and returns its standard output. Its notes go to the logger "sheaf".

    Raises the exception of the exit code, with the program's own words.
    """
    program = find_program("sheaf", folder)
    try:
        done = subprocess.run([program, *arguments, "--json"], stdin=subprocess.DEVNULL,
                              capture_output=True, encoding="utf-8", errors="replace",
                              timeout=timeout_seconds, check=False)
    except subprocess.TimeoutExpired:
        raise errors.ProgramError(f"sheaf {arguments[0]}: did not end within {timeout_seconds} s; "
                                  "run it in a terminal to see why") from None
    failures = []
    for line in done.stderr.splitlines():
        try:
            message = json.loads(line)
            severity, text = str(message["severity"]), str(message["message"])
        except (ValueError, TypeError, KeyError):
            severity, text = "error" if done.returncode else "note", line
        if severity == "error":
            failures.append(text)
        else:
            LOG.log(_LOG_LEVELS.get(severity, logging.WARNING), "%s", text)
    if done.returncode:
        kind = _ERRORS_BY_EXIT_CODE.get(done.returncode, errors.ProgramError)
        text = "\n".join(failures) or (f"sheaf {arguments[0]}: ended with exit code "
                                       f"{done.returncode} and said nothing; run it in a terminal")
        raise kind(text[-MESSAGE_CHARACTERS_MAX:])
    return done.stdout
