# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A PostgreSQL server for tests, in a folder of its own; this program is its parent.

The server refuses to be root: then it runs as the user postgres.
"""
import glob
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time

START_SECONDS_MAX = 60


def programs():
    """The folder of the newest installed version's programs, or None."""
    found = glob.glob("/usr/lib/postgresql/*/bin")
    found = [f for f in found if os.path.exists(os.path.join(f, "initdb"))]
    return max(found, key=lambda f: int(f.split("/")[4]), default=None)


class Server:
    """Use with `with`. fsync: whether commits wait for the disk, as a real server's do. parent:
    where its folder is made."""

    def __init__(self, fsync=True, parent="/tmp"):
        self.programs = programs()
        # Paths of sockets are short.
        self.folder = tempfile.mkdtemp(prefix="sheaf-postgres-", dir=parent)
        self.settings = [] if fsync else ["-c", "fsync=off"]
        self.process = None

    def __enter__(self):
        if os.geteuid() == 0:
            user = pwd.getpwnam("postgres")
            os.chown(self.folder, user.pw_uid, user.pw_gid)
        subprocess.run([*self._as_user(), f"{self.programs}/initdb", "-D", self._data(), "-A",
                        "trust", "-U", "farm", "--no-locale", "-E", "UTF8", "--no-sync"],
                       check=True, stdout=subprocess.DEVNULL, cwd="/")
        self.start()
        return self

    def __exit__(self, *_):
        self.end(signal.SIGINT)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _as_user(self):
        if os.geteuid() != 0:
            return []
        return ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"]

    def _data(self):
        return os.path.join(self.folder, "data")

    @property
    def url(self):
        return f"postgresql://farm@/postgres?host={self.folder}"

    def start(self):
        with open(os.path.join(self.folder, "server.log"), "ab") as log:
            self.process = subprocess.Popen(
                [*self._as_user(), f"{self.programs}/postgres", "-D", self._data(), "-k",
                 self.folder, "-c", "listen_addresses=", *self.settings], stdout=log, stderr=log,
                cwd="/")
        end = time.monotonic() + START_SECONDS_MAX
        while True:
            try:
                self.rows("SELECT 1")
                return
            except subprocess.CalledProcessError:
                if self.process.poll() is not None or time.monotonic() > end:
                    raise
                time.sleep(0.05)

    def end(self, how):
        """SIGINT: in order; SIGQUIT: as a crash, so that the next start recovers."""
        if self.process and self.process.poll() is None:
            self.process.send_signal(how)
            self.process.wait()

    def rows(self, sql):
        """The rows of a query, as tuples of text."""
        done = subprocess.run([f"{self.programs}/psql", "-AtX", "-F", "\t", self.url, "-c", sql],
                              check=True, capture_output=True, text=True)
        return [tuple(line.split("\t")) for line in done.stdout.splitlines()]
