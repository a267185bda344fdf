# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The client of a farm: submits scenes, follows and controls jobs, fetches images."""
from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
import time
from typing import Any, Callable, Generator, Sequence, Union

import grpc
from google.protobuf import duration_pb2

from sheaf import errors
from sheaf.address import coordinator_addresses
from sheaf.connection import UNARY_SECONDS_MAX, Connection, transient_wait
from sheaf.images import Image, read_image
from sheaf.job_changes import JobChanges
from sheaf.jobs import (Frame, Job, JobEvent, JobState, RefinementPrice, Worker, event_from,
                        job_from, price_from, worker_from)
from sheaf.programs import run_sheaf
from sheaf.v1 import farm_pb2, frame_pb2, job_pb2, job_view_pb2

WATCH_SECONDS_MAX = 24 * 3600.0  # For one call; a longer watch continues in the next.
DOWNLOAD_SECONDS_MAX = 3600.0  # For one attempt.
IMAGE_BYTES_MAX = 1 << 35
JOBS_PAGE_SIZE = 1000
REWATCH_SECONDS = 0.2
MISSING_SHOWN_MAX = 20  # Numbers of frames in a message.
STOPPED_SAMPLES_MAX = 65536  # The maximum per pixel of a refinement that ends by a stop rule.

JobLike = Union[Job, str, int]  # A job, "jobs/7", "7" or 7.


def job_name(job: JobLike) -> str:
    if isinstance(job, Job):
        return job.name
    text = str(job)
    return text if text.startswith("jobs/") else "jobs/" + text


def connect(address: str | None = None, *, insecure: bool = False,
            programs: str | os.PathLike[str] | None = None,
            answer_seconds: float | None = None) -> Client:
    """Makes a client of the coordinator at "HOST:PORT" or "HOST" (port 7400). The addresses of
    several that share a farm have commas between them.

    Without an address, that of the environment variable SHEAF_COORDINATOR, otherwise
    127.0.0.1:7400. It uses the certificate that `sheaf login` has stored for the address. insecure:
    connect without encryption to another machine, for experiments. programs: the folder of Sheaf's
    programs; default: PATH. answer_seconds: for how long calls are repeated while the coordinator
    does not answer; default: see Client.

    Raises NotLoggedInError and InvalidRequestError. A coordinator that does not answer is an error
    of the first call.
    """
    return Client(Connection(coordinator_addresses(address), insecure, programs, answer_seconds))


