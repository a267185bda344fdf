# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A folder of files that are named by their content: a file that exists is not written again."""
import contextlib
import hashlib
import json
import os
import pathlib
import secrets
import shutil

CONTENT_BYTES_MAX = 20 << 30  # Limit of prune(); the files used last stay.
REMEMBERED_FILES_MAX = 20000
DIGEST_BYTES = 16
_CHUNK_BYTES = 1 << 20


class ContentFolder:
    """root/ab/abcd....suffix. One export at a time writes; readers see whole files only."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.root.mkdir(parents=True, exist_ok=True)
        self.written = 0  # Files that this object wrote,
        self.kept = 0     # and files that were there already.
        self._index_path = self.root / "known-files.json"
        self._known = self._read_index()

    def put(self, chunks, suffix, source=None):
        """Stores bytes, given as a list of buffers. Returns the absolute path.

        source: buffers that stand for the bytes, where these may differ in ways that do not count.
        """
        digest = hashlib.blake2b(digest_size=DIGEST_BYTES)
        for chunk in chunks if source is None else source:
            digest.update(chunk)
        return self.put_named(digest.hexdigest(), suffix,
                              lambda file: [file.write(chunk) for chunk in chunks])

    def put_named(self, name, suffix, write):
        """Stores what write(file) writes under a name that stands for its content."""
        path = self.root / name[:2] / (name + suffix)
        if path.exists():
            os.utime(path)  # prune() goes by the time of use.
            self.kept += 1
            return str(path)
        path.parent.mkdir(exist_ok=True)
        # Not tempfile.mkstemp: colleagues may read what the umask lets them.
        partial = path.parent / f".partial-{secrets.token_hex(8)}"
        try:
            with open(partial, "xb") as file:
                write(file)
            os.replace(partial, path)
        except BaseException:
            with contextlib.suppress(FileNotFoundError):
                os.remove(partial)
            raise
        self.written += 1
        return str(path)

    def put_file(self, source):
        """Stores a copy of a file. A file of the same place, size and time is not read again.

        Raises OSError.
        """
        source = os.path.abspath(source)
        state = os.stat(source)
        key = f"{source} {state.st_size} {state.st_mtime_ns}"
        suffix = pathlib.Path(source).suffix.lower()
        name = self._known.get(key)
        if name is None:
            digest = hashlib.blake2b(digest_size=DIGEST_BYTES)
            with open(source, "rb") as file:
                while chunk := file.read(_CHUNK_BYTES):
                    digest.update(chunk)
            name = digest.hexdigest()
        path = self.put_named(name, suffix, lambda file: self._copy(source, file))
        self._remember(key, name)
        return path

    def find(self, name, suffix):
        """The path of put_named(name, suffix), or None."""
        path = self.root / name[:2] / (name + suffix)
        return self.put_named(name, suffix, None) if path.exists() else None

    def prune(self, bytes_max=CONTENT_BYTES_MAX):
        """Removes the files that were not used for the longest, until bytes_max are left."""
        files = sorted(((path.stat().st_mtime_ns, path.stat().st_size, path)
                        for path in self.root.glob("??/*") if path.is_file()), reverse=True)
        total = 0
        for _, size, path in files:
            total += size
            if total > bytes_max:
                path.unlink()

    @staticmethod
    def _copy(source, file):
        with open(source, "rb") as original:
            shutil.copyfileobj(original, file, _CHUNK_BYTES)

    def _read_index(self):
        try:
            known = json.loads(self._index_path.read_text("utf-8"))
            return known if isinstance(known, dict) else {}
        except (OSError, ValueError):
            return {}

    def _remember(self, key, name):
        if self._known.get(key) == name:
            return
        self._known[key] = name
        while len(self._known) > REMEMBERED_FILES_MAX:
            del self._known[next(iter(self._known))]
        partial = self._index_path.with_suffix(f".{os.getpid()}.partial")
        partial.write_text(json.dumps(self._known), "utf-8")
        os.replace(partial, self._index_path)
