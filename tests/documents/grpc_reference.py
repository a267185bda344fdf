#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Makes docs/reference/grpc.md from the comments of proto/sheaf/v1.

    tests/documents/grpc_reference.py            # writes the file
    tests/documents/grpc_reference.py --check    # says whether it is what the protos give

Needs protoc and Debian's python3-protobuf, which the system's interpreter sees.
"""
import os
import re
import subprocess
import sys
import tempfile

from google.protobuf import descriptor_pb2

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PAGE = os.path.join(ROOT, "docs", "reference", "grpc.md")
ROLES = os.path.join(ROOT, "tests", "golden", "files", "roles.txt")
# Numbers of the fields of descriptors, by which source locations name their subjects. Source:
# google/protobuf/descriptor.proto.
MESSAGES, ENUMS, SERVICES = 4, 5, 6
FIELDS, NESTED_MESSAGES, NESTED_ENUMS = 2, 3, 4
METHODS = VALUES = 2
HEAD = """# gRPC reference

Made by `tests/documents/grpc_reference.py` from the comments in proto/sheaf/v1: change those, not
this page. The port is 7400 unless `sheaf-coordinator --listen` says otherwise. It has health
checking (`grpc.health.v1.Health`) and reflection, so that tools such as grpcurl find the services
by themselves. With certificates, calls need mutual TLS; *role* says who may make a call
([security](../security.md#identities-and-roles)). Fields marked *repeated* are lists; *one of*
fields exclude each other.
"""


def roles():
    """The role of each operation, in words, from the golden file of the coordinator's table."""
    with open(ROLES, encoding="utf-8") as file:
        rows = re.findall(r"^(/.+): (.+)$", file.read(), re.M)
    return {operation: role.replace("the role ", "").replace("no role required", "anybody")
            for operation, role in rows}


def descriptors():
    """The files of proto/sheaf/v1 with their comments."""
    names = sorted(n for n in os.listdir(os.path.join(ROOT, "proto", "sheaf", "v1"))
                   if n.endswith(".proto"))
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "set")
        subprocess.run(["protoc", "-I", os.path.join(ROOT, "proto"), "--include_source_info",
                        "--descriptor_set_out=" + path, *("sheaf/v1/" + n for n in names)],
                       check=True)
        with open(path, "rb") as file:
            return descriptor_pb2.FileDescriptorSet.FromString(file.read()).file


class FilePage:
    """The text of one file."""

    def __init__(self, file, role_of):
        self.file, self.role_of = file, role_of
        self.comments = {tuple(location.path): location.leading_comments
                         for location in file.source_code_info.location}

    def comment(self, path):
        text = " ".join(self.comments.get(tuple(path), "").split())
        return text.replace("|", "\\|").replace("<", "&lt;")

    def field_type(self, field):
        if field.type_name:
            name = field.type_name.removeprefix(".sheaf.v1.").removeprefix(".google.protobuf.")
            if field.type_name.startswith(".sheaf.v1."):
                name = f"[{name}](#{name.lower().replace('.', '')})"
        else:
            name = descriptor_pb2.FieldDescriptorProto.Type.Name(field.type)[5:].lower()
        if field.label == field.LABEL_REPEATED:
            return "repeated " + name
        in_choice = field.HasField("oneof_index") and not field.proto3_optional
        return ("one of: " if in_choice else "") + name

    def message(self, message, path, prefix):
        name = prefix + message.name
        lines = [f"### {name}", "", self.comment(path), ""]
        if message.field:
            lines += ["| field | number | type | |", "|---|---|---|---|"]
        for index, field in enumerate(message.field):
            words = self.comment([*path, FIELDS, index])
            lines.append(f"| `{field.name}` | {field.number} | {self.field_type(field)} "
                         f"| {words} |")
        lines += [""] * bool(message.field)
        for index, nested in enumerate(message.nested_type):
            if not nested.options.map_entry:
                lines += self.message(nested, [*path, NESTED_MESSAGES, index], name + ".")
        for index, enum in enumerate(message.enum_type):
            lines += self.enum(enum, [*path, NESTED_ENUMS, index], name + ".")
        return lines

    def enum(self, enum, path, prefix):
        lines = [f"### {prefix}{enum.name}", "", self.comment(path), "", "| value | number | |",
                 "|---|---|---|"]
        for index, value in enumerate(enum.value):
            lines.append(f"| `{value.name}` | {value.number} "
                         f"| {self.comment([*path, VALUES, index])} |")
        return lines + [""]

    def service(self, service, index):
        path = [SERVICES, index]
        lines = [f"### {service.name}", "", self.comment(path), "", "| call | role | |",
                 "|---|---|---|"]
        for number, method in enumerate(service.method):
            asks, answers = (
                ("stream of " if streams else "") + self.link(name)
                for name, streams in ((method.input_type, method.client_streaming),
                                      (method.output_type, method.server_streaming)))
            role = self.role_of.get(f"/sheaf.v1.{service.name}/{method.name}", "-")
            lines.append(f"| `{method.name}` ({asks}) returns {answers} | {role} "
                         f"| {self.comment([*path, METHODS, number])} |")
        return lines + [""]

    @staticmethod
    def link(type_name):
        name = type_name.removeprefix(".sheaf.v1.")
        return f"[{name}](#{name.lower().replace('.', '')})"

    def text(self):
        lines = [f"## {os.path.basename(self.file.name)}", ""]
        for index, service in enumerate(self.file.service):
            lines += self.service(service, index)
        for index, message in enumerate(self.file.message_type):
            lines += self.message(message, [MESSAGES, index], "")
        for index, enum in enumerate(self.file.enum_type):
            lines += self.enum(enum, [ENUMS, index], "")
        return "\n".join(lines)


def page():
    role_of = roles()
    parts = [HEAD] + [FilePage(file, role_of).text() for file in descriptors()]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(parts)).rstrip() + "\n"


def main():
    if "--check" not in sys.argv[1:]:
        with open(PAGE, "w", encoding="utf-8") as file:
            file.write(page())
        return
    with open(PAGE, encoding="utf-8") as file:
        if file.read() != page():
            sys.exit("docs/reference/grpc.md is not what the protos give: run "
                     "tests/documents/grpc_reference.py")


if __name__ == "__main__":
    main()
