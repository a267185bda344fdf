#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Has clang check the annotations of mutexes (common/base/mutex.h): guarded members are touched
under their locks alone, and functions are called with the locks that they require.

Run from anywhere: tests/tidy/thread_safety_test.py. It needs clang++ and the headers that a build
generates from proto/, which it finds beside SHEAF_BIN (build/release/bin by default).
"""
import concurrent.futures
import functools
import itertools
import os
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOURCE_FOLDERS = ("common/", "worker/", "coordinator/", "cli/")
MUTEX = "common/base/mutex.h"  # The one door to the standard library's.
BIN = os.environ.get("SHEAF_BIN", os.path.join(ROOT, "build/release/bin"))
GENERATED = os.path.join(os.path.dirname(BIN), "proto", "gen")
FLAGS = ["-std=c++20", "-march=x86-64-v3", "-fsyntax-only", "-Wno-everything", "-Wthread-safety",
         "-Werror=thread-safety", "-I" + ROOT, "-I" + GENERATED, '-DSHEAF_VERSION=""']
# Sources that are read at a time, so that headers are read once for all of them.
JOINED_MAX = 24
# The short form checks what users run; --all the tests too.
ALL_TESTS = os.environ.get("SHEAF_ALL_TESTS", "") == "1"
CLANG = shutil.which("clang++")
# Headers that many sources include, read once.
PRECOMPILED = """#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "sheaf/v1/access.grpc.pb.h"
#include "sheaf/v1/content.grpc.pb.h"
#include "sheaf/v1/job.grpc.pb.h"
#include "sheaf/v1/peer.grpc.pb.h"
#include "sheaf/v1/transfer.grpc.pb.h"
#include "sheaf/v1/worker.grpc.pb.h"
#include "common/base/mutex.h"
#include "common/scene/scene_description.h"
#include "coordinator/core/job/job.h"
"""


def read(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as f:
        return f.read()


ANNOTATION = re.compile(r"\bMutexLock\b|ABSL_GUARDED_BY|ABSL_EXCLUSIVE_LOCKS_REQUIRED")


def annotated_classes(text):
    """Names of the classes that have guarded members, or functions that require locks."""
    parts = re.split(r"^(?:class|struct)(?: ABSL_\w+)? (?=\w+[^;]*\{)", text, flags=re.M)[1:]
    return {re.match(r"\w+", part).group() for part in parts if ANNOTATION.search(part)}


def sources_with_mutexes():
    """Those that lock something, or that name an annotated class of their folder."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT,
                            capture_output=True, text=True, check=True).stdout.splitlines()
    files = {f: read(f) for f in listed if f.startswith(SOURCE_FOLDERS)
             and f.endswith((".h", ".cc")) and os.path.exists(os.path.join(ROOT, f))}
    names = {}
    for path, text in files.items():
        if path.endswith(".h"):
            names.setdefault(os.path.dirname(path), set()).update(annotated_classes(text))

    def is_checked(path):
        text = files[path] + files.get(os.path.splitext(path)[0] + ".h", "")
        # clang 14 cannot compile coroutines of libstdc++ 12. Sources with coroutines hold no lock.
        if "co_await" in text and not ANNOTATION.search(text):
            return False
        of_folder = names.get(os.path.dirname(path))
        return bool(ANNOTATION.search(text) or not path.endswith("_test.cc") and of_folder
                    and re.search(r"\b(" + "|".join(of_folder) + r")\b", text))

    return sorted(f for f in files if f.endswith(".cc") and is_checked(f))


@functools.lru_cache(maxsize=None)
def precompiled():
    """A folder with the precompiled headers."""
    folder = tempfile.TemporaryDirectory()
    header = os.path.join(folder.name, "headers.h")
    with open(header, "w", encoding="utf-8") as file:
        file.write(PRECOMPILED)
    flags = [flag for flag in FLAGS if flag != "-fsyntax-only"]
    subprocess.run([CLANG, *flags, "-fpch-instantiate-templates", "-x", "c++-header", header,
                    "-o", os.path.join(folder.name, "headers.pch")], cwd=ROOT, check=True)
    return folder


def compile_joined(paths):
    """Compiles the sources as one; returns clang's messages, or "" if there are none."""
    text = "".join(f'#include "{os.path.join(ROOT, p)}"\n' for p in paths)
    headers = os.path.join(precompiled().name, "headers.pch")
    done = subprocess.run([CLANG, *FLAGS, "-include-pch", headers, "-x", "c++", "-"], input=text,
                          cwd=ROOT, text=True, capture_output=True, check=False)
    if done.returncode == 0:
        return ""
    if len(paths) > 1 and "[-Werror,-Wthread-safety" not in done.stderr:
        # Two of them give one name to two things: each half alone.
        half = len(paths) // 2
        return compile_joined(paths[:half]) + compile_joined(paths[half:])
    return done.stderr


def batches(paths):
    for _, of_folder in itertools.groupby(paths, lambda path: path.split("/")[0]):
        sources = list(of_folder)
        for kind in (False, True):
            same = [s for s in sources if s.endswith("_test.cc") == kind]
            for i in range(0, len(same), JOINED_MAX):
                yield same[i:i + JOINED_MAX]


@unittest.skipIf(CLANG is None, "clang++ is not installed: deploy/install-packages test")
class ThreadSafetyTest(unittest.TestCase):
    def test_every_access_holds_its_lock(self):
        paths = [path for path in sources_with_mutexes()
                 if ALL_TESTS or not path.endswith("_test.cc")]
        self.assertGreater(len(paths), 20, "the sources with mutexes were not found")
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            precompiled()
            said = [text for text in pool.map(compile_joined, batches(paths)) if text]
        self.assertFalse(said, "\n".join(said))

    def test_an_access_without_its_lock_is_found(self):
        path = "worker/agent/scene_cache.cc"
        unlocked, count = re.subn(r"  const MutexLock lock\(&mutex_\);\n  return SumOfMemory",
                                  "  return SumOfMemory", read(path))
        self.assertEqual(count, 1, path + " has changed: remove another lock")
        with tempfile.NamedTemporaryFile("w", suffix=".cc") as copy:
            copy.write(unlocked)
            copy.flush()
            said = compile_joined([copy.name])
        self.assertIn("requires holding mutex 'mutex_'", said)

    def test_no_other_mutexes_are_used(self):
        """libstdc++'s own have no annotations, so clang would see no lock where one is held."""
        listed = subprocess.run(["git", "grep", "-nE", r"std::(\w*mutex|lock_guard|unique_lock|"
                                 r"scoped_lock|shared_lock|condition_variable\w*)\b", "--",
                                 "*.h", "*.cc", ":!" + MUTEX], cwd=ROOT, capture_output=True,
                                text=True, check=False).stdout
        self.assertEqual(listed, "", "use common/base/mutex.h")


if __name__ == "__main__":
    unittest.main(verbosity=2)
