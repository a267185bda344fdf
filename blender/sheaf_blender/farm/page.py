# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The image so far, from the coordinator's page: /api/v1/jobs/N/frames/F/preview.png?layer=light.

A coordinator with certificates wants a session: `sheaf page` gives a token as the user that
`sheaf login` has stored, and the page's certificate is verified by the farm's own authority.
"""
import http.client
import os
import pathlib
import ssl
import urllib.parse

from . import images, program

TIMEOUT_SECONDS = 10
PREVIEW_BYTES_MAX = 256 << 20
HTTP_PORT_DEFAULT = 7480
COORDINATORS_MAX = 1000  # Folders of certificates that are read.


def with_default_port(address, port):
    host = address.rpartition(":")[0] if has_port(address) else address
    return f"{host}:{port}"


def has_port(address):
    return address.rpartition(":")[2].isdigit() and (address.count(":") == 1 or "]:" in address)


def authority_file(address):
    """The certificate of the farm's authority that `sheaf login` stored, or None."""
    base = os.environ.get("XDG_CONFIG_HOME", "")
    root = pathlib.Path(base) if base.startswith("/") else pathlib.Path.home() / ".config"
    wanted = {address, address if has_port(address) else address + ":7400"}
    try:
        folders = sorted((root / "sheaf" / "coordinators").iterdir())[:COORDINATORS_MAX]
    except OSError:
        return None
    for folder in folders:
        try:
            if wanted & set((folder / "addresses").read_text("utf-8").splitlines()):
                return folder / "authority.pem"
        except OSError:
            continue
    return None


class Page:
    """Fetches previews. After the first failure it stays silent: `problem` says why."""

    def __init__(self, url, authority=None, token=None):
        parsed = urllib.parse.urlsplit(url)
        self._host, self._is_tls = parsed.netloc, parsed.scheme == "https"
        self._context = None
        if self._is_tls:
            self._context = ssl.create_default_context(cafile=authority and str(authority))
        self._cookie = None
        self._token = token
        self.problem = ""

    @classmethod
    def of_farm(cls, sheaf, address, insecure, http_port):
        """The page of a coordinator: with a session where it has certificates."""
        plain = address or os.environ.get("SHEAF_COORDINATOR") or "127.0.0.1:7400"
        authority = authority_file(plain)
        if authority is None:
            return cls("http://" + with_default_port(plain, http_port or HTTP_PORT_DEFAULT))
        answer = program.call(sheaf, ["page", *program.address_arguments(address, insecure)],
                              as_json=False).split()
        return cls(answer[0], authority, answer[1])

    def preview(self, job, frame_number):
        """Linear pixels (height, width, 3), rows from the top; None if there are none yet."""
        if self.problem:
            return None
        path = (f"/api/v1/jobs/{job.rpartition('/')[2]}/frames/{frame_number}"
                "/preview.png?layer=light")
        try:
            if self._token is not None:
                self._sign_in()
            status, body, _ = self._request("GET", path)
        except (OSError, http.client.HTTPException, program.SheafError) as error:
            self.problem = (f"tiles are not shown: the page at {self._host} does not answer "
                            f"({error}); give its port in the add-on's preferences")
            return None
        if status in (401, 403):
            self.problem = f"tiles are not shown: the page at {self._host} refuses ({status})"
        if status != 200:
            return None
        return images.decode_light(body)

    def _sign_in(self):
        token, self._token = self._token, None
        body = urllib.parse.urlencode({"token": token})
        status, _, headers = self._request(
            "POST", "/login", body, {"Content-Type": "application/x-www-form-urlencoded"})
        cookie = headers.get("Set-Cookie", "").partition(";")[0]
        if not cookie:
            raise program.SheafError(f"it refuses the token of sheaf page ({status})")
        self._cookie = cookie

    def _request(self, method, path, body=None, headers=None):
        make = (http.client.HTTPConnection if not self._is_tls else
                lambda host, timeout: http.client.HTTPSConnection(host, timeout=timeout,
                                                                  context=self._context))
        connection = make(self._host, timeout=TIMEOUT_SECONDS)
        try:
            connection.request(method, path, body, {**({"Cookie": self._cookie} if self._cookie
                                                       else {}), **(headers or {})})
            response = connection.getresponse()
            return response.status, response.read(PREVIEW_BYTES_MAX), response.headers
        finally:
            connection.close()
