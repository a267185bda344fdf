# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""`sheaf view`: a process that keeps a scene and gives images of it from any side. Needs no
Blender; docs/viewing.md has the protocol.
"""
import atexit
import dataclasses
import json
import subprocess
import threading
import weakref

import numpy

from .program import NOTES_MAX, Message, SheafError

_RUNNING = weakref.WeakSet()  # Their threads must not be left to the end of the interpreter.
END_SECONDS = 2  # For the process to end after its input, before it is killed.


@dataclasses.dataclass(frozen=True)
class Frame:
    """An image of a request. pixels: (height, width, 4) float32, linear, rows from the top; place:
    x0, y0, x1, y1 in pixels of the film; divisor: pixels of the film for one of the image, along
    each side.
    """
    id: int
    pixels: object
    place: tuple
    film: tuple
    divisor: int
    samples: int
    is_complete: bool


class ViewProcess:
    """One thread uses it; reading is done by threads of its own. Raises SheafError if the program
    cannot be started.
    """

    def __init__(self, sheaf, threads=0):
        try:
            self._process = subprocess.Popen(
                [sheaf, "view", "--json", "--threads", str(threads)], stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
        except OSError as error:
            raise SheafError(f"{sheaf}: cannot be run: {error.strerror}; check the folder of "
                             "programs in the preferences") from error
        self._lock = threading.Lock()
        self._frame, self._is_new = None, False
        self._problem = ""
        self._messages = []
        self._wanted = 0       # The id of the last request.
        self.load_seconds = None  # For the last scene.
        self._threads = [threading.Thread(target=work, daemon=True)
                         for work in (self._read, self._read_messages)]
        for thread in self._threads:
            thread.start()
        _RUNNING.add(self)

    @property
    def is_alive(self):
        return self._process.poll() is None

    @property
    def problem(self):
        """Why the last request has no image; empty if nothing is known against it."""
        with self._lock:
            if self._problem:
                return self._problem
        if self.is_alive:
            return ""
        for thread in self._threads:
            thread.join(END_SECONDS)
        with self._lock:
            errors = [m.text for m in self._messages if m.severity == "error"]
            said = errors or [m.text for m in self._messages[-3:]]
        return "; ".join(said) or f"sheaf view ended with code {self._process.returncode}"

    def ask(self, scene="", camera=""):
        """Asks for images; those of older requests are no longer made. scene: the path of a file,
        to load it; camera: directives. Returns the request's id. Raises SheafError.
        """
        with self._lock:
            self._wanted += 1
            wanted, self._problem = self._wanted, ""
        request = {"id": wanted, **({"scene": scene} if scene else {}),
                   **({"camera": camera} if camera else {})}
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except (OSError, ValueError) as error:  # ValueError: closed by end().
            raise SheafError(self.problem or f"sheaf view does not listen: {error}") from error
        return wanted

    def take(self):
        """The newest Frame, if there is one since the last call; else None."""
        with self._lock:
            frame, is_new = self._frame, self._is_new
            self._is_new = False
        return frame if is_new else None

    @property
    def has_news(self):
        with self._lock:
            return self._is_new

    def end(self):
        """Ends the process, without waiting for it."""
        try:
            self._process.stdin.close()
        except OSError:
            pass
        _RUNNING.discard(self)
        threading.Thread(target=self._wait_or_kill, daemon=True).start()

    def _wait_or_kill(self):
        try:
            self._process.wait(END_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def kill(self):
        """Ends the process and the threads that read from it."""
        self._process.kill()
        self._process.wait()
        for thread in self._threads:
            thread.join(END_SECONDS)

    def _read(self):
        stream = self._process.stdout
        for line in stream:
            try:
                self._take_answer(json.loads(line), stream)
            except (ValueError, KeyError, TypeError) as error:
                with self._lock:
                    self._problem = f"sheaf view does not fit the add-on: {error}"
                self._process.kill()
                return

    def _take_answer(self, answer, stream):
        frame = _frame_of(answer, stream) if "image" in answer else None
        with self._lock:
            if frame is not None:
                self._frame, self._is_new = frame, True
            elif "loaded" in answer:
                self.load_seconds = answer["loaded"]["seconds"]
            elif answer["id"] == self._wanted:
                self._problem, self._is_new = answer["error"], self._frame is not None

    def _read_messages(self):
        for line in self._process.stderr:
            message = Message(line.decode("utf-8", "replace"))
            with self._lock:
                if message.text and (len(self._messages) < NOTES_MAX
                                     or message.severity == "error"):
                    self._messages.append(message)


def _frame_of(answer, stream):
    said = answer["image"]
    width, height, count = said["width"], said["height"], said["byte_count"]
    if count != 16 * width * height:
        raise ValueError("an image has another size than it says")
    read = stream.read(count)
    if len(read) != count:
        raise ValueError("an image is cut off")
    pixels = numpy.frombuffer(read, numpy.float32).reshape(height, width, 4)
    place = said["x0"], said["y0"], said["x1"], said["y1"]
    return Frame(answer["id"], pixels, place, (said["film_width"], said["film_height"]),
                 (place[2] - place[0]) // width, said["samples"], said["complete"])


@atexit.register
def _kill_all():
    for process in list(_RUNNING):
        process.kill()
