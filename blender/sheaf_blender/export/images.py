# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Images of Blender as files of the content folder: copied if they are files, baked if nodes change
them.
"""
import os
import pathlib

import bpy
import numpy

from ..farm import images as image_files
from ..scene import pixel_ops, values

_COPIED = {".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".tga", ".bmp"}
_LINEAR_SPACES = {"Non-Color", "Linear", "Raw", "Linear Rec.709", "Generic Data"}
_SRGB_SPACES = {"sRGB"}
_FLOAT_SUFFIXES = {".exr", ".hdr"}


class Images:
    """Gives images names (values.ImageValue.source) and writes them when they are used."""

    def __init__(self, content, report):
        self._content, self._report = content, report
        self._images = {}   # By source: (Blender's image, path of a plain file or None, frame).
        self._files = {}    # By source, encoding and operations.
        self._pixels = {}

    def value(self, image, user, wrap, mapping, filter_name, wants_alpha=False):
        """An ImageValue, or None if the image has no pixels."""
        path = self._plain_file(image, user)
        if path is None and not image.has_data:
            image.update()
            if image.size[0] == 0:
                return None
        if wants_alpha and image.channels < 4:
            return 1.0
        source = f"{image.name_full}|{path or ''}|{'a' if wants_alpha else ''}"
        self._images[source] = (image, path, wants_alpha)
        space = image.colorspace_settings.name
        is_float = image.is_float or (path and pathlib.Path(path).suffix.lower() in _FLOAT_SUFFIXES)
        if space not in _LINEAR_SPACES | _SRGB_SPACES:
            self._report.approximated(f'image "{image.name}"', f'color space "{space}" is read as '
                                      + ("linear" if is_float else "sRGB"))
        is_linear = is_float or space in _LINEAR_SPACES
        operations = (("gray", ()),) if wants_alpha else ()
        return values.ImageValue(source, "linear" if is_linear else "sRGB", wrap, mapping,
                                 operations, filter_name)

    def file_of(self, value):
        """(path, encoding) of an ImageValue, or None, which is reported."""
        key = (value.source, value.encoding, value.operations)
        if key not in self._files:
            self._files[key] = self._write(value)
        return self._files[key]

    def mean(self, value):
        """The mean of a value over its images, as a number."""
        if values.is_constant(value):
            return float(values.gray(value))
        if isinstance(value, values.ImageValue):
            pixels = self.pixels(value)
            return 0.5 if pixels is None else float(pixels.mean())
        if isinstance(value, values.ScaleValue):
            return self.mean(value.value) * self.mean(value.factor)
        amount = self.mean(value.amount) if isinstance(value, values.MixValue) else 0.5
        return self.mean(value.first) * (1 - amount) + self.mean(value.second) * amount

    def pixels(self, value):
        """(height, width, 3) float32 after the operations, rows from the bottom; or None."""
        image, _, wants_alpha = self._images[value.source]
        key = (value.source, value.encoding)
        if key not in self._pixels:
            self._pixels[key] = _read_pixels(image, value.encoding, wants_alpha)
        pixels = self._pixels[key]
        if pixels is None or not value.operations:
            return pixels
        shape = pixels.shape
        changed = pixel_ops.run(pixels.reshape(-1, 3).astype(numpy.float64), value.operations)
        return changed.reshape(shape).astype(numpy.float32)

    def _write(self, value):
        image, path, wants_alpha = self._images[value.source]
        if path is not None and not value.operations:
            try:
                return self._content.put_file(path), value.encoding
            except OSError as error:
                self._report.left_out(f'image "{image.name}"', f"{path}: {error.strerror}")
                return None
        pixels = self.pixels(value)
        if pixels is None:
            self._report.left_out(f'image "{image.name}"', "it has no pixels")
            return None
        return write_pixels(self._content, pixels), "linear"

    @staticmethod
    def _plain_file(image, user):
        """The path of the file behind the image; None if it is packed, painted or generated."""
        if image.packed_file or image.is_dirty or image.source not in ("FILE", "SEQUENCE"):
            return None
        name = image.filepath_from_user(image_user=user) if user else image.filepath_from_user()
        path = bpy.path.abspath(name, library=image.library)
        if pathlib.Path(path).suffix.lower() not in _COPIED or not os.path.isfile(path):
            return None
        return path


def write_pixels(content, pixels):
    """Stores linear pixels, rows from the bottom, as an EXR; returns its path."""
    import hashlib
    import tempfile
    rows = numpy.ascontiguousarray(pixels[::-1], numpy.float32)
    name = hashlib.blake2b(repr(rows.shape).encode() + rows.tobytes(), digest_size=16).hexdigest()
    found = content.find(name, ".exr")
    if found is not None:
        return found
    with tempfile.TemporaryDirectory(prefix="sheaf-") as folder:
        partial = os.path.join(folder, "image.exr")
        image_files.write_float(partial, rows)
        with open(partial, "rb") as file:
            data = file.read()
    return content.put_named(name, ".exr", lambda out: out.write(data))


def _read_pixels(image, encoding, wants_alpha):
    width, height = image.size
    if width == 0 or height == 0:
        return None
    flat = numpy.empty(width * height * image.channels, numpy.float32)
    image.pixels.foreach_get(flat)
    pixels = flat.reshape(height, width, image.channels)
    if wants_alpha:
        return numpy.repeat(pixels[:, :, 3:4], 3, axis=2)
    pixels = pixels[:, :, :3] if image.channels >= 3 else numpy.repeat(pixels[:, :, :1], 3, axis=2)
    if encoding == "sRGB" and not image.is_float:
        return numpy.where(pixels <= 0.04045, pixels / 12.92,
                           ((numpy.maximum(pixels, 0) + 0.055) / 1.055) ** 2.4)
    return pixels
