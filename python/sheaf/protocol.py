# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The version of the protocol in calls, as common/rpc/protocol_version.h says it: a client sends
the versions that it understands with every call, the coordinator answers with its own.
"""
from __future__ import annotations

import re
from typing import Any, Callable, Iterator, Tuple

import grpc

from sheaf import errors

PROTOCOL_VERSION = 1
OLDEST_PROTOCOL_VERSION = 1
PROTOCOL_KEY = "sheaf-protocol"

Range = Tuple[int, int]  # The oldest and the newest version that a program understands.


def parse_range(text: str) -> Range:
    """The range of "1-2"; 1 alone of "". Raises WrongStateError."""
    if not text:
        return 1, 1
    found = re.fullmatch("([0-9]{1,6})-([0-9]{1,6})", text)
    if not found or int(found[1]) > int(found[2]):
        raise errors.WrongStateError(
            f"{PROTOCOL_KEY}: {text[:40]!r} does not say which versions of Sheaf's protocol the "
            "coordinator understands; use programs of one release")
    return int(found[1]), int(found[2])


def _words(versions: Range) -> str:
    oldest, newest = versions
    return f"version {newest}" if oldest == newest else f"versions {oldest} to {newest}"


def check_answer(theirs: Range) -> None:
    """Raises WrongStateError if there is no version that both understand."""
    ours = OLDEST_PROTOCOL_VERSION, PROTOCOL_VERSION
    if min(ours[1], theirs[1]) >= max(ours[0], theirs[0]):
        return
    raise errors.WrongStateError(
        f"this package speaks {_words(ours)} of Sheaf's protocol, and the coordinator "
        f"{_words(theirs)}: " + (
            "this package is older; install that of the coordinator's release"
            if ours[1] < theirs[1] else
            "the coordinator's program is older; update it, or use the package of its release"))


def _check_metadata(metadata: Any) -> None:
    said = next((value for key, value in metadata or () if key == PROTOCOL_KEY), "")
    check_answer(parse_range(said))


class _CheckedStream:
    """The messages of a call, whose first one comes with the coordinator's versions."""

    def __init__(self, call: Any) -> None:
        self._call, self._checked = call, False

    def __iter__(self) -> Iterator[Any]:
        return self

    def __next__(self) -> Any:
        message = next(self._call)
        if not self._checked:
            _check_metadata(self._call.initial_metadata())
            self._checked = True
        return message

    def __getattr__(self, name: str) -> Any:
        return getattr(self._call, name)


class ProtocolInterceptor(grpc.UnaryUnaryClientInterceptor, grpc.UnaryStreamClientInterceptor):
    """Calls with one request, which are all that this package makes."""

    def intercept_unary_unary(self, continuation: Callable[[Any, Any], Any],
                              client_call_details: Any, request: Any) -> Any:
        call = continuation(_with_versions(client_call_details), request)
        if call.exception() is None:  # A refusal may come without metadata.
            _check_metadata(call.initial_metadata())
        return call

    def intercept_unary_stream(self, continuation: Callable[[Any, Any], Any],
                               client_call_details: Any, request: Any) -> Any:
        return _CheckedStream(continuation(_with_versions(client_call_details), request))


class _Details(grpc.ClientCallDetails):
    """gRPC's own cannot be changed."""

    def __init__(self, details: Any, metadata: list[tuple[str, str]]) -> None:
        self.method, self.timeout, self.metadata = details.method, details.timeout, metadata
        self.credentials, self.wait_for_ready = details.credentials, details.wait_for_ready
        self.compression = details.compression


def _with_versions(details: Any) -> _Details:
    ours = f"{OLDEST_PROTOCOL_VERSION}-{PROTOCOL_VERSION}"
    return _Details(details, [*(details.metadata or ()), (PROTOCOL_KEY, ours)])
