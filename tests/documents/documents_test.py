#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Compares the documents with the code: links, commands, routes, calls, variables and messages.

Needs Debian's python3-protobuf, which the system's interpreter sees, and protoc.
"""
import glob
import os
import re
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
import grpc_reference  # noqa: E402
from commands import ROOT, blocks, program_calls, read  # noqa: E402

# Documents whose blocks are run, unless a block says why not: by run_test.py.
RUN = ("README.md", "docs/tutorial.md")
# Why the blocks of the others are not run as a whole. Their commands are compared with --help, and
# the tests of the subjects run most of them.
NOT_RUN = {
    "ARCHITECTURE.md": "they show flows and folders",
    "CONTRIBUTING.md": "they build or test everything",
    "docs/accuracy.md": "they take hours",
    "docs/blender.md": "they need Blender",
    "docs/certificate.md": "certificate_test.py has its options",
    "docs/content.md": "parts of commands",
    "docs/denoise.md": "denoise_test.py has its options, python_package_test.py its script",
    "docs/elastic.md": "they need Slurm, Kubernetes or a container engine: tests/engines",
    "docs/failures.md": "they need a task that fails: failure_classes_test.py, repro_test.py",
    "docs/gltf.md": "they need models and minutes: tests/gltf/models_test.py",
    "docs/usd.md": "they need models: tests/usd/converter_test.py",
    "docs/object-storage.md": "they need a server that speaks S3: tests/engines/s3",
    "docs/operations.md": "they need root and systemd",
    "docs/outputs.md": "client_test.py and the tests of outputs have them",
    "docs/packages.md": "they install packages: tests/engines/packages",
    "docs/pbrt-v4.md": "they are parts of scenes",
    "docs/principled.md": "a statement of a scene",
    "docs/reference/http.md": "they need a farm with jobs: http_api_test.cc",
    "docs/retention.md": "retention_test.py has them",
    "docs/scheduling.md": "scheduling_holds_test.py has them",
    "docs/security.md": "they need root: secure_farm_test.py has the calls of Sheaf",
    "docs/study.md": "a study takes minutes: study_test.py",
    "docs/usage.md": "they need a farm with users",
    "docs/viewing.md": "a conversation between programs: view_test.py",
    "docs/users/clusters.md": "they need Slurm: tests/engines/slurm",
    "docs/users/farm-managers.md": "they need a farm manager",
    "docs/users/home.md": "a line of a file",
    "docs/users/houdini-nuke.md": "they need frames of a studio",
    "docs/users/research.md": "they need a scene and its reference",
    "docs/using.md": "a list of commands",
    "python/README.md": "they are Python, whose examples python_package_test.py runs",
    "scenes/README.md": "they take minutes",
}
# Conditions of /readyz: no fields of answers.
SENT_ELSEWHERE = {"certificate"}
# Names of variables in the code of programs and scripts.
VARIABLES_IN_CODE = (
    r'getenv\("([A-Z_0-9]+)"\)', r'envname\("([A-Z_0-9]+)"\)', r'ariable\("([A-Z_0-9]+)"\)',
    r'UserDirectory\("([A-Z_0-9]+)"', r'TakeVariable\("([A-Z_0-9]+)"\)',
    r'environ(?:\.get\(|\[)"([A-Z_0-9]+)"')
LISTS_IN_CODE = r'Variable\(\{([^}]*)\}\)'
# Those that only name a folder of the system, or are of other programs.
NOT_OURS = {"PATH", "LD_LIBRARY_PATH"}


def documents():
    names = ["README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "python/README.md",
             "scenes/README.md"]
    for path in glob.glob(os.path.join(ROOT, "docs", "**", "*.md"), recursive=True):
        names.append(os.path.relpath(path, ROOT))
    return sorted(names)


def anchors(text):
    """The anchors of headings, as GitHub makes them."""
    found = set()
    for title in re.findall(r"^#+ (.+)$", text, re.M):
        title = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower()
        found.add(re.sub(r"[^\w\- ]", "", title).replace(" ", "-"))
    return found


def sources(*folders, endings):
    for folder in folders:
        for parent, _, names in os.walk(os.path.join(ROOT, folder)):
            for name in names:
                path = os.path.relpath(os.path.join(parent, name), ROOT)
                if name.endswith(endings) and not re.search(r"_test\.(cc|py)$", name):
                    yield path


class DocumentsTest(unittest.TestCase):
    def expect_none(self, problems, what):
        self.assertFalse(problems, what + ":\n  " + "\n  ".join(problems))

    def test_links_lead_somewhere(self):
        problems = []
        for path in documents():
            text = re.sub(r"`[^`]*`", "", read(path))
            for target in re.findall(r"\]\(([^)\s]+)\)", text):
                if re.match(r"https?:", target):
                    continue
                file, _, anchor = target.partition("#")
                where = os.path.normpath(os.path.join(ROOT, os.path.dirname(path), file))
                where = where if file else os.path.join(ROOT, path)
                if not os.path.exists(where):
                    problems.append(f"{path}: {target}: no such file")
                elif anchor and where.endswith(".md") and anchor not in anchors(read(where)):
                    problems.append(f"{path}: {target}: no such heading")
        self.expect_none(problems, "links")

    def test_blocks_are_run_or_say_why_not(self):
        having = {path for path in documents() if not path.startswith("docs/adr/")
                  and any(not block.reason for block in blocks(path))}
        self.assertEqual(sorted(having - set(RUN) - set(NOT_RUN)), [],
                         "documents with blocks that are neither run nor explained")
        for path in RUN:
            self.assertTrue(any(not block.reason for block in blocks(path)), path)

    def test_options_exist(self):
        helps, problems = {}, []

        def help_of(*words):
            if words not in helps:
                done = subprocess.run([os.path.join(farm.programs(), words[0]), *words[1:],
                                       "--help"], capture_output=True, text=True,
                                      timeout=60 * farm.PATIENCE)
                helps[words] = done.stdout if done.returncode == 0 else None
            return helps[words]

        for path in documents():
            for call in (c for block in blocks(path) for c in program_calls(block)):
                program, words = call[0], call[1:]
                if program == "sheaf-autoscaler":  # Python; autoscaler_test.py has its options.
                    continue
                command = [w for w in words[:1] if re.fullmatch(r"[a-z]+", w)]
                text = help_of(program, *command)
                if text is None:
                    problems.append(f"{path}: {program} {' '.join(command)}: no such command")
                    continue
                for word in words:
                    option = re.match(r"--[a-z][a-z0-9-]*", word)
                    if option and not re.search(re.escape(option[0]) + r"(?![\w-])", text):
                        problems.append(f"{path}: {program} {' '.join(command)}: {option[0]}")
        self.assertGreater(len(helps), 10)
        self.expect_none(problems, "not in --help")

    def test_grpc_reference_is_fresh(self):
        self.assertEqual(read("docs/reference/grpc.md"), grpc_reference.page(),
                         "run tests/documents/grpc_reference.py")

    def test_every_route_is_in_the_reference(self):
        rows = re.findall(r"^((?:GET|POST) .+): (?:the role )?(.+)$",
                          read("tests/golden/files/roles.txt"), re.M)
        table = {}
        for names, role in re.findall(r"^\| ((?:`(?:GET|POST) [^`]+`(?:, )?)+) \| ([^|]+) \|",
                                      read("docs/reference/http.md"), re.M):
            table.update({name: role for name in re.findall(r"`([^`]+)`", names)})
        self.assertEqual(table, {route: role.replace("the role ", "") for route, role in rows})

    def test_every_field_of_answers_is_in_the_reference(self):
        """Fields are those of the messages, or the page on HTTP says what they are."""
        sent = set()
        for path in sources("coordinator/service/http", endings=(".cc",)):
            sent.update(re.findall(r'\{"([a-z]\w*)",', read(path)))
        answers = read("tests/golden/files/http_answers.txt")
        sent.update(re.findall(r'^ *"([a-z]\w*)": ', answers, re.M))
        sent = {name for name in sent if not name.startswith("sheaf_")} - SENT_ELSEWHERE
        self.assertGreater(len(sent), 100)
        messages = "".join(read(path) for path in sources("proto", endings=(".proto",)))
        fields = set(re.findall(r"^\s+(?:optional |repeated )?[\w.<>, ]+ (\w+) = \d+", messages,
                                re.M))
        written = set(re.findall(r'[`"](\w+)[`"]', read("docs/reference/http.md")))
        self.assertEqual(sent - fields - written, set())

    def test_every_event_is_in_the_reference(self):
        code = read("coordinator/service/http/api/http_watch.cc") + read(
            "coordinator/service/http/server/event_stream.cc")
        sent = set(re.findall(r'(?:Publish|EncodeEvent)\(\{"(\w+)"', code))
        events = read("docs/reference/http.md").partition("\n## Events")[2]
        self.assertEqual(set(re.findall(r"^\| `(\w+)` \|", events, re.M)), sent)

    def test_every_variable_is_in_the_reference(self):
        used = set()
        for path in sources("common", "cli", "coordinator", "worker", "python", "blender",
                            endings=(".cc", ".py")):
            text = read(path)
            for pattern in VARIABLES_IN_CODE:
                used.update(re.findall(pattern, text))
            for names in re.findall(LISTS_IN_CODE, text):
                used.update(re.findall(r'"([A-Z_0-9]+)"', names))
        for path in sources("deploy", endings=("",)):
            if path.endswith((".txt", ".in", ".cmake")):  # Variables of CMake.
                continue
            used.update(re.findall(r"\$\{?(SHEAF_[A-Z_]+)", read(path)))
        documented = set(re.findall(r"`([A-Z][A-Z_0-9]+)`", read("docs/reference/environment.md")))
        self.assertGreater(len(used), 20)
        self.assertEqual(sorted(used - documented - NOT_OURS), [], "not in the document")
        text = "\n".join([read(p) for p in sources("deploy", endings=("",))] +
                         [read(p) for p in sources("common", "cli", "coordinator", "worker",
                                                   "python", "blender", "tests",
                                                   endings=(".cc", ".h", ".py"))])
        gone = [name for name in sorted(documented) if name not in text]
        self.assertEqual(gone, [], "no source reads them")

    def test_messages_of_troubleshooting_exist(self):
        code = "".join(re.sub(r'"\s*\n\s*"', "", read(path))
                       for path in sources("common", "cli", "coordinator", "worker",
                                           endings=(".cc", ".h")))
        quoted = re.findall(r'^\| [^"|]*"([^"]+)" \|', read("docs/troubleshooting.md"), re.M)
        self.assertGreater(len(quoted), 25)
        self.expect_none([words for words in quoted if words not in code], "no source says")

    def test_tests_of_first_use_exist(self):
        named = re.findall(r"`([A-Za-z_]{12,})`",
                           read("tests/documents/first_use.md").partition("|---|")[2])
        tests = "".join(read(path) for path in sources("tests", endings=(".py",)))
        for folder in ("tests", "common", "cli", "coordinator", "worker"):
            for path in glob.glob(os.path.join(ROOT, folder, "**", "*_test.*"), recursive=True):
                if path.endswith((".py", ".cc")):
                    tests += read(os.path.relpath(path, ROOT))
        self.assertGreater(len(named), 25)
        self.expect_none([name for name in named if not re.search(
            rf'def {name}\(|, {name}\)|\{{"{name}"', tests)], "no such test")

    def test_python_examples_are_run(self):
        ran = read("tests/integration/python_package_test.py")
        for path in glob.glob(os.path.join(ROOT, "python", "examples", "*.py")):
            self.assertIn(os.path.basename(path), ran)


if __name__ == "__main__":
    unittest.main(verbosity=2)
