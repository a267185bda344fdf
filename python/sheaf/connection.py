# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The connection of a client: makes calls, repeats those that fail in passing, and turns the rest
into exceptions.
"""
from __future__ import annotations

import os
import random
import re
import threading
import time
from typing import Any, Callable, TypeVar

import grpc

from sheaf import errors
from sheaf.address import Addresses
from sheaf.credentials import Credentials, find_credentials, open_channel, renew_if_old
from sheaf.programs import LOG

try:
    from sheaf.v1 import job_pb2_grpc
except ModuleNotFoundError as error:
    if not (error.name or "").startswith("sheaf"):
        raise
    raise ImportError("sheaf: the messages of proto/sheaf/v1 are not generated, because the "
                      "package is used from its source; install it: see python/README.md"
                      ) from error

UNARY_SECONDS_MAX = 60
# How long calls are repeated before and after the coordinator's first answer.
FIRST_ANSWER_SECONDS = 4
LATER_ANSWER_SECONDS = 15 * 60
BACKOFF_SECONDS_MIN, BACKOFF_SECONDS_MAX = 0.1, 5.0
RETRY_AFTER_SECONDS_MAX = 3600  # A longer wait is not taken from a message.
CERTIFICATE_CHECK_SECONDS = 600

# Fragments of gRPC's messages about a connection, and their plain words.
_PLAIN_WORDS = (
    ("Connection refused", "the connection was refused"),
    ("No route to host", "it is unreachable"),
    ("Network is unreachable", "it is unreachable"),
    ("DNS resolution failed", "its name is unknown"),
    ("Deadline Exceeded", "no answer in time"),
    ("failed to connect to all addresses", "there is no connection"),
)
_ERRORS_BY_CODE = {
    grpc.StatusCode.UNAUTHENTICATED: errors.NotLoggedInError,
    grpc.StatusCode.PERMISSION_DENIED: errors.NotPermittedError,
    grpc.StatusCode.NOT_FOUND: errors.NotFoundError,
    grpc.StatusCode.INVALID_ARGUMENT: errors.InvalidRequestError,
    grpc.StatusCode.OUT_OF_RANGE: errors.InvalidRequestError,
    grpc.StatusCode.FAILED_PRECONDITION: errors.WrongStateError,
    grpc.StatusCode.RESOURCE_EXHAUSTED: errors.LimitError,
}

Result = TypeVar("Result")


def transient_wait(failure: grpc.RpcError) -> float | None:
    """The least seconds after which the call may succeed; None if it will not by itself."""
    code = failure.code()
    if code == grpc.StatusCode.UNAVAILABLE:
        return 0.0
    if code == grpc.StatusCode.RESOURCE_EXHAUSTED:
        asked = re.search(r"; retry after ([0-9.]+) s$", failure.details() or "")
        if asked and 0 < float(asked[1]) <= RETRY_AFTER_SECONDS_MAX:
            return float(asked[1])
    return None


class Connection:
    """May be used by several threads."""

    def __init__(self, address: Addresses, insecure: bool,
                 programs: str | os.PathLike[str] | None,
                 answer_seconds: float | None = None) -> None:
        self.address, self.insecure, self.programs = address, insecure, programs
        self._answer_seconds = answer_seconds
        self._lock = threading.Lock()
        self._answered = False
        self._credentials: Credentials | None = None
        self._channel: Any = None
        self._stub: Any = None
        self._closed = False
        self._checked = 0.0
        with self._lock:
            self._open()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._channel is not None:
                self._channel.close()

    def call(self, attempt: Callable[[Any], Result], end: float | None = None) -> Result:
        """Calls attempt with the stub of JobService, again while it fails in passing.

        end: by time.monotonic(), no attempt begins later.
        """
        repeated_for: float = LATER_ANSWER_SECONDS if self._answered else FIRST_ANSWER_SECONDS
        if self._answer_seconds is not None:
            repeated_for = self._answer_seconds
        limit = time.monotonic() + repeated_for
        limit = limit if end is None else min(limit, end)
        backoff, told, reopened = BACKOFF_SECONDS_MIN, False, False
        while True:
            try:
                result = attempt(self._present_stub())
                self._answered = True
                return result
            except grpc.RpcError as failure:
                if (failure.code() == grpc.StatusCode.UNAUTHENTICATED and not reopened
                        and self._reopen_if_changed()):
                    reopened = True
                    continue
                least = transient_wait(failure)
                wait = max(least or 0.0, backoff * random.uniform(0.5, 1))
                if least is None or time.monotonic() + wait > limit:
                    raise self.error_of(failure) from None
                if self._answered and not told:
                    LOG.warning("the coordinator at %s does not answer or lets calls wait (%s); "
                                "trying again", self.address, _plain(failure))
                    told = True
            time.sleep(wait)
            backoff = min(2 * backoff, BACKOFF_SECONDS_MAX)

    def error_of(self, failure: grpc.RpcError) -> errors.SheafError:
        if failure.code() in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED):
            return errors.UnreachableError(
                f"no coordinator answers at {self.address}: {_plain(failure)}; start one with "
                "sheaf-coordinator, or give another address")
        kind = _ERRORS_BY_CODE.get(failure.code(), errors.CoordinatorError)
        return kind(failure.details() or f"{self.address} refused the call without a reason "
                    f"({failure.code()}); see the coordinator's log")

    def _present_stub(self) -> Any:
        with self._lock:
            if self._closed:
                raise errors.InvalidRequestError(
                    f"the client of {self.address} is closed; connect again")
            if (self._credentials is not None
                    and time.monotonic() - self._checked > CERTIFICATE_CHECK_SECONDS):
                self._open()
            return self._stub

    def _open(self) -> None:
        """Opens the channel, or opens it again if the certificate has changed."""
        found = find_credentials(self.address)
        if found is not None:
            renew_if_old(self.address, found, self.programs)
            found = find_credentials(self.address)
        self._checked = time.monotonic()
        if self._channel is not None:
            if found == self._credentials:
                return
            # Calls under way keep the old channel alive until they end.
        self._channel = open_channel(self.address, found, self.insecure)
        self._credentials = found
        self._stub = job_pb2_grpc.JobServiceStub(self._channel)

    def _reopen_if_changed(self) -> bool:
        """Whether there is a newer certificate, as after a login elsewhere."""
        with self._lock:
            before = self._stub
            self._open()
            return self._stub is not before


def _plain(failure: grpc.RpcError) -> str:
    details = failure.details() or ""
    return next((words for part, words in _PLAIN_WORDS if part in details), details)