class Client:
    """Use with `with`, or close(). May be used by several threads.

    Calls are repeated while the coordinator does not answer: for 4 s until it has answered once,
    later for 15 minutes, with a warning of the logger "sheaf". Names of jobs are "jobs/7", "7" or
    7. All calls raise SheafError or a kind of it.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._connection.close()

    @property
    def address(self) -> str:
        return str(self._connection.address)

    def submit(self, scene: str | os.PathLike[str], *, samples: int | None = None,
               target_error: float | None = None, time_seconds: float | None = None,
               cpu_hours: float | None = None, frames: str | None = None,
               title: str | None = None, priority: int | None = None,
               options: Sequence[str] = ()) -> Job:
        """Submits a pbrt-v4 scene. The program `sheaf` reads and uploads it.

        frames: "1-24" and the like, of a pattern such as shot.####.pbrt. options: more options of
        `sheaf submit`, as ("--aov", "position"). Notes about the scene go to the logger "sheaf".
        Raises SceneError with file, line and column.
        """
        path = os.fspath(scene)
        arguments = ["submit", os.path.abspath(path) if path.startswith("-") else path,
                     "--no-quote", "--coordinator", self.address]
        if self._connection.insecure:
            arguments.append("--insecure")
        seconds = None if time_seconds is None else f"{time_seconds:.6f}s"
        for option, value in (("--samples", samples), ("--target-error", target_error),
                              ("--time", seconds), ("--budget", cpu_hours), ("--frames", frames),
                              ("--title", title), ("--priority", priority)):
            if value is not None:
                arguments.append(f"{option}={value}")
        answer = run_sheaf([*arguments, *options], self._connection.programs)
        return self.get_job(str(json.loads(answer.splitlines()[-1])["name"]))

    def list_jobs(self, count_max: int = 100, *, with_pilots: bool = False) -> list[Job]:
        """Newest first, without their frames."""
        jobs: list[Job] = []
        token = ""
        while len(jobs) < count_max:
            request = job_pb2.ListJobsRequest(
                page_size=min(JOBS_PAGE_SIZE, count_max - len(jobs)), page_token=token,
                with_pilots=with_pilots)
            response = self._unary("ListJobs", request)
            jobs.extend(map(job_from, response.jobs))
            token = response.next_page_token
            if not token:
                break
        return jobs

    def get_job(self, job: JobLike) -> Job:
        """The job as it is now. In this and all other calls, a Job as argument means that very job;
        raises NotFoundError if its number is another's, because the coordinator's state was
        replaced.
        """
        found = job_from(self._unary("GetJob", job_pb2.GetJobRequest(name=job_name(job))))
        _check_identity(job, found)
        return found

    def _name(self, job: JobLike) -> str:
        """For calls that change the job."""
        return self.get_job(job).name if isinstance(job, Job) else job_name(job)

    def watch(self, job: JobLike,
              timeout_seconds: float | None = None) -> Generator[Job, None, None]:
        """Yields the job now and after each change until it has ended, across restarts of the
        coordinator. Raises WaitExpiredError after the timeout.
        """
        name = job_name(job)
        end = None if timeout_seconds is None else time.monotonic() + timeout_seconds
        changes = JobChanges()
        while True:
            messages, message = self._open_watch(name, end)
            try:
                while message is not None:
                    present = changes.add(message)
                    _check_identity(job, present)
                    job = present
                    yield present
                    if present.state.has_ended:
                        return
                    message = self._next(messages)
            finally:
                messages.cancel()
            self._check_end(name, end)
            time.sleep(REWATCH_SECONDS)

    def wait(self, job: JobLike, timeout_seconds: float | None = None,
             on_change: Callable[[Job], object] | None = None, *,
             images: str | os.PathLike[str] | None = None) -> Job:
        """Waits for the job's end and returns it.

        images: the path to which each image is written as soon as it is complete, even if others
        fail; for a job of several frames with #### for the number, as shot.####.exr.

        Raises JobFailedError, JobCancelledError, and WaitExpiredError after the timeout; FileError
        at the end if an image cannot be written.
        """
        last: Job | None = None
        pattern = None if images is None else os.fspath(images)
        written: dict[int, str] = {}  # The digest of each frame's image that has been written.
        failures: list[errors.SheafError] = []
        with contextlib.closing(self.watch(job, timeout_seconds)) as changes:
            for last in changes:
                if pattern is not None:
                    self._write_images(last, pattern, written, failures)
                if on_change is not None:
                    on_change(last)
        assert last is not None  # A watch yields at least once, or raises.
        if last.state is JobState.FAILED:
            raise errors.JobFailedError(
                f"{last.name}: failed: {last.failure}{_missing(last)}; correct the cause and "
                "submit again, or try again with retry()", last) from next(iter(failures), None)
        if last.state is JobState.CANCELLED:
            raise errors.JobCancelledError(
                f"{last.name}: was cancelled{_missing(last)}; submit again what is needed",
                last) from next(iter(failures), None)
        if failures:
            raise failures[0]
        return last

    def _write_images(self, job: Job, pattern: str, written: dict[int, str],
                      failures: list[errors.SheafError]) -> None:
        """An image that cannot be fetched or written does not hold back the others."""
        paths = frame_paths(pattern, [frame.number for frame in job.frames])
        for frame, path in zip(job.frames, paths):
            if not frame.complete or written.get(frame.number) == frame.image_digest:
                continue
            try:
                self._download(frame.name, path)
            except (errors.NotFoundError, errors.WrongStateError) as error:
                # While the job runs, a frame may have restarted, for a refinement or a correction.
                if job.state.has_ended:
                    failures.append(error)
                continue
            except errors.FileError as error:
                failures.append(error)
            written[frame.number] = frame.image_digest

    def cancel(self, job: JobLike) -> Job:
        return self._change("CancelJob", job)

    def pause(self, job: JobLike) -> Job:
        return self._change("PauseJob", job)

    def resume(self, job: JobLike) -> Job:
        return self._change("ResumeJob", job)

    def delete(self, job: JobLike) -> Job:
        """Removes a job that has ended, with its images on the farm; returns it as it was."""
        return self._change("DeleteJob", job)

    def events(self, job: JobLike) -> list[JobEvent]:
        """Everything that happened to the job, oldest first."""
        request = job_pb2.ListJobEventsRequest(name=self._name(job))
        return list(map(event_from, self._unary("ListJobEvents", request).events))

    def pin(self, job: JobLike) -> Job:
        """Keeps all data of the job, however full the coordinator's disk is, until unpin()."""
        return self._change("PinJob", job)

    def unpin(self, job: JobLike) -> Job:
        return self._change("UnpinJob", job)

    def release(self, job: JobLike) -> Job:
        """Releases a job from its dependencies, whatever their state."""
        return self._change("ReleaseJob", job)

    def approve(self, job: JobLike, frames: Sequence[int] = ()) -> Job:
        """Renders frames to the end that wait for approval; by default all that wait."""
        return self._change("ApproveFrames", job, frame_numbers=list(frames))

    def retry(self, job: JobLike, *, frame: int | None = None, task: int | None = None) -> Job:
        """Retries the failed work of the job, of one frame, or of one task of a frame."""
        return self._change("RetryTasks", job, frame_number=frame, task=task)

    def kill(self, job: JobLike, frame: int, *, task: int | None = None) -> Job:
        """Gives up a frame or a task of it; the rest of the job continues."""
        return self._change("KillTasks", job, frame_number=frame, task=task)

    def set_priority(self, job: JobLike, priority: int) -> Job:
        """From -1000 to 1000; higher goes first."""
        _check_priority(priority)
        return self._change("SetJobPriority", job, priority=priority)

    def refine(self, job: JobLike, *, samples: int | None = None,
               target_error: float | None = None, time_seconds: float | None = None,
               cpu_seconds: float | None = None, certified: bool = False) -> Job:
        """Continues a job that has succeeded. Totals since its start: samples per pixel (with
        another limit: the maximum), relMSE, and for each frame wall time and CPU time. certified:
        the relMSE is compared with the certified bound.
        """
        stop = frame_pb2.StopRule()
        if target_error is not None:
            stop.target_error = target_error
        stop.certified = certified
        for seconds, field in ((time_seconds, "time_max"), (cpu_seconds, "cpu_max")):
            if seconds is not None:
                getattr(stop, field).CopyFrom(_duration(seconds))
        has_stop = stop != frame_pb2.StopRule()
        if not has_stop and not samples:
            raise errors.InvalidRequestError(
                "a refinement needs a limit; give samples, target_error, time_seconds or "
                "cpu_seconds")
        request = job_pb2.RefineJobRequest(name=self._name(job))
        request.sample_count = samples or STOPPED_SAMPLES_MAX
        if has_stop:
            request.stop.CopyFrom(stop)
        self._unary("RefineJob", request)
        return self.get_job(job)  # With its frames.

    def price_refinement(self, job: JobLike,
                         target_errors: Sequence[float]) -> list[RefinementPrice]:
        """The cost of refining the job to each of the errors, at most 32."""
        request = job_pb2.PriceRefinementRequest(name=self._name(job), target_errors=target_errors)
        return list(map(price_from, self._unary("PriceRefinement", request).prices))

    def list_workers(self) -> list[Worker]:
        response = self._unary("ListWorkers", farm_pb2.ListWorkersRequest())
        return list(map(worker_from, response.workers))

    def share_weights(self) -> dict[str, float]:
        """The weights that operators have set, by "user:NAME" or "show:NAME"; others are 1."""
        response = self._unary("ListShares", farm_pb2.ListSharesRequest())
        return {share.subject: share.weight for share in response.shares if share.is_set}

    def drain(self, workers: Sequence[str], *, then_exit: bool = False) -> list[Worker]:
        """The workers finish their leases and get no new ones until undrain(). then_exit: they
        end after that. workers: names as in Worker.name.
        """
        request = farm_pb2.DrainWorkersRequest(names=list(workers), then_exit=then_exit)
        return list(map(worker_from, self._unary("DrainWorkers", request).workers))

    def undrain(self, workers: Sequence[str]) -> list[Worker]:
        """Undoes drain()."""
        request = farm_pb2.UndrainWorkersRequest(names=list(workers))
        return list(map(worker_from, self._unary("UndrainWorkers", request).workers))

    def lift_quarantine(self, identity: str) -> None:
        """Ends the quarantine of an identity (Worker.identity)."""
        self._unary("LiftQuarantine", farm_pb2.LiftQuarantineRequest(identity=identity))

    def image(self, job: JobLike, frame: int | None = None) -> Image:
        """The image of a complete frame. frame: its number; may be omitted if there is one."""
        with tempfile.TemporaryDirectory(prefix="sheaf-") as folder:
            path = os.path.join(folder, "image.exr")
            self.download(job, path, frame)
            return read_image(path)

    def download(self, job: JobLike, path: str | os.PathLike[str],
                 frame: int | None = None) -> None:
        """Writes the EXR of a complete frame, as a whole or not at all."""
        self._download(self._frame_of(job, frame).name, os.fspath(path))

    def _download(self, name: str, target: str) -> None:
        partial = f"{target}.{os.getpid()}.partial"
        try:
            with open(partial, "wb") as file:
                self._connection.call(lambda stub: _download(stub, name, file))
            os.replace(partial, target)
        except OSError as error:
            raise errors.FileError(f"{target}: cannot be written: {error.strerror}; choose another "
                                   "path") from error
        finally:
            with contextlib.suppress(FileNotFoundError):
                os.remove(partial)

    def _frame_of(self, job: JobLike, number: int | None) -> Frame:
        frames = self.get_job(job).frames
        found = [f for f in frames if number is None or f.number == number]
        if len(found) == 1:
            return found[0]
        known = ", ".join(str(f.number) for f in frames[:20]) + (" ..." if frames[20:] else "")
        if number is None:
            raise errors.InvalidRequestError(
                f"{job_name(job)}: has {len(frames)} frames; say which, by frame=: {known}")
        raise errors.NotFoundError(f"{job_name(job)}: has no frame {number}; it has {known}")

    def _change(self, verb: str, job: JobLike, **arguments: Any) -> Job:
        """Calls the verb, the name of a method; arguments that are None are left out."""
        request = getattr(job_pb2, verb + "Request")(name=self._name(job), **arguments)
        return job_from(self._unary(verb, request))

    def _unary(self, method: str, request: Any) -> Any:
        return self._connection.call(
            lambda stub: getattr(stub, method)(request, timeout=UNARY_SECONDS_MAX))

    def _open_watch(self, name: str, end: float | None) -> tuple[Any, job_view_pb2.Job | None]:
        """A stream of the job, and its first message."""
        def attempt(stub: Any) -> tuple[Any, job_view_pb2.Job | None]:
            timeout = WATCH_SECONDS_MAX
            if end is not None:
                timeout = min(timeout, max(0.001, end - time.monotonic()))
            messages = stub.WatchJob(job_pb2.WatchJobRequest(name=name, changes_only=True),
                                     timeout=timeout)
            return messages, next(messages, None)
        try:
            return self._connection.call(attempt, end)
        except errors.UnreachableError:
            self._check_end(name, end)
            raise

    @staticmethod
    def _check_end(name: str, end: float | None) -> None:
        if end is not None and time.monotonic() >= end:
            raise errors.WaitExpiredError(f"{name}: has not ended in time and continues; wait "
                                          "again, or cancel it")

    def _next(self, messages: Any) -> job_view_pb2.Job | None:
        """None at the end of the stream, also if it was interrupted and may be reopened."""
        try:
            message: job_view_pb2.Job | None = next(messages, None)
            return message
        except grpc.RpcError as failure:
            if (transient_wait(failure) is None
                    and failure.code() != grpc.StatusCode.DEADLINE_EXCEEDED):
                raise self._connection.error_of(failure) from None
            return None


