# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Images as numpy arrays, by layer. OpenImageIO reads the EXR files (Debian: python3-openimageio).

docs/outputs.md says what the layers mean.
"""
from __future__ import annotations

import dataclasses
import os
from typing import Any, Mapping

import numpy
import numpy.typing

from sheaf import errors

Array = numpy.typing.NDArray[numpy.float32]

_METADATA_PREFIX = "sheaf:"
_COMPONENT_ORDER = "RGBAXYZ"
_ROW_PARTS = {"size": "x", "window": ","}


@dataclasses.dataclass(frozen=True)
class ErrorPoint:
    """A point of the error curve: mean samples of a pixel, relMSE, and its upper bound."""
    samples_per_pixel: float
    relative_mse: float
    relative_mse_upper: float


@dataclasses.dataclass(frozen=True, eq=False)
class Image:
    """The pixels that were rendered: rows from the top, float32, linear light.

    Layers of one channel have the shape (height, width), others (height, width, channels). The
    image itself, R, G and B, is `rgb`, and no layer: a group of lights may have any name.
    """
    rgb: Array
    layers: Mapping[str, Array]
    window: tuple[int, int, int, int]  # x0, y0, x1, y1 in the uncropped frame, half-open.
    metadata: Mapping[str, str]  # "relativeMse" and the like: the keys without "sheaf:".

    def layer(self, name: str) -> Array:
        """Raises NotFoundError, which lists the layers that there are."""
        if name not in self.layers:
            raise errors.NotFoundError(f'the image has no layer "{name}"; it has '
                                       + ", ".join(sorted(self.layers)))
        return self.layers[name]

    @property
    def error(self) -> Array:
        """The standard error of R, G and B of each pixel."""
        return self.layer("stderr")

    @property
    def samples(self) -> Array:
        """The number of samples of each pixel."""
        return self.layer("samples")

    @property
    def relative_mse(self) -> float | None:
        """The estimated distance to the converged image; None if it is unknown."""
        return _number(self.metadata.get("relativeMse"))

    @property
    def flip(self) -> float | None:
        """The same as mean FLIP, from 0 to 1; None if it is unknown."""
        return _number(self.metadata.get("flip"))

    @property
    def error_curve(self) -> tuple[ErrorPoint, ...]:
        """How the error fell."""
        points = self.metadata.get("errorCurve", "").split(", ")
        return tuple(ErrorPoint(*map(float, point.split())) for point in points if point)


def read_image(path: str | os.PathLike[str]) -> Image:
    """Reads an EXR. Raises FileError, and MissingLibraryError without OpenImageIO."""
    try:
        import OpenImageIO  # Here, because all other calls work without it.
    except ImportError as error:
        raise errors.MissingLibraryError(
            "images cannot be read, because the Python library OpenImageIO is missing; install "
            "python3-openimageio (Debian) or OpenImageIO (pip)") from error
    name = os.fspath(path)
    if not os.path.exists(name):
        raise errors.FileError(f"{name}: there is no such file; check the name")
    file = OpenImageIO.ImageInput.open(name)
    if file is None:
        raise _unreadable(name, OpenImageIO.geterror())
    try:
        spec = file.spec()
        window = (spec.x, spec.y, spec.x + spec.width, spec.y + spec.height)
        metadata = {attribute.name.removeprefix(_METADATA_PREFIX):
                    _text(attribute.name, attribute.value)
                    for attribute in spec.extra_attribs
                    if attribute.name.startswith(_METADATA_PREFIX)}
        channels: list[str] = []
        parts: list[Any] = []
        index = 0
        while True:  # A file has a part for each layer, or one for all.
            values = file.read_image(OpenImageIO.FLOAT)
            if values is None:
                raise _unreadable(name, file.geterror())
            if (spec.x, spec.y, spec.x + spec.width, spec.y + spec.height) == window:
                channels += list(spec.channelnames)
                parts.append(values.reshape(spec.height, spec.width, spec.nchannels))
            index += 1
            if not file.seek_subimage(index, 0):
                break
            spec = file.spec()
        return _image(name, channels, numpy.concatenate(parts, axis=-1), window, metadata)
    finally:
        file.close()


def _image(name: str, channels: list[str], values: Any, window: tuple[int, int, int, int],
           metadata: dict[str, str]) -> Image:
    place = {channel: i for i, channel in enumerate(channels)}
    if not all(channel in place for channel in "RGB"):
        raise errors.FileError(f"{name}: has no channels R, G and B, but {', '.join(channels)}; "
                               "give an image that Sheaf has delivered")
    members: dict[str, list[str]] = {}
    for channel in channels:
        if channel not in ("R", "G", "B"):
            members.setdefault(channel.rpartition(".")[0] or channel, []).append(channel)
    layers = {}
    for layer, its in members.items():
        its.sort(key=lambda channel: (_COMPONENT_ORDER.find(channel[-1]), channel))
        layers[layer] = _planes(values, [place[channel] for channel in its])
    return Image(rgb=_planes(values, [place[channel] for channel in "RGB"]), layers=layers,
                 window=window, metadata=metadata)


def _text(name: str, value: Any) -> str:
    """The text of a number, a size or a window, as versions wrote it that had only texts."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (tuple, list)):
        numbers = list(value)
        separator = _ROW_PARTS.get(name.removeprefix(_METADATA_PREFIX), " ")
        if separator == "," and len(numbers) == 4:  # The file has the last pixel, not the end.
            numbers[2:] = [numbers[2] + 1, numbers[3] + 1]
        return separator.join(map(str, numbers))
    return str(value)


def _planes(values: Any, places: list[int]) -> Array:
    chosen = values[:, :, places[0]] if len(places) == 1 else values[:, :, places]
    return numpy.ascontiguousarray(chosen, dtype=numpy.float32)


def _number(text: str | None) -> float | None:
    return float(text) if text else None


def _unreadable(name: str, why: str) -> errors.FileError:
    return errors.FileError(f"{name}: cannot be read: {why.strip() or 'no reason is known'}; check "
                            "that it is an undamaged EXR")
