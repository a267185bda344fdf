# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Takes the version from the project and generates sheaf.v1, the messages of proto/sheaf/v1.

The generators are the programs protoc and grpc_python_plugin (Debian: protobuf-compiler,
protobuf-compiler-grpc, and libprotobuf-dev for protobuf's own messages), otherwise the Python
package grpcio-tools.
"""
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec

from setuptools import setup
from setuptools.command.build_py import build_py

FOLDER = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(FOLDER)
# The services of clients, and the files that these import.
PROTOS = ("bundle", "content", "farm", "frame", "job", "job_view", "worker")


def project_version():
    path = os.path.join(ROOT, "CMakeLists.txt")
    if not os.path.exists(path):
        sys.exit(f"sheaf: {path} is missing, which has the version; build in a clone of Sheaf")
    with open(path, encoding="utf-8") as file:
        return re.search(r"project\(sheaf VERSION (\S+)", file.read())[1]


def generators():
    """The command that generates, without its arguments."""
    plugin = shutil.which("grpc_python_plugin")
    if shutil.which("protoc") and plugin:
        return ["protoc", "--plugin=protoc-gen-grpc_python=" + plugin]
    if find_spec("grpc_tools"):
        return [sys.executable, "-m", "grpc_tools.protoc"]
    sys.exit("sheaf: cannot generate the messages: protoc or grpc_python_plugin is missing; "
             "install protobuf-compiler, protobuf-compiler-grpc and libprotobuf-dev (Debian) or "
             "grpcio-tools (pip)")


def generate(folder):
    """Writes sheaf/v1 below the folder; returns its files."""
    package = os.path.join(folder, "sheaf", "v1")
    os.makedirs(package, exist_ok=True)
    protos = os.path.join(ROOT, "proto")
    subprocess.run([*generators(), "-I" + protos, "--python_out=" + folder, "--pyi_out=" + folder,
                    "--grpc_python_out=" + folder,
                    *(os.path.join(protos, "sheaf", "v1", name + ".proto") for name in PROTOS)],
                   check=True)
    with open(os.path.join(package, "__init__.py"), "w", encoding="utf-8") as file:
        file.write('"""The messages and services of proto/sheaf/v1; generated."""\n')
    return [os.path.join(package, name) for name in sorted(os.listdir(package))
            if name.endswith((".py", ".pyi"))]


class BuildWithMessages(build_py):
    generated = ()

    def run(self):
        super().run()
        # An editable installation uses the sources in place.
        self.generated = generate(FOLDER if self.editable_mode else self.build_lib)

    def get_outputs(self, include_bytecode=1):
        return [*super().get_outputs(include_bytecode), *self.generated]


setup(version=project_version(), cmdclass={"build_py": BuildWithMessages})
