# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs the program `sheaf`, reads its JSON, and ends it in an orderly way."""
import json
import math
import os
import queue
import shutil
import signal
import subprocess
import threading

LINES_MAX = 10000       # That wait to be read; a program that says more waits.
NOTES_MAX = 200         # Kept of what it says besides.
SHORT_CALL_SECONDS = 60
END_SECONDS = 30        # For a program to end after SIGINT, before it is killed.
_ENDED_STATES = ("succeeded", "failed", "cancelled")


class SheafError(Exception):
    """What, why and what to do, in one line."""


def find_program(folder):
    """The path of `sheaf`: in the folder, or in PATH if it is empty. Raises SheafError."""
    path = shutil.which("sheaf", path=folder or None)
    if path is None:
        raise SheafError(f"there is no program sheaf in {folder or 'PATH'}; build or install "
                         "Sheaf, and name the folder of its programs in Edit > Preferences > "
                         "Add-ons > Sheaf")
    return path


def address_arguments(address, insecure):
    """Options of the farm's commands; without an address, `sheaf` chooses as always."""
    return (["--coordinator", address] if address else []) + (["--insecure"] if insecure else [])


class Message:
    """A line of standard error: severity is "info", "note", "warning" or "error"."""

    def __init__(self, line):
        try:
            parsed = json.loads(line)
            self.severity, self.text = str(parsed["severity"]), str(parsed["message"])
        except (ValueError, TypeError, KeyError):
            self.severity, self.text = "note", line.strip()


class Process:
    """A command of `sheaf` that runs beside us. One thread uses it."""

    def __init__(self, program, arguments, folder=None):
        self._lines = queue.Queue(LINES_MAX)
        self.messages = []
        self._process = subprocess.Popen(
            [program, *arguments, "--json"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, encoding="utf-8", errors="replace", cwd=folder,
            start_new_session=True)  # Ctrl-C in a terminal is ours to pass on.
        self._threads = [threading.Thread(target=self._read, args=(stream, is_error), daemon=True)
                         for stream, is_error in ((self._process.stdout, False),
                                                  (self._process.stderr, True))]
        for thread in self._threads:
            thread.start()

    def _read(self, stream, is_error):
        for line in stream:
            self._lines.put((is_error, line))

    def read(self):
        """The JSON objects that were printed since the last call; notes go to `messages`."""
        found = []
        while True:
            try:
                is_error, line = self._lines.get_nowait()
            except queue.Empty:
                return found
            if is_error:
                self._note(line)
                continue
            try:
                found.append(json.loads(line))
            except ValueError:
                continue

    def _note(self, line):
        """Errors are kept, however many messages came before."""
        message = Message(line)
        if message.text and (len(self.messages) < NOTES_MAX or message.severity == "error"):
            self.messages.append(message)

    @property
    def exit_code(self):
        """None while it runs, or while its output is not fully read."""
        code = self._process.poll()
        if code is None or any(thread.is_alive() for thread in self._threads):
            return None
        return code if self._lines.empty() else None

    def interrupt(self):
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def end(self):
        """Interrupts it, waits, and kills it if it does not end."""
        self.interrupt()
        try:
            self._process.wait(END_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def failure(self):
        """The program's message about its failure."""
        errors = [m.text for m in self.messages if m.severity == "error"]
        errors = errors or [m.text for m in self.messages[-3:]]
        return "; ".join(errors) or f"sheaf ended with code {self._process.returncode}"


def call(program, arguments, as_json=True):
    """Runs a short command. Returns what it printed. Raises SheafError in its words."""
    try:
        done = subprocess.run([program, *arguments, *(["--json"] if as_json else [])],
                              stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8",
                              errors="replace", timeout=SHORT_CALL_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise SheafError(f"sheaf {arguments[0]} did not end within {SHORT_CALL_SECONDS} s; run it "
                         "in a terminal to see why") from None
    except OSError as error:
        raise SheafError(f"{program}: cannot be run: {error.strerror}; check the folder of "
                         "programs in the preferences") from error
    if done.returncode != 0:
        words = [Message(line) for line in done.stderr.splitlines() if line.strip()]
        errors = [m.text for m in words if m.severity == "error"] or [m.text for m in words[-3:]]
        raise SheafError("; ".join(errors) or f"sheaf {arguments[0]} ended with code "
                                              f"{done.returncode}")
    return done.stdout


def cancel(program, job, address, insecure):
    """Cancels a job; a job that has ended is left as it is."""
    call(program, ["cancel", job, *address_arguments(address, insecure)])


def unfinished_jobs(program, title, address, insecure):
    """Names of the jobs with this title that have not ended."""
    listed = call(program, ["list", *address_arguments(address, insecure)])
    names = []
    for line in listed.splitlines():
        parsed = json.loads(line)
        for job in parsed.get("jobs", [parsed]) if isinstance(parsed, dict) else parsed:
            if job.get("title") == title and job.get("state") not in _ENDED_STATES:
                names.append(job["name"])
    return names


def progress_text(job):
    progress = job["progress"]
    total = progress["sample_count_total"]
    fraction = progress["sample_count_done"] / total if total else 0.0
    text = f"{job['name']}: {100 * fraction:.0f} %"
    if progress.get("relative_mse") is not None:
        text += f", error ±{100 * math.sqrt(progress['relative_mse']):.2g} %"
    if progress.get("remaining_duration_seconds"):
        text += f", {progress['remaining_duration_seconds']:.0f} s left"
    if job.get("waiting_reason"):
        text += f" ({job['waiting_reason']})"
    return fraction, text


def default_program_folder():
    return os.environ.get("SHEAF_BIN", "")
