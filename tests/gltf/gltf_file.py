# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes glTF 2.0 files from parts: buffers, accessors, images. Only the standard library."""
import base64
import json
import os
import struct
import zlib

FORMATS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def png(width, height, pixel):
    """The bytes of an RGBA PNG; pixel(x, y) gives four numbers of [0, 255]."""
    rows = b"".join(b"\0" + bytes(v for x in range(width) for v in pixel(x, y))
                    for y in range(height))

    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data +
                struct.pack(">I", zlib.crc32(kind + data)))

    return (b"\x89PNG\r\n\x1a\n" +
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class GltfFile:
    """One file in the making. Members of `json` may be changed before it is written."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "nodes": []}
        self.data = b""

    def add(self, kind, item):
        """Appends to a list of the file; returns the index."""
        items = self.json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def view(self, data, **members):
        self.data += b"\0" * (-len(self.data) % 4)
        offset = len(self.data)
        self.data += data
        return self.add("bufferViews", {"buffer": 0, "byteOffset": offset,
                                        "byteLength": len(data), **members})

    def accessor(self, values, kind, component=5126, **members):
        """values: flat list of numbers."""
        data = struct.pack(f"<{len(values)}{FORMATS[component]}", *values)
        item = {"bufferView": self.view(data), "componentType": component,
                "count": len(values) // WIDTHS[kind], "type": kind, **members}
        return self.add("accessors", item)

    def node(self, shown=True, **members):
        index = self.add("nodes", members)
        if shown:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def extension(self, name):
        used = self.json.setdefault("extensionsUsed", [])
        if name not in used:
            used.append(name)

    def texture(self, image_bytes, embedded=True, **members):
        if embedded:
            image = {"bufferView": self.view(image_bytes), "mimeType": "image/png"}
        else:
            image = {"uri": "data:image/png;base64," + base64.b64encode(image_bytes).decode()}
        return self.add("textures", {"source": self.add("images", image), **members})

    def write(self, path):
        """A .glb by its name, or a .gltf with its buffer in a file beside it.

        Buffers of `json` follow the file's own.
        """
        more = self.json.get("buffers", [])
        if path.endswith(".glb"):
            data = self.data + b"\0" * (-len(self.data) % 4)
            if data:
                self.json["buffers"] = [{"byteLength": len(data)}, *more]
            text = json.dumps(self.json).encode()
            text += b" " * (-len(text) % 4)
            chunks = struct.pack("<I", len(text)) + b"JSON" + text
            if data:
                chunks += struct.pack("<I", len(data)) + b"BIN\0" + data
            with open(path, "wb") as file:
                file.write(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
            return
        if self.data:
            name = os.path.basename(path)[:-5] + " data.bin"  # URIs encode the space.
            with open(os.path.join(os.path.dirname(path), name), "wb") as file:
                file.write(self.data)
            self.json["buffers"] = [{"byteLength": len(self.data),
                                     "uri": name.replace(" ", "%20")}, *more]
        with open(path, "w", encoding="utf-8") as file:
            json.dump(self.json, file)
