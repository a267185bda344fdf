# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Addresses of coordinators, "HOST:PORT" or "HOST", read as the program `sheaf` reads them; those
of several that share a farm with commas between them.
"""
from __future__ import annotations

import dataclasses
import ipaddress
import os
import re
import socket

from sheaf.errors import InvalidRequestError

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 7400
ADDRESSES_MAX = 8  # Coordinators of a farm.


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
    scheme = re.match(r"\w+://", text)
    if scheme:
        raise InvalidRequestError(
            f'address "{text}": is an address of the page or of a web server; leave out '
            f"{scheme[0]} and give the port of gRPC, {DEFAULT_PORT} unless --listen names another")
    match = re.fullmatch(r"(?:\[([0-9A-Fa-f:.%\w]+)\]|([^\[\]:]+))(?::(\d{1,5}))?", text)
    port = int(match[3] or DEFAULT_PORT) if match else 0
    if match is None or not 0 < port <= 65535:
        raise InvalidRequestError(
            f'address "{text}": is not HOST:PORT, with an IPv6 host in brackets and a port from 1 '
            "to 65535; write for example 127.0.0.1:7400")
    return Address(match[1] or match[2], port)


@dataclasses.dataclass(frozen=True)
class Addresses:
    """The coordinators of a farm. One serves; the others refuse connections until they take
    over.
    """
    each: tuple[Address, ...]  # At least one.

    def __str__(self) -> str:
        return ",".join(map(str, self.each))

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches them."""
        return all(address.is_loopback for address in self.each)

    def target(self) -> str:
        """The target of a gRPC channel. A list may only have numeric addresses, so several names
        are resolved now; unknown ones are left out.
        """
        if len(self.each) == 1:
            return str(self.each[0])
        hosts = [(found, address.port) for address in self.each
                 if any((found := _resolve(address.host)).values())]
        if not hosts:
            return str(self.each[0])  # gRPC says what is wrong.
        # A list is of one family. An IPv4 address can be written as one of IPv6.
        if all(found[socket.AF_INET] for found, _ in hosts):
            return "ipv4:" + ",".join(f"{f[socket.AF_INET]}:{port}" for f, port in hosts)
        return "ipv6:" + ",".join(
            f"[{f[socket.AF_INET6] or '::ffff:' + f[socket.AF_INET]}]:{port}" for f, port in hosts)


def _resolve(host: str) -> dict[socket.AddressFamily, str]:
    """The first numeric address of each family; "" where there is none."""
    found = {socket.AF_INET: "", socket.AF_INET6: ""}
    try:
        for family, _, _, _, address in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM):
            if family in found:
                found[family] = found[family] or str(address[0])
    except OSError:
        pass
    return found


def coordinator_addresses(text: str | None) -> Addresses:
    """The given addresses, otherwise those of the environment, otherwise loopback. Raises
    InvalidRequestError.
    """
    text = text or os.environ.get("SHEAF_COORDINATOR") or f"{DEFAULT_HOST}:{DEFAULT_PORT}"
    parts = text.split(",")
    if len(parts) > ADDRESSES_MAX:
        raise InvalidRequestError(
            f'addresses "{text}": a farm has at most {ADDRESSES_MAX} coordinators; name fewer')
    return Addresses(tuple(map(parse_address, parts)))
