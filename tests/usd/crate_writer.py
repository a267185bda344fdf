# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes a small crate (.usdc) of version 0.8: a square of one face. Source: the core specification
of the AOUSD, section 16.3."""
import struct

ATTRIBUTE, PRIM, PSEUDO_ROOT = 1, 6, 7
INT, FLOAT, DOUBLE, TOKEN, VEC3F, SPECIFIER, VARIABILITY, TOKEN_VECTOR = 3, 8, 9, 11, 24, 42, 44, 41
ARRAY, INLINED = 1 << 63, 1 << 62


def packed(data):
    """One chunk of LZ4, of literals alone, with its size."""
    length = len(data)
    token, more = (length << 4, b"") if length < 15 else (0xF0, b"")
    if length >= 15:
        rest = length - 15
        more = b"\xff" * (rest // 255) + bytes([rest % 255])
    block = b"\0" + bytes([token]) + more + data
    return struct.pack("<Q", len(block)) + block


def integers(values):
    """Differences, each in 32 bits."""
    codes = bytearray((len(values) * 2 + 7) // 8)
    data, last = b"", 0
    for i, value in enumerate(values):
        codes[i // 4] |= 3 << (i % 4 * 2)
        data += struct.pack("<i", value - last)
        last = value
    return packed(struct.pack("<i", 0) + bytes(codes) + data)


class Crate:
    def __init__(self):
        self.tokens, self.fields, self.sets = [], [], []
        self.body = b""

    def token(self, text):
        if text not in self.tokens:
            self.tokens.append(text)
        return self.tokens.index(text)

    def stored(self, kind, data, flags=0):
        self.body += b"\0" * (-len(self.body) % 8)
        at = 88 + len(self.body)
        self.body += data
        return flags | kind << 48 | at

    def field(self, name, rep):
        self.fields.append((self.token(name), rep))
        return len(self.fields) - 1

    def field_set(self, *fields):
        at = len(self.sets)
        self.sets += [*fields, -1]
        return at

    def name(self, text):
        return INLINED | TOKEN << 48 | self.token(text)


def quad():
    crate = Crate()
    inline = lambda kind, value: INLINED | kind << 48 | value
    children = struct.pack("<QI", 1, crate.token("Quad"))
    unit = inline(DOUBLE, struct.unpack("<I", struct.pack("<f", 0.25))[0])
    root = crate.field_set(crate.field("metersPerUnit", unit),
                           crate.field("primChildren", crate.stored(TOKEN_VECTOR, children)))
    prim = crate.field_set(crate.field("specifier", inline(SPECIFIER, 0)),
                           crate.field("typeName", crate.name("Mesh")))
    array = lambda kind, count, data: crate.stored(kind, struct.pack("<Q", count) + data, ARRAY)
    points = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)
    attributes = {
        "faceVertexCounts": array(INT, 1, struct.pack("<i", 4)),
        "faceVertexIndices": array(INT, 4, struct.pack("<4i", 0, 1, 2, 3)),
        "points": array(VEC3F, 4, points),
        "subdivisionScheme": crate.name("none"),
    }
    sets = [root, prim]
    sets += [crate.field_set(crate.field("default", rep)) for rep in attributes.values()]
    names = [crate.token(""), crate.token("Quad")] + [-crate.token(name) for name in attributes]
    count = len(sets)
    jumps = [-1, -1] + [0] * (len(attributes) - 1) + [-2]
    text = b"".join(t.encode() + b"\0" for t in crate.tokens)
    sections = {
        "TOKENS": struct.pack("<QQ", len(crate.tokens), len(text)) + packed(text),
        "STRINGS": struct.pack("<Q", 0),
        "FIELDS": struct.pack("<Q", len(crate.fields)) + integers([f[0] for f in crate.fields]) +
                  packed(b"".join(struct.pack("<Q", f[1]) for f in crate.fields)),
        "FIELDSETS": struct.pack("<Q", len(crate.sets)) + integers(crate.sets),
        "PATHS": struct.pack("<QQ", count, count) + integers(list(range(count))) + integers(names) +
                 integers(jumps),
        "SPECS": struct.pack("<Q", count) + integers(list(range(count))) + integers(sets) +
                 integers([PSEUDO_ROOT, PRIM] + [ATTRIBUTE] * len(attributes)),
    }
    data = crate.body
    table = struct.pack("<Q", len(sections))
    for name, section in sections.items():
        table += name.encode().ljust(16, b"\0") + struct.pack("<qq", 88 + len(data), len(section))
        data += section
    header = b"PXR-USDC" + bytes([0, 8, 0, 0, 0, 0, 0, 0]) + struct.pack("<q", 88 + len(data))
    return header.ljust(88, b"\0") + data + table
