# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A proxy before an S3 server that causes faults: statuses, broken and slow connections, bodies
that are cut or altered. It passes requests on as they are, so that their signatures stay good.
"""
import http.client
import http.server
import random
import socket
import struct
import threading
import time

BODY_BYTES_MAX = 1 << 30
ERROR = ("<?xml version=\"1.0\"?><Error><Code>{}</Code>"
         "<Message>the test wants it</Message></Error>")


class FaultyProxy:
    """Use with `with`. `fault` is None or one of the names in `_cause`; each request meets it with
    the probability `share`. `counts`: how often each was caused.
    """

    def __init__(self, port):
        self.target = ("127.0.0.1", port)
        self.fault = None
        self.share = 1.0
        self.delay_seconds = 0.0
        self.counts = {}
        self._random = random.Random(1)
        self._lock = threading.Lock()
        proxy = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            timeout = 60

            def log_message(self, *_):
                pass

            def _serve(self):
                proxy._serve(self)

            do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = _serve

        class Server(http.server.ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, *_):
                pass  # Broken connections are what it is for.

        self._server = Server(("127.0.0.1", 0), Handler)
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._server.shutdown()
        self._server.server_close()

    def heal(self):
        self.fault, self.share, self.delay_seconds = None, 1.0, 0.0

    def _draw(self, handler):
        """The fault that this request meets. Lists are spared: a start needs them."""
        with self._lock:
            is_object = "list-type=" not in handler.path
            if not self.fault or not is_object or self._random.random() >= self.share:
                return None
            if self.fault in ("truncated", "altered") and handler.command != "GET":
                return None
            self.counts[self.fault] = self.counts.get(self.fault, 0) + 1
            return self.fault

    @staticmethod
    def _reset(handler):
        handler.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER,
                                      struct.pack("ii", 1, 0))
        handler.close_connection = True
        handler.connection.close()

    @staticmethod
    def _answer(handler, status, headers, body, sent=None):
        handler.send_response_only(status)
        for name, value in headers:
            if name.lower() not in ("content-length", "transfer-encoding", "connection"):
                handler.send_header(name, value)
        length = dict((n.lower(), v) for n, v in headers).get("content-length", len(body))
        handler.send_header("Content-Length",
                            length if handler.command == "HEAD" else len(body))
        handler.end_headers()
        if handler.command != "HEAD":
            handler.wfile.write(body if sent is None else sent)
        if sent is not None:
            handler.close_connection = True

    def _serve(self, handler):
        length = min(int(handler.headers.get("Content-Length") or 0), BODY_BYTES_MAX)
        body = handler.rfile.read(length)
        fault = self._draw(handler)
        time.sleep(self.delay_seconds)
        statuses = {"500": (500, "InternalError"), "503": (503, "SlowDown"),
                    "403": (403, "AccessDenied"), "full": (507, "InsufficientStorage")}
        if fault in statuses:
            status, code = statuses[fault]
            return self._answer(handler, status, [], ERROR.format(code).encode())
        if fault == "reset":
            return self._reset(handler)
        try:
            connection = http.client.HTTPConnection(*self.target, timeout=30)
            connection.putrequest(handler.command, handler.path, skip_host=True,
                                  skip_accept_encoding=True)
            for name, value in handler.headers.items():
                connection.putheader(name, value)
            connection.endheaders(body if body else None)
            response = connection.getresponse()
            answer, headers = response.read(), response.getheaders()
            connection.close()
        except OSError:
            return self._reset(handler)  # The server is gone, and so is this connection.
        if fault == "lost answer":
            return self._reset(handler)
        if fault == "truncated" and answer:
            return self._answer(handler, response.status, headers, answer,
                                sent=answer[:len(answer) // 2])
        if fault == "altered" and answer and response.status == 200:
            middle = len(answer) // 2
            answer = answer[:middle] + bytes([answer[middle] ^ 1]) + answer[middle + 1:]
        return self._answer(handler, response.status, headers, answer)
