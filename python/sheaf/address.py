# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Addresses of coordinators, "HOST:PORT" or "HOST", read as the program `sheaf` reads them."""
from __future__ import annotations

import dataclasses
import ipaddress
import os
import re

from sheaf.errors import InvalidRequestError

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 7400


@dataclasses.dataclass(frozen=True)
class Address:
    host: str  # IPv6 literals without their brackets.
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches it. Names are not resolved, except "localhost"."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


def parse_address(text: str) -> Address:
    """Raises InvalidRequestError."""
    match = re.fullmatch(r"(?:\[([0-9A-Fa-f:.%\w]+)\]|([^\[\]:]+))(?::(\d{1,5}))?", text)
    port = int(match[3] or DEFAULT_PORT) if match else 0
    if match is None or not 0 < port <= 65535:
        raise InvalidRequestError(
            f'address "{text}": is not HOST:PORT, with an IPv6 host in brackets and a port from 1 '
            "to 65535; write for example 127.0.0.1:7400")
    return Address(match[1] or match[2], port)


def coordinator_address(text: str | None) -> Address:
    """The given address, otherwise that of the environment, otherwise loopback."""
    text = text or os.environ.get("SHEAF_COORDINATOR") or f"{DEFAULT_HOST}:{DEFAULT_PORT}"
    return parse_address(text)
