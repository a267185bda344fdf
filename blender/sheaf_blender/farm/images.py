# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes images with OpenImageIO (Debian: python3-openimageio)."""
import os
import tempfile

import numpy


class ImageError(Exception):
    """What, why and what to do, in one line."""


def library():
    try:
        import OpenImageIO
    except ImportError as error:
        raise ImageError("Blender's Python has no OpenImageIO, with which images are read; install "
                         "python3-openimageio (Debian), or use a Blender that brings it") from error
    return OpenImageIO


class Layers:
    """The channels of an EXR by name, each (height, width) float32, rows from the top."""

    def __init__(self, channels, window, metadata):
        self.channels, self.window, self.metadata = channels, window, metadata

    def stack(self, *names):
        """(height, width, n), or None if a channel is missing."""
        if any(name not in self.channels for name in names):
            return None
        return numpy.stack([self.channels[name] for name in names], axis=-1)


def read_layers(path):
    """Raises ImageError."""
    oiio = library()
    file = oiio.ImageInput.open(path)
    if file is None:
        raise ImageError(f"{path}: cannot be read: {oiio.geterror().strip()}; render again")
    try:
        spec = file.spec()
        values = file.read_image(oiio.FLOAT)
        if values is None:
            raise ImageError(f"{path}: cannot be read: {file.geterror().strip()}; render again")
        values = values.reshape(spec.height, spec.width, spec.nchannels)
        channels = {name: values[:, :, i] for i, name in enumerate(spec.channelnames)}
        metadata = {attribute.name: attribute.value for attribute in spec.extra_attribs}
        return Layers(channels, (spec.x, spec.y, spec.width, spec.height), metadata)
    finally:
        file.close()


def read_float(path):
    """(height, width, channels) float32 as they are in the file, rows from the top. Raises
    ImageError.
    """
    oiio = library()
    file = oiio.ImageInput.open(path)
    if file is None:
        raise ImageError(f"{path}: cannot be read: {oiio.geterror().strip()}; save it again")
    try:
        spec = file.spec()
        pixels = file.read_image(oiio.FLOAT)
        if pixels is None:
            raise ImageError(f"{path}: cannot be read: {file.geterror().strip()}; save it again")
        return pixels.reshape(spec.height, spec.width, spec.nchannels)[:, :, :4]
    finally:
        file.close()


def write_float(path, pixels):
    """Writes an EXR of linear floats. pixels: (height, width, 3), rows from the top."""
    oiio = library()
    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, 3, oiio.FLOAT)
    spec.attribute("compression", "zip")
    output = oiio.ImageOutput.create(path)
    try:
        if not (output and output.open(path, spec)
                and output.write_image(numpy.ascontiguousarray(pixels, numpy.float32))):
            raise ImageError(f"{path}: cannot be written: "
                             f"{(output.geterror() if output else oiio.geterror()).strip()}")
    finally:
        if output:
            output.close()


def decode_light(png):
    """The layer "light" of a preview: mantissas above exponents (Ward's RGBE), as linear floats."""
    oiio = library()
    with tempfile.TemporaryDirectory(prefix="sheaf-") as folder:
        path = os.path.join(folder, "light.png")
        with open(path, "wb") as file:
            file.write(png)
        levels = oiio.ImageInput.open(path)
        if levels is None:
            return None
        try:
            values = levels.read_image(oiio.UINT8)
        finally:
            levels.close()
    if values is None:
        return None
    half = values.shape[0] // 2
    exponents = values[half:2 * half].astype(numpy.int32)
    light = numpy.ldexp(values[:half].astype(numpy.float32), exponents - 136)
    return numpy.where(exponents > 0, light, 0).astype(numpy.float32)


def enlarged(pixels, width, height):
    """Repeats the pixels of a preview that was shrunk by an integer factor."""
    factor = max(1, -(-width // pixels.shape[1]), -(-height // pixels.shape[0]))
    if factor > 1:
        pixels = numpy.repeat(numpy.repeat(pixels, factor, axis=0), factor, axis=1)
    return pixels[:height, :width]
