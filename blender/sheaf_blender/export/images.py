# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Images of Blender as files of the content folder: copied where the file has what Cycles sees,
otherwise written anew.
"""
import dataclasses
import hashlib
import os
import pathlib
import tempfile

import bpy
import numpy

from ..farm import images as image_files
from ..scene import image_pixels, pixel_ops, values

_COPIED = {".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".tga", ".bmp"}
_LINEAR_SPACES = {"Non-Color", "Linear", "Raw", "Linear Rec.709", "Generic Data"}
_SRGB_SPACES = {"sRGB"}
_FLOAT_SUFFIXES = {".exr", ".hdr"}
_TILE_TOKENS = ("<UDIM>", "<UVTILE>")


@dataclasses.dataclass(frozen=True)
class _Source:
    """An image and what is read of it. path: of the file that may be copied, or None."""
    image: object
    path: str | None
    reads_alpha: bool
    alpha: str          # See image_pixels.colors.
    is_encoded: bool    # Whether Blender's pixels are sRGB.
    tiles: tuple = ()   # ((number, path), ...)


class Images:
    """Gives images names (values.ImageValue.source) and writes them when they are used."""

    def __init__(self, content, report):
        self._content, self._report = content, report
        self._images = {}   # By source.
        self._files = {}    # By source, encoding and operations.
        self._pixels = {}
        self._stored = {}   # Blender's pixels, by image and frame.

    def value(self, image, user, wrap, mapping, filter_name, wants_alpha=False,
              is_alpha_used=False):
        """A value, or None, which is reported, if the image is missing. wants_alpha: whether its
        alpha is the value; is_alpha_used: whether alpha is used beside the color, which then is not
        scaled by it.
        """
        tiles = self._tiles(image)
        path = None if tiles else self._plain_file(image, user)
        problem = self._problem(image, path, tiles)
        if problem:
            self._report.left_out(f'image "{image.name}"', f"{problem}; it is pink")
            return None
        if wants_alpha and (image.alpha_mode == "NONE" or image.channels < 4 and not tiles):
            return 1.0
        encoding = self._encoding(image, path)
        found = self._source(image, user, path, tiles, encoding, wants_alpha, is_alpha_used)
        source = "|".join((image.name_full, found.path or "", found.alpha,
                           self._frame(image, user), "a" if wants_alpha else ""))
        self._images[source] = found
        if tiles:
            _, columns, rows = self._atlas(source)
            mapping = (mapping[0] / columns, mapping[1] / rows, mapping[2] / columns,
                       mapping[3] / rows)
        operations = (("gray", ()),) if wants_alpha else ()
        return values.ImageValue(source, encoding, wrap, mapping, operations, filter_name)

    @staticmethod
    def _problem(image, path, tiles):
        """Why the image has no pixels; empty if it has some."""
        if tiles:
            return ""
        try:
            if path is None and not image.has_data:
                image.update()
            if image.size[0] and image.size[1]:
                return ""
        except RuntimeError:
            pass
        if image.source in ("FILE", "SEQUENCE", "MOVIE", "TILED") and not image.packed_file:
            return f"{bpy.path.abspath(image.filepath)}: the file is missing or cannot be read"
        return f"its source {image.source} has no pixels"

    def _encoding(self, image, path):
        """"linear" or "sRGB", of the file."""
        space = image.colorspace_settings.name
        is_float = image.is_float or (path and pathlib.Path(path).suffix.lower() in _FLOAT_SUFFIXES)
        if space in _LINEAR_SPACES or is_float:  # Blender has made floats linear.
            return "linear"
        if space not in _SRGB_SPACES:
            self._report.approximated(f'image "{image.name}"',
                                      f'color space "{space}" is read as sRGB')
        return "sRGB"

    def _source(self, image, user, path, tiles, encoding, wants_alpha, is_alpha_used):
        space = image.colorspace_settings.name
        is_data = space in _LINEAR_SPACES and "Linear" not in space
        is_encoded = encoding == "sRGB" and not image.is_float
        alpha = "keep"
        # Blender scales floats by alpha when it loads them, and bytes not.
        if not is_data and image.alpha_mode in ("STRAIGHT", "PREMUL") and not wants_alpha:
            if image.is_float:
                alpha = ("divide" if is_alpha_used else
                         "encode" if space in _SRGB_SPACES else "keep")
            else:
                alpha = "keep" if is_alpha_used else "multiply"
        if alpha != "keep" and not tiles:
            stored = self._stored_pixels(image, user)
            if stored is None or not image_pixels.has_alpha(stored):
                alpha = "keep"
        # Floats of a space that is not linear, as PNGs of 16 bits, are linear in Blender alone.
        is_changed = alpha != "keep" or (image.is_float and space not in _LINEAR_SPACES)
        return _Source(image, None if is_changed or wants_alpha else path, wants_alpha, alpha,
                       is_encoded, tiles)

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
        if isinstance(value, (values.NodeValue, values.RampValue)):
            return float(values.node_ramp(value)[1].mean())
        if isinstance(value, values.ScaleValue):
            return self.mean(value.value) * self.mean(value.factor)
        if isinstance(value, values.ChannelsValue):
            return sum(map(self.mean, value.parts)) / 3
        amount = self.mean(value.amount) if isinstance(value, values.MixValue) else 0.5
        return self.mean(value.first) * (1 - amount) + self.mean(value.second) * amount

    def pixels(self, value):
        """(height, width, 3) float32 after the operations, rows from the bottom; or None."""
        key = (value.source, value.encoding)
        if key not in self._pixels:
            self._pixels[key] = self._read(value.source)
        pixels = self._pixels[key]
        if pixels is None or not value.operations:
            return pixels
        shape = pixels.shape
        changed = pixel_ops.run(pixels.reshape(-1, 3).astype(numpy.float64), value.operations)
        return changed.reshape(shape).astype(numpy.float32)

    def _write(self, value):
        found = self._images[value.source]
        image = found.image
        if found.path is not None and not value.operations:
            try:
                return self._content.put_file(found.path), value.encoding
            except OSError as error:
                self._report.left_out(f'image "{image.name}"', f"{found.path}: {error.strerror}")
                return None
        pixels = self.pixels(value)
        if pixels is None:
            self._report.left_out(f'image "{image.name}"', "it has no pixels")
            return None
        return write_pixels(self._content, pixels), "linear"

    # Pixels.

    def _read(self, source):
        found = self._images[source]
        if found.tiles:
            return self._atlas(source)[0]
        stored = self._stored_pixels(found.image, None)
        return None if stored is None else _converted(stored, found)

    def _stored_pixels(self, image, user):
        """Blender's own, (height, width, channels), rows from the bottom."""
        key = (image.name_full, self._frame(image, user))
        if key not in self._stored:
            width, height = image.size
            flat = numpy.empty(width * height * image.channels, numpy.float32)
            image.pixels.foreach_get(flat)
            self._stored[key] = (flat.reshape(height, width, image.channels) if len(flat)
                                 else None)
        return self._stored[key]

    def _atlas(self, source):
        key = (source, "atlas")
        if key not in self._pixels:
            found = self._images[source]
            self._pixels[key] = image_pixels.atlas({
                number: _converted(image_files.read_float(path)[::-1], found)
                for number, path in found.tiles})
        return self._pixels[key]

    def _tiles(self, image):
        """((number, path), ...) of the files of an image of tiles; those that are missing are
        reported.
        """
        if image.source != "TILED" or not any(token in image.filepath for token in _TILE_TOKENS):
            return ()
        found = []
        for tile in image.tiles:
            v, u = divmod(tile.number - image_pixels.FIRST_TILE, image_pixels.TILES_ACROSS)
            name = image.filepath.replace("<UDIM>", str(tile.number)).replace(
                "<UVTILE>", f"u{u + 1}_v{v + 1}")
            path = bpy.path.abspath(name, library=image.library)
            if os.path.isfile(path):
                found.append((tile.number, path))
            else:
                self._report.left_out(f'image "{image.name}"', f"{path}: the tile is missing; it "
                                                               "is pink")
        return tuple(found)

    @staticmethod
    def _frame(image, user):
        return str(user.frame_current) if user and image.source in ("SEQUENCE", "MOVIE") else ""

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


def _converted(stored, found):
    if found.reads_alpha:
        return image_pixels.alphas(stored)
    return image_pixels.colors(stored, found.alpha, found.is_encoded)


def write_pixels(content, pixels):
    """Stores linear pixels, rows from the bottom, as an EXR; returns its path."""
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
