# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes of many bytes that cost nothing to render, for tests of their transfer."""
import hashlib
import os
import random

import client_case

LINE = 128


def comment_lines(size, seed):
    """Text of this size that the scene reader skips, and that no compression makes small."""
    source = random.Random(seed)
    return b"".join(b"#" + source.randbytes(LINE // 2 - 1).hex().encode() + b"0\n"
                    for _ in range(size // LINE))


def write_scene(folder, sizes_mib):
    """A scene that includes files of these sizes; returns its path and the files' digests."""
    digests = []
    includes = ""
    for number, mib in enumerate(sizes_mib):
        data = comment_lines(mib << 20, number)
        digests.append(hashlib.sha256(data).hexdigest())
        with open(os.path.join(folder, f"part{number}.pbrt"), "wb") as file:
            file.write(data)
        includes += f'Include "part{number}.pbrt"\n'
    path = os.path.join(folder, "scene.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(client_case.SCENE + includes)
    return path, digests
