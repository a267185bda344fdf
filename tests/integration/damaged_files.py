# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A scene with a texture, and damage to its files on disk, for tests."""
import os
import struct
import zlib

SIZE = 512  # Size of the texture in pixels: more than one tile of the texture cache.
SCENE = """LookAt 0 0 -2  0 0 0  0 1 0
Camera "perspective" "float fov" 60
Film "rgb" "integer xresolution" 96 "integer yresolution" 64
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
Texture "wood" "spectrum" "imagemap" "string filename" "wood.png" "string filter" "point"
Material "diffuse" "texture reflectance" "wood"
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point2 uv" [0 0 1 0 1 1 0 1]
  "point3 P" [-1 -1 0  1 -1 0  1 1 0  -1 1 0]
"""


def write_png(path):
    """A PNG with uncompressed data, so that any byte can change at the same size."""
    rows = b"".join(b"\0" + bytes((3 * x + 7 * y + 11 * c) % 200 + 20 for x in range(SIZE)
                                  for c in range(3)) for y in range(SIZE))

    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n"
                   + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0))
                   + chunk(b"IDAT", zlib.compress(rows, 0)) + chunk(b"IEND", b""))


def write_scene(folder):
    """Writes the scene with its texture; returns the paths of both."""
    scene, texture = os.path.join(folder, "scene.pbrt"), os.path.join(folder, "wood.png")
    with open(scene, "w", encoding="utf-8") as file:
        file.write(SCENE)
    write_png(texture)
    return scene, texture


def overwrite(path, change):
    """Changes bytes in place (change gets a bytearray) and restores the modification time."""
    before = os.stat(path)
    os.chmod(path, 0o644)
    with open(path, "r+b") as file:
        data = bytearray(file.read())
        change(data)
        file.seek(0)
        file.write(data)
        file.flush()
        # By its descriptor: a program that finds the damage moves the file away at once.
        assert os.fstat(file.fileno()).st_size == before.st_size
        os.utime(file.fileno(), ns=(before.st_atime_ns, before.st_mtime_ns))


def alter(path, whole=False):
    """Changes a byte in the middle; whole: makes another valid PNG of the texture."""
    def invert(data):  # PNG's own checksums do not find it.
        rows = bytearray(zlib.decompress(bytes(data[41:-16])))
        for i in range(len(rows)):
            if i % (3 * SIZE + 1):
                rows[i] = 255 - rows[i]
        stored = zlib.compress(bytes(rows), 0)
        data[41:-16] = stored
        data[-16:-12] = struct.pack(">I", zlib.crc32(b"IDAT" + stored))

    def change_one(data):
        data[len(data) // 2] ^= 0x55
    overwrite(path, invert if whole else change_one)


def flip_bit(path, random):
    """Flips a random bit of the file."""
    def flip(data):
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    overwrite(path, flip)


def blob_path(folder, size):
    """The path of the blob of this size."""
    for directory, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(directory, name)
            if len(name) == 64 and "damaged" not in path and os.path.getsize(path) == size:
                return path
    raise AssertionError(f"no blob of {size} bytes in {folder}")
