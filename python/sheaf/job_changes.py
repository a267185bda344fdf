# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Updates a watcher's copy of a job from messages with changes."""
from __future__ import annotations

from sheaf.jobs import Frame, Job, frame_from, job_from
from sheaf.v1 import job_view_pb2


class JobChanges:
    """Brings a job up to date by messages of WatchJob. Frames that have not changed are those of
    the job before, so that a change costs as much as it has frames.
    """

    def __init__(self) -> None:
        self._frames: dict[int, Frame] = {}  # By number, in its order.
        self._troubles: dict[int, job_view_pb2.FrameTrouble] = {}

    def add(self, message: job_view_pb2.Job) -> Job:
        """message: has all frames of the job, or those that have changed."""
        if not message.frames_are_changes:
            self._frames.clear()
            self._troubles.clear()
        changed = {frame.spec.frame_number: frame_from(frame) for frame in message.frames}
        self._frames.update(changed)
        for number in changed:
            self._troubles.pop(number, None)
        self._troubles.update({trouble.frame_number: trouble for trouble in message.troubles})
        if message.frames_are_changes:
            message = self._whole(message)
        return job_from(message, tuple(self._frames.values()))

    def _whole(self, message: job_view_pb2.Job) -> job_view_pb2.Job:
        whole = job_view_pb2.Job()
        whole.CopyFrom(message)
        whole.frames_are_changes = False
        del whole.frames[:]
        whole.frames.extend(frame.message for frame in self._frames.values())
        del whole.troubles[:]
        whole.troubles.extend(self._troubles[number] for number in sorted(self._troubles))
        return whole
