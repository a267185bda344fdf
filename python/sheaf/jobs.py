# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Jobs, frames and workers as plain values. proto/sheaf/v1 explains each field; `message` of a
value is the message that it was made from, with all of them.
"""
from __future__ import annotations

import dataclasses
import datetime
import enum
from typing import Any

from sheaf.v1 import farm_pb2, frame_pb2, job_pb2, job_view_pb2


class JobState(enum.Enum):
    UNKNOWN = 0  # From a newer coordinator.
    QUEUED = 1
    RUNNING = 2
    SUCCEEDED = 3
    FAILED = 4
    CANCELLED = 5
    PAUSED = 6

    @property
    def has_ended(self) -> bool:
        return self in (JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED)


class WorkerState(enum.Enum):
    UNKNOWN = 0  # From a newer coordinator.
    IDLE = 1
    BUSY = 2
    DRAINING = 3
    LOST = 4
    QUARANTINED = 5
    STOPPED = 6
    SICK = 7


class StopReason(enum.Enum):
    """Why a frame ended."""
    UNKNOWN = -1  # From a newer coordinator.
    SAMPLES = 0
    TARGET_ERROR = 1
    TIME = 2
    CPU = 3


@dataclasses.dataclass(frozen=True)
class Progress:
    """Progress and resources used so far."""
    sample_count_done: int
    sample_count_total: int
    relative_mse: float | None  # Until it can be estimated: None.
    nonfinite_count: int
    ray_count: int
    cpu_seconds: float
    wall_seconds: float
    remaining_seconds: float | None
    remaining_band: tuple[float, float] | None  # Only for jobs: holds in 8 of 10 cases.
    remaining_alone_seconds: float | None  # If no other job shared the farm.

    @property
    def fraction(self) -> float:
        """From 0 to 1."""
        return min(1.0, self.sample_count_done / max(1, self.sample_count_total))


@dataclasses.dataclass(frozen=True)
class Round:
    """A point of the curve of error against cost; totals since the start."""
    relative_mse: float
    relative_mse_upper: float
    certified_relative_mse: float | None
    sample_count: int
    ray_count: int
    cpu_seconds: float
    wall_seconds: float


@dataclasses.dataclass(frozen=True)
class Frame:
    """One image of a job."""
    name: str  # "jobs/ID/frames/NUMBER".
    number: int
    width_px: int
    height_px: int
    complete: bool
    progress: Progress
    rounds: tuple[Round, ...]
    stop_reason: StopReason | None  # Until it is complete: None.
    image_digest: str  # Until it is complete: "".
    flip: float | None
    left_eye_relative_mse: float | None  # Stereo frames; progress has the worse one.
    right_eye_relative_mse: float | None
    eye_difference_relative_mse: float | None  # The left eye less the right one.
    tile_count: int
    unreliable_tile_count: int
    message: frame_pb2.Frame = dataclasses.field(repr=False, compare=False)


@dataclasses.dataclass(frozen=True)
class Job:
    """Frames that were submitted together."""
    name: str  # "jobs/ID".
    title: str
    state: JobState
    priority: int
    progress: Progress
    frames: tuple[Frame, ...]  # Empty in lists of jobs.
    create_time: datetime.datetime
    end_time: datetime.datetime | None
    failure: str
    waiting_reason: str
    warning: str
    owner: str
    message: job_view_pb2.Job = dataclasses.field(repr=False, compare=False)


@dataclasses.dataclass(frozen=True)
class Worker:
    name: str  # "workers/ID".
    host: str
    state: WorkerState
    thread_count: int
    lease_count: int
    result_count: int
    samples_per_second: float
    last_seen_time: datetime.datetime
    identity: str
    reason: str  # For its quarantine.
    lease_granted_count: int
    lease_cold_count: int  # Those of scenes that it had to load first.
    message: farm_pb2.Worker = dataclasses.field(repr=False, compare=False)


@dataclasses.dataclass(frozen=True)
class Estimate:
    """An estimate and its 80 % interval."""
    value: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class JobEvent:
    """Something that happened to a job. what: a verb for what users did, "cancel"; otherwise
    "started", "failure", "delivered", "succeeded", "failed" or "cancelled"."""
    time: datetime.datetime
    what: str
    who: str  # The user, or "workers/ID"; empty: the coordinator.
    frame: int | None  # None: the whole job.
    text: str


@dataclasses.dataclass(frozen=True)
class RefinementPrice:
    """The cost of refining a job until its frames reach an error."""
    target_error: float
    reached: bool
    relative_mse: Estimate
    samples_per_pixel: Estimate
    cpu_seconds: Estimate  # Beyond what is spent.
    wall_seconds: Estimate


def job_from(message: job_view_pb2.Job, frames: tuple[Frame, ...] | None = None) -> Job:
    """frames: those of the message, if they are known."""
    return Job(
        name=message.name, title=message.title, state=_enum(JobState, message.state, 0),
        priority=message.priority, progress=_progress(message.progress),
        frames=tuple(map(frame_from, message.frames)) if frames is None else frames,
        create_time=_time(message.create_time),
        end_time=_time(message.end_time) if message.HasField("end_time") else None,
        failure=message.failure, waiting_reason=message.waiting_reason, warning=message.warning,
        owner=message.owner, message=message)


def worker_from(message: farm_pb2.Worker) -> Worker:
    return Worker(
        name=message.name, host=message.host, state=_enum(WorkerState, message.state, 0),
        thread_count=message.thread_count, lease_count=message.lease_count,
        result_count=message.result_count, samples_per_second=message.samples_per_second,
        last_seen_time=_time(message.last_seen_time), identity=message.identity,
        reason=message.reason, lease_granted_count=message.lease_granted_count,
        lease_cold_count=message.lease_cold_count, message=message)


def event_from(message: job_view_pb2.JobEvent) -> JobEvent:
    frame = message.frame_number if message.HasField("frame_number") else None
    return JobEvent(time=_time(message.time), what=message.what, who=message.who, frame=frame,
                    text=message.text)


def price_from(message: job_pb2.RefinementPrice) -> RefinementPrice:
    return RefinementPrice(
        target_error=message.target_error, reached=message.reached,
        relative_mse=_estimate(message.relative_mse),
        samples_per_pixel=_estimate(message.samples_per_pixel),
        cpu_seconds=_estimate(message.cpu_seconds), wall_seconds=_estimate(message.wall_seconds))


def frame_from(message: frame_pb2.Frame) -> Frame:
    settings = message.spec.settings
    return Frame(
        name=message.name, number=message.spec.frame_number, width_px=settings.width_px,
        height_px=settings.height_px, complete=message.complete,
        progress=_progress(message.progress), rounds=tuple(map(_round, message.rounds)),
        stop_reason=_enum(StopReason, message.stop_reason, -1) if message.complete else None,
        image_digest=message.image_digest, flip=message.flip or None,
        left_eye_relative_mse=message.left_eye_relative_mse or None,
        right_eye_relative_mse=message.right_eye_relative_mse or None,
        eye_difference_relative_mse=message.eye_difference_relative_mse or None,
        tile_count=message.tile_count, unreliable_tile_count=message.unreliable_tile_count,
        message=message)


def _progress(message: frame_pb2.Progress) -> Progress:
    known = message.HasField("remaining_duration")
    has_band = message.HasField("remaining_duration_low")
    return Progress(
        sample_count_done=message.sample_count_done,
        sample_count_total=message.sample_count_total,
        relative_mse=message.relative_mse or None, nonfinite_count=message.nonfinite_count,
        ray_count=message.ray_count, cpu_seconds=_seconds(message.cpu_duration),
        wall_seconds=_seconds(message.wall_duration),
        remaining_seconds=_seconds(message.remaining_duration) if known else None,
        remaining_band=(_seconds(message.remaining_duration_low),
                        _seconds(message.remaining_duration_high)) if has_band else None,
        remaining_alone_seconds=_seconds(message.remaining_duration_alone) if has_band else None)


def _round(message: frame_pb2.Round) -> Round:
    return Round(
        relative_mse=message.relative_mse, relative_mse_upper=message.relative_mse_upper,
        certified_relative_mse=message.certified_relative_mse or None,
        sample_count=message.sample_count, ray_count=message.ray_count,
        cpu_seconds=_seconds(message.cpu_duration), wall_seconds=_seconds(message.wall_duration))


def _estimate(message: job_view_pb2.Estimate) -> Estimate:
    return Estimate(message.value, message.low, message.high)


def _enum(kind: Any, number: int, unknown: int) -> Any:
    try:
        return kind(number)
    except ValueError:
        return kind(unknown)


def _seconds(duration: Any) -> float:
    return float(duration.seconds + duration.nanos * 1e-9)


def _time(timestamp: Any) -> datetime.datetime:
    when: datetime.datetime = timestamp.ToDatetime(tzinfo=datetime.timezone.utc)
    return when
