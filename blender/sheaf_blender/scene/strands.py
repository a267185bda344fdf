# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Strands as directives of curves."""
import numpy


def bezier_points(points):
    """Cubic Bezier points (3 n - 2) of the Catmull-Rom curve through n points, as Cycles draws it:
    the ends are repeated.
    """
    before = numpy.concatenate([points[:1], points[:-1]])
    after = numpy.concatenate([points[1:], points[-1:]])
    tangents = (after - before) / 6
    result = numpy.empty((3 * len(points) - 2, 3), points.dtype)
    result[0::3] = points
    result[1::3] = points[:-1] + tangents[:-1]
    result[2::3] = points[1:] - tangents[1:]
    return result


def strands_text(points, counts, root_width, tip_width):
    """A Shape "curve" for each strand of two points or more."""
    lines = []
    end = 0
    for count in counts:
        start, end = end, end + int(count)
        if count < 2:
            continue
        numbers = " ".join("%.7g" % x for x in bezier_points(points[start:end]).reshape(-1))
        lines.append(f'Shape "curve" "float width0" {root_width:.7g} "float width1" {tip_width:.7g}'
                     f' "point3 P" [{numbers}]')
    return "\n".join(lines)
