# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes .nvdb files of one float grid "density", region by region, with one upper node.

The voxels are those of a cube of `side` voxels, at most 4,096, that becomes the box from -1 to 1. A
region is a cube of 128 voxels: a lower node and its leaves. Source: the layout is NanoVDB's
(version 32.4).
"""
import os
import struct

LEAF_BYTES, LOWER_BYTES, UPPER_BYTES = 2144, 33856, 270400
UPPER_AT = 832 + -832 % 32  # In the image.
IMAGE_AT = 16 + 176 + 8     # In the file.
VERSION = (32 << 21) | (4 << 10)
MAGIC = int.from_bytes(b"NanoVDB0", "little")


class NanovdbFile:
    """A file that is being written, as a context."""

    def __init__(self, path, side):
        self.path, self.side = path, side
        self.children = {}
        self.end = UPPER_AT + UPPER_BYTES  # The image so far.

    def __enter__(self):
        self.file = open(self.path, "wb")
        self.file.seek(IMAGE_AT + self.end)
        return self

    def add_region(self, key, leaves, lower):
        """key: the region's origin over 128. leaves: their bytes, which come before the lower node
        and which its table points to.
        """
        self.file.write(leaves)
        self.file.write(lower)
        lower_at = self.end + len(leaves)
        self.children[(key[0] * 32 + key[1]) * 32 + key[2]] = lower_at - UPPER_AT
        self.end = lower_at + LOWER_BYTES

    def __exit__(self, *_):
        side, voxel = self.side, 2.0 / self.side
        grid = bytearray(672 + 64)
        struct.pack_into("<QQIIIIQ", grid, 0, MAGIC, 0, VERSION, 0, 0, 1, self.end)
        grid[40:47] = b"density"
        struct.pack_into("<9d", grid, 296 + 88, voxel, 0, 0, 0, voxel, 0, 0, 0, voxel)
        struct.pack_into("<9d", grid, 296 + 160, 1 / voxel, 0, 0, 0, 1 / voxel, 0, 0, 0, 1 / voxel)
        struct.pack_into("<3d", grid, 296 + 232, -1, -1, -1)
        struct.pack_into("<3dII", grid, 608, voxel, voxel, voxel, 2, 1)
        struct.pack_into("<4Q", grid, 672, 0, 0, UPPER_AT - 672, 64)
        root = bytearray(64 + 32)
        struct.pack_into("<6iI", root, 0, 0, 0, 0, side, side, side, 1)
        struct.pack_into("<Qq", root, 64, 0, UPPER_AT - 736)
        upper = bytearray(UPPER_BYTES)
        for n, offset in self.children.items():
            upper[4128 + n // 8] |= 1 << n % 8
            struct.pack_into("<q", upper, 8256 + 8 * n, offset)
        self.file.seek(0)
        self.file.write(struct.pack("<QIHH", MAGIC, VERSION, 1, 0))
        self.file.write(struct.pack(
            "<4QII6d6i3dI4I3IHHI", self.end, self.end, 0, 0, 1, 2, *[0.0] * 6, *[0] * 6,
            voxel, voxel, voxel, 8, 0, 0, 1, 1, 0, 0, 0, 0, 0, VERSION))
        self.file.write(b"density\0" + bytes(grid) + bytes(root))
        self.file.seek(IMAGE_AT + UPPER_AT)
        self.file.write(upper)
        self.file.close()


def leaf_head(origin, values_mask):
    """The first 96 bytes of a leaf at origin, whose values follow."""
    head = bytearray(96)
    struct.pack_into("<3i3BB", head, 0, *origin, 7, 7, 7, 2)
    head[16:80] = values_mask
    return bytes(head)


def write_noise_layer(path, side, random):
    """A layer of 128 voxels, the lowest of a cube of `side` voxels, of densities from 1/8 to 1/2
    that do not compress. Returns the size of the file.
    """
    with NanovdbFile(path, side) as file:
        for x in range(side // 128):
            for y in range(side // 128):
                leaves = bytearray()
                lower = bytearray(LOWER_BYTES)
                origin = (x * 128, y * 128, 0)
                struct.pack_into("<6i", lower, 0, *origin, *(o + 127 for o in origin))
                lower[544:1056] = b"\xff" * 512
                for n in range(4096):
                    struct.pack_into("<q", lower, 1088 + 8 * n, (n - 4096) * LEAF_BYTES)
                    values = bytearray(random.randbytes(2048))
                    values[3::4] = b"\x3e" * 512
                    corner = (origin[0] + 8 * (n >> 8), origin[1] + 8 * (n >> 4 & 15),
                              8 * (n & 15))
                    leaves += leaf_head(corner, b"\xff" * 64) + values
                file.add_region((x, y, 0), leaves, lower)
    return os.path.getsize(path)
