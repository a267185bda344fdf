# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The exceptions of the package. The text of each says what happened, why, and what to do."""
from __future__ import annotations

import typing

if typing.TYPE_CHECKING:
    from sheaf.jobs import Job


class SheafError(Exception):
    """The base of all others."""


class UnreachableError(SheafError):
    """No coordinator answers at the address."""


class NotLoggedInError(SheafError):
    """There is no certificate for the address, or it has ended or was revoked."""


class NotPermittedError(SheafError):
    """The user's role does not allow the call, or the job is another user's."""


class NotFoundError(SheafError):
    """There is no such job, frame or layer."""


class InvalidRequestError(SheafError):
    """An argument is malformed or out of its range."""


class WrongStateError(SheafError):
    """The job's state does not allow the call: it has ended, or is not complete. Or this package
    and the coordinator understand no version of the protocol that is the same.
    """


class LimitError(SheafError):
    """A limit of the farm or of the user is reached; see docs/security.md."""


class CoordinatorError(SheafError):
    """Any other refusal by the coordinator."""


class WaitExpiredError(SheafError):
    """The job has not ended within the time to wait. It continues."""


class SceneError(SheafError):
    """The scene has errors; the text names file, line and column."""


class FileError(SheafError):
    """A file on this machine cannot be read or written."""


class ProgramError(SheafError):
    """A program of Sheaf is missing, or ended unexpectedly."""


class MissingLibraryError(SheafError):
    """A Python library is missing that only some calls need."""


class EndedJobError(SheafError):
    """A job has ended without its images."""

    def __init__(self, text: str, job: Job):
        super().__init__(text)
        self.job = job


class JobFailedError(EndedJobError):
    """A frame of the job cannot be rendered."""


class JobCancelledError(EndedJobError):
    """The job was cancelled."""
