# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The certificates that `sheaf login` has stored, and channels that use them.

A connection is encrypted where a certificate is stored for the address. Plain text is spoken on
loopback only, and not to a coordinator that speaks TLS.
"""
from __future__ import annotations

import dataclasses
import os
import pathlib
import socket
import ssl
import time

import grpc

from sheaf.address import Address, Addresses
from sheaf.errors import NotLoggedInError, SheafError
from sheaf.programs import LOG, run_sheaf
from sheaf.protocol import ProtocolInterceptor

MESSAGE_BYTES_MAX = 64 << 20  # As all programs of Sheaf.
TLS_PROBE_SECONDS = 2
COORDINATORS_MAX = 1000  # Folders that are read.
# Certificates of users last seven days; a renewal takes place from half of that on.
RENEW_AFTER_SECONDS = 3.5 * 86400
RENEW_SECONDS_MAX = 60

_CHANNEL_OPTIONS = [
    ("grpc.max_receive_message_length", MESSAGE_BYTES_MAX),
    ("grpc.max_send_message_length", MESSAGE_BYTES_MAX),
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 20_000),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 20_000),  # The limit of one attempt, despite its name.
    ("grpc.use_local_subchannel_pool", 1),
]
RECONNECT_BACKOFF_MS_MAX = 2_000
FOLLOW_BACKOFF_MS_MAX = 500  # With several addresses: a takeover lasts some seconds.


@dataclasses.dataclass(frozen=True)
class Credentials:
    """A user's key and certificate, and the only authority that may have issued the farm's."""
    certificate_path: pathlib.Path
    key: bytes = dataclasses.field(repr=False)
    certificate: bytes = dataclasses.field(repr=False)
    authority: bytes = dataclasses.field(repr=False)

    @property
    def age_seconds(self) -> float:
        return time.time() - self.certificate_path.stat().st_mtime


def credentials_folder() -> pathlib.Path:
    """Where `sheaf login` stores them: $XDG_CONFIG_HOME/sheaf/coordinators or ~/.config/..."""
    base = os.environ.get("XDG_CONFIG_HOME", "")
    root = pathlib.Path(base) if base.startswith("/") else pathlib.Path.home() / ".config"
    return root / "sheaf" / "coordinators"


def find_credentials(addresses: Addresses) -> Credentials | None:
    """Those for one of the addresses: coordinators of one farm have one authority. Raises
    NotLoggedInError if they cannot be read.
    """
    return next((found for each in addresses.each if (found := _find_for(each))), None)


def _find_for(address: Address) -> Credentials | None:
    try:
        folders = sorted(credentials_folder().iterdir())[:COORDINATORS_MAX]
    except OSError:
        return None
    for folder in folders:
        try:
            if str(address) not in (folder / "addresses").read_text("utf-8").splitlines():
                continue
        except OSError:
            continue
        try:
            return Credentials(folder / "certificate.pem", (folder / "key.pem").read_bytes(),
                               (folder / "certificate.pem").read_bytes(),
                               (folder / "authority.pem").read_bytes())
        except OSError as error:
            raise NotLoggedInError(f"the certificate for {address} cannot be read: {error}; run "
                                   f"sheaf login {address} again") from error
    return None


def renew_if_old(addresses: Addresses, credentials: Credentials,
                 programs: str | os.PathLike[str] | None) -> None:
    """Lets `sheaf`, which renews certificates at each call, make one, if the certificate is old.

    A renewal that fails is logged: the certificate may be good for days.
    """
    if credentials.age_seconds < RENEW_AFTER_SECONDS:
        return
    try:
        run_sheaf(["workers", "--coordinator", str(addresses)], programs,
                  RENEW_SECONDS_MAX)
    except SheafError as error:
        LOG.warning("the certificate for %s was not renewed, and ends seven days after it was "
                    "issued: %s", addresses, error)


def _speaks_tls(address: Address) -> bool:
    """Verifies no certificate and sends no data. False also if the server does not answer in
    time."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    context.set_alpn_protocols(["h2"])
    try:
        with socket.create_connection((address.host, address.port), TLS_PROBE_SECONDS) as plain:
            with context.wrap_socket(plain):
                return True
    except OSError:  # Includes ssl.SSLError and timeouts.
        return False


def _no_certificate(what: str, address: Address | Addresses, or_else: str = "") -> NotLoggedInError:
    return NotLoggedInError(f"{what} {address} is stored here; run sheaf login {address} with a "
                            f"token of sheaf-coordinator enroll user NAME{or_else}")


def _channel_options(addresses: Addresses) -> list[tuple[str, object]]:
    several = len(addresses.each) > 1
    options: list[tuple[str, object]] = [
        *_CHANNEL_OPTIONS, ("grpc.max_reconnect_backoff_ms",
                            FOLLOW_BACKOFF_MS_MAX if several else RECONNECT_BACKOFF_MS_MAX)]
    if several:
        # Coordinators that share a state directory have one certificate, with the names of all: it
        # is checked for the first of them, whichever is called.
        first = addresses.each[0].host
        options += [("grpc.ssl_target_name_override", first), ("grpc.default_authority", first)]
    return options


def open_channel(addresses: Addresses, credentials: Credentials | None,
                 insecure: bool) -> grpc.Channel:
    """Calls say the versions of the protocol (protocol.py). insecure: another machine may be
    reached in plain text. Raises NotLoggedInError.
    """
    return grpc.intercept_channel(_open_channel(addresses, credentials, insecure),
                                  ProtocolInterceptor())


def _open_channel(addresses: Addresses, credentials: Credentials | None,
                  insecure: bool) -> grpc.Channel:
    options = _channel_options(addresses)
    if credentials is not None:
        tls = grpc.ssl_channel_credentials(credentials.authority, credentials.key,
                                           credentials.certificate)
        return grpc.secure_channel(addresses.target(), tls, options)
    if not addresses.is_loopback and not insecure:
        raise _no_certificate("no certificate for the coordinator at", addresses,
                              ", or, for experiments on a network that you trust, connect without "
                              "encryption by insecure=True")
    if any(_speaks_tls(address) for address in addresses.each):
        raise _no_certificate("the coordinator speaks TLS, and no certificate for", addresses)
    if not addresses.is_loopback:
        LOG.warning("insecure: the connection to %s is neither encrypted nor authenticated",
                    addresses)
    return grpc.insecure_channel(addresses.target(), options)
