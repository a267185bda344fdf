#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Denoises an image of Sheaf by Intel Open Image Denoise, as a command of --denoise-with.

    sheaf render room.pbrt --denoise-with .../denoise_with_oidn.py -o room.exr

Sheaf calls it with two paths, INPUT.exr and OUTPUT.exr. It needs the program oidnDenoise of
https://www.openimagedenoise.org in PATH, and Debian's python3-openimageio and python3-numpy.
"""
import os
import subprocess
import sys
import tempfile
from typing import Any

import numpy
import OpenImageIO as oiio

LAYERS = {"--hdr": ("R", "G", "B"), "--alb": ("albedo.R", "albedo.G", "albedo.B"),
          "--nrm": ("normal.X", "normal.Y", "normal.Z")}


def write_pfm(path: str, pixels: Any) -> None:
    """Rows from the bottom to the top, of three little-endian floats a pixel."""
    with open(path, "wb") as file:
        file.write(f"PF\n{pixels.shape[1]} {pixels.shape[0]}\n-1.0\n".encode())
        file.write(pixels[::-1].astype("<f4").tobytes())


def read_pfm(path: str) -> Any:
    with open(path, "rb") as file:
        kind, size, scale = (file.readline().strip() for _ in range(3))
        if kind != b"PF":
            sys.exit(f"{path}: no PFM with three channels")
        width, height = map(int, size.split())
        order = "<f4" if float(scale) < 0 else ">f4"
        return numpy.frombuffer(file.read(), order).reshape(height, width, 3)[::-1]


def main() -> None:
    source, target = sys.argv[1:]
    image = oiio.ImageBuf(source)
    if image.has_error:
        sys.exit(image.geterror())
    names = list(image.spec().channelnames)
    pixels = image.get_pixels(oiio.FLOAT)
    with tempfile.TemporaryDirectory() as folder:
        command = ["oidnDenoise", "-o", os.path.join(folder, "result.pfm")]
        for option, channels in LAYERS.items():
            path = os.path.join(folder, option.strip("-") + ".pfm")
            write_pfm(path, pixels[..., [names.index(name) for name in channels]])
            command += [option, path]
        subprocess.run(command, check=True)
        result = numpy.ascontiguousarray(read_pfm(command[2]), dtype=numpy.float32)
    made = oiio.ImageBuf(oiio.ImageSpec(result.shape[1], result.shape[0], 3, oiio.FLOAT))
    made.set_pixels(oiio.ROI.All, result)
    if not made.write(target):
        sys.exit(made.geterror())


if __name__ == "__main__":
    main()
