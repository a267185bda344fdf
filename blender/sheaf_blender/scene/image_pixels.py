# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Turns the stored pixels of an image into those of Cycles: alpha, color space, tiles."""
import numpy

from .closures import PINK

FIRST_TILE, TILES_ACROSS = 1001, 10
ATLAS_PIXELS_MAX = 1 << 28
TILT_EDGE_PX = 256  # At least this many rows and columns are read.


def linear_from_srgb(encoded):
    return numpy.where(encoded <= 0.04045, encoded / 12.92,
                       ((numpy.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4).astype(numpy.float32)


def srgb_from_linear(linear):
    return numpy.where(linear <= 0.0031308, linear * 12.92,
                       1.055 * numpy.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def has_alpha(pixels):
    """Whether any pixel is not opaque. pixels: (height, width, channels)."""
    return pixels.shape[2] == 4 and bool((pixels[:, :, 3] != 1).any())


def colors(pixels, alpha, is_encoded):
    """(height, width, 3) linear float32.

    alpha: "multiply" for colors that alpha has not yet scaled, "divide" for those that it has and
    that are wanted without, "encode" for linear ones that it has scaled and that the file holds in
    sRGB, "keep" otherwise. is_encoded: whether they are sRGB. Alpha scales the encoded color, as in
    Cycles.
    """
    found = pixels[:, :, :3] if pixels.shape[2] >= 3 else numpy.repeat(pixels[:, :, :1], 3, axis=2)
    if pixels.shape[2] == 4 and alpha != "keep":
        opacity = pixels[:, :, 3:4]
        if alpha != "multiply":
            found = found / numpy.where(opacity > 0, opacity, 1)
        if alpha == "encode":
            return linear_from_srgb(srgb_from_linear(found) * opacity)
        if alpha == "multiply":
            found = found * opacity
    return linear_from_srgb(found) if is_encoded else numpy.ascontiguousarray(found, numpy.float32)


def alphas(pixels):
    """(height, width, 3): the alpha of each pixel, 1 without a channel for it."""
    if pixels.shape[2] < 4:
        return numpy.ones((*pixels.shape[:2], 3), numpy.float32)
    return numpy.repeat(pixels[:, :, 3:4], 3, axis=2)


def mean_tilt_degrees(pixels):
    """The mean angle of tangent space normals from the surface's; of every few pixels."""
    step = max(1, max(pixels.shape[:2]) // TILT_EDGE_PX)
    normals = 2 * pixels[::step, ::step].astype(numpy.float64) - 1
    length = numpy.maximum(numpy.linalg.norm(normals, axis=-1), 1e-9)
    return float(numpy.degrees(numpy.arccos(numpy.clip(normals[..., 2] / length, -1, 1))).mean())


def atlas(tiles):
    """(pixels, columns, rows): the tiles {number: (height, width, 3)} side by side, at the size of
    the largest; pink where there is none, as in Cycles. Raises ValueError if they are too large.
    """
    places = {number: divmod(number - FIRST_TILE, TILES_ACROSS) for number in tiles}
    rows = max(row for row, _ in places.values()) + 1
    columns = max(column for _, column in places.values()) + 1
    height = max(pixels.shape[0] for pixels in tiles.values())
    width = max(pixels.shape[1] for pixels in tiles.values())
    if rows * height * columns * width > ATLAS_PIXELS_MAX:
        raise ValueError(f"its tiles have more than {ATLAS_PIXELS_MAX} pixels together; shrink "
                         "them")
    result = numpy.empty((rows * height, columns * width, 3), numpy.float32)
    result[:] = PINK
    for number, pixels in tiles.items():
        row, column = places[number]
        y = numpy.arange(height) * pixels.shape[0] // height
        x = numpy.arange(width) * pixels.shape[1] // width
        result[row * height:(row + 1) * height, column * width:(column + 1) * width] = (
            pixels[y][:, x])
    return result, columns, rows
