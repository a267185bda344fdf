# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Use a Sheaf farm from Python: submit scenes, follow jobs, get images as numpy arrays.

    import sheaf

    with sheaf.connect("farm.example.org") as client:
        job = client.wait(client.submit("room.pbrt", samples=256))
        image = client.image(job)
        print(image.rgb.mean(), image.error.max())

sheaf.v1 holds the messages of proto/sheaf/v1.
"""
from sheaf.client import Client, JobLike, connect
from sheaf.errors import (CoordinatorError, EndedJobError, FileError, InvalidRequestError,
                          JobCancelledError, JobFailedError, LimitError, MissingLibraryError,
                          NotFoundError, NotLoggedInError, NotPermittedError, ProgramError,
                          SceneError, SheafError, UnreachableError, WaitExpiredError,
                          WrongStateError)
from sheaf.farm import Farm
from sheaf.images import ErrorPoint, Image, read_image
from sheaf.jobs import (Estimate, Frame, Job, JobEvent, JobState, Progress, RefinementPrice,
                        Round, StopReason, Worker, WorkerState)

__all__ = [
    "Client", "CoordinatorError", "EndedJobError", "ErrorPoint", "Estimate", "Farm", "FileError",
    "Frame", "Image", "InvalidRequestError", "Job", "JobCancelledError", "JobEvent",
    "JobFailedError", "JobLike", "JobState", "LimitError", "MissingLibraryError", "NotFoundError",
    "NotLoggedInError", "NotPermittedError", "Progress", "ProgramError", "RefinementPrice",
    "Round", "SceneError", "SheafError", "StopReason", "UnreachableError", "WaitExpiredError",
    "Worker", "WorkerState", "WrongStateError", "connect", "read_image",
]
