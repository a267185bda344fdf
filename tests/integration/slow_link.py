# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A slow link to a farm, for tests: a TCP proxy on loopback that delays all data.

A client observes the same delays as at that distance: a connection costs its round trip before the
first byte arrives, plus TLS's round trips if configured.
"""
import asyncio
import socket
import struct
import threading

CHUNK_BYTES_MAX = 1 << 16
CHUNKS_ON_THE_WAY_MAX = 256  # In one direction of one connection.


class SlowLink:
    """Listens at .address and forwards all data to target; use with `with`."""

    def __init__(self, target, round_trip_seconds, handshakes=0, bytes_per_second=None):
        """handshakes: round trips in addition to TCP's own before a connection carries data.

        bytes_per_second: of all connections together, in each direction.
        """
        self.host, _, self.port = target.rpartition(":")
        self.one_way = round_trip_seconds / 2
        # The connection request, its reply, and the first bytes after it.
        self.first_byte_seconds = (1.5 + handshakes) * round_trip_seconds
        self.bytes_per_second = bytes_per_second
        self.address = None
        self.connections = 0
        self.open = set()  # Writers of all connections.
        self.refusing = False
        self.lines = ()  # Upward and downward.
        self.flowing = None  # Whether data is forwarded.
        self.loop = asyncio.new_event_loop()
        self.ready = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self.thread.start()
        self.ready.wait()
        return self

    def __exit__(self, *_):
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join()

    def reset(self, refuse=False):
        """Resets all connections; refuse: and each new one until accept is called."""
        self.refusing = refuse
        self.loop.call_soon_threadsafe(self._reset_all)

    def accept(self):
        self.refusing = False

    def hold(self):
        """Forwards nothing until let_go is called."""
        self.loop.call_soon_threadsafe(self.flowing.clear)

    def let_go(self):
        self.loop.call_soon_threadsafe(self.flowing.set)

    def _reset_all(self):
        for writer in list(self.open):
            reset(writer)

    def _run(self):
        asyncio.set_event_loop(self.loop)
        server = self.loop.run_until_complete(
            asyncio.start_server(self._serve, "127.0.0.1", 0, backlog=1024))
        self.lines = (asyncio.Lock(), asyncio.Lock())
        self.flowing = asyncio.Event()
        self.flowing.set()
        self.address = "127.0.0.1:%d" % server.sockets[0].getsockname()[1]
        self.ready.set()
        self.loop.run_forever()
        server.close()
        tasks = asyncio.all_tasks(self.loop)
        for task in tasks:
            task.cancel()
        self.loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
        self.loop.run_until_complete(asyncio.sleep(0))  # Lets closed connections end.
        self.loop.close()

    async def _serve(self, client_reader, client_writer):
        self.connections += 1
        if self.refusing:
            reset(client_writer)
            return
        upward = asyncio.Queue(CHUNKS_ON_THE_WAY_MAX)
        first = self.loop.time() + self.first_byte_seconds
        tasks = [asyncio.create_task(self._receive(client_reader, upward, first, self.lines[0]))]
        writers = [client_writer]
        self.open.add(client_writer)
        try:
            await asyncio.sleep(self.first_byte_seconds)
            reader, writer = await asyncio.open_connection(self.host, int(self.port))
            writers.append(writer)
            self.open.add(writer)
            downward = asyncio.Queue(CHUNKS_ON_THE_WAY_MAX)
            tasks += [asyncio.create_task(self._receive(reader, downward, 0, self.lines[1])),
                      asyncio.create_task(self._deliver(upward, writer)),
                      asyncio.create_task(self._deliver(downward, client_writer))]
            await asyncio.gather(*tasks)
        except (OSError, asyncio.CancelledError):
            pass  # One side has closed, which closes the other one here, or the link ends.
        finally:
            for task in tasks:
                task.cancel()
            for writer in writers:
                self.open.discard(writer)
                writer.close()

    async def _receive(self, reader, queue, first, line):
        data = None
        while data != b"":
            data = await reader.read(CHUNK_BYTES_MAX)
            if self.bytes_per_second:
                async with line:  # Connections take turns.
                    await asyncio.sleep(len(data) / self.bytes_per_second)
            await self.flowing.wait()
            await queue.put((max(first, self.loop.time() + self.one_way), data))

    async def _deliver(self, queue, writer):
        while True:
            when, data = await queue.get()
            await asyncio.sleep(when - self.loop.time())
            if data == b"":
                writer.write_eof()
                return
            writer.write(data)
            await writer.drain()


def reset(writer):
    """Closes a connection so that the other side finds it reset."""
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER,
                                               struct.pack("ii", 1, 0))
    writer.transport.abort()