def _check_identity(job: JobLike, found: Job) -> None:
    if isinstance(job, Job) and job.message.create_time != found.message.create_time:
        raise errors.NotFoundError(
            f"{found.name}: is another job now, created at {found.create_time:%Y-%m-%d %H:%M:%S}, "
            f"since the coordinator's state was replaced; the one of "
            f"{job.create_time:%Y-%m-%d %H:%M:%S} is no longer there: submit it again")


def frame_paths(pattern: str, numbers: Sequence[int]) -> list[str]:
    """The path of each frame's image. For several frames, the last run of # in the file's name is
    the number; for one, # is a letter unless there are several in a row.
    """
    folder, name = os.path.split(pattern)
    runs = [match for match in re.finditer("#+", name)
            if len(numbers) > 1 or numbers[:1] != [1] or len(match[0]) > 1]
    if not runs:
        if len(numbers) > 1:
            raise errors.InvalidRequestError(f"{pattern}: the job has {len(numbers)} frames; put "
                                             "#### where the number goes")
        return [pattern] * len(numbers)
    first, last = runs[-1].span()
    return [os.path.join(folder, f"{name[:first]}{number:0{last - first}d}{name[last:]}")
            for number in numbers]


def _missing(job: Job) -> str:
    """"; frames 3, 5 of 12 have no image", or nothing if there is one frame."""
    missing = [str(frame.number) for frame in job.frames if not frame.complete]
    if not missing:
        return ""
    if len(job.frames) == 1:
        return "; it has no image"
    shown = ", ".join(missing[:MISSING_SHOWN_MAX]) + (" ..." if missing[MISSING_SHOWN_MAX:] else "")
    are = "frame {} of {} has" if len(missing) == 1 else "frames {} of {} have"
    return f"; {are.format(shown, len(job.frames))} no image"


def _download(stub: Any, name: str, file: Any) -> None:
    file.seek(0)
    file.truncate()
    request = job_pb2.ReadFrameOutputRequest(name=name)
    messages = stub.ReadFrameOutput(request, timeout=DOWNLOAD_SECONDS_MAX)
    try:
        size = 0
        for message in messages:
            size += len(message.chunk)
            if size > IMAGE_BYTES_MAX:
                raise errors.LimitError(f"{name}: the image is larger than {IMAGE_BYTES_MAX} "
                                        "bytes; fetch it with sheaf watch")
            file.write(message.chunk)
        file.flush()
    finally:
        messages.cancel()


def _check_priority(priority: int) -> None:
    if not -1000 <= priority <= 1000:
        raise errors.InvalidRequestError(f"priority {priority}: is not from -1000 to 1000; choose "
                                         "one in that range")


def _duration(seconds: float) -> duration_pb2.Duration:
    if not 0 < seconds < 1e9:
        raise errors.InvalidRequestError(f"{seconds} seconds: is not a time from 0 to 1e9; give a "
                                         "positive one")
    whole = int(seconds)
    return duration_pb2.Duration(seconds=whole, nanos=int((seconds - whole) * 1e9))
