# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Pixels of a frame and of its render region, by Blender's own arithmetic: percentages in integers,
edges of the region in float32, both rounded down.
"""
import numpy


def size_of(resolution_x, resolution_y, percentage):
    """(width, height) in pixels."""
    return (max(1, resolution_x * percentage // 100), max(1, resolution_y * percentage // 100))


def window_of(border, width, height):
    """x0, x1, y0, y1 of the region in pixels, y from the top. border: its left, right, bottom and
    top edge as fractions of the frame, y from the bottom.
    """
    left, right, bottom, top = (int(numpy.float32(edge) * numpy.float32(size))
                                for edge, size in zip(border, (width, width, height, height)))
    left, bottom = min(left, width - 1), min(bottom, height - 1)
    right, top = max(right, left + 1), max(top, bottom + 1)
    return left, right, height - top, height - bottom
