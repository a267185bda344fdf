# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Hair: particle systems, and objects of the type Curves, as strands of cubic Bezier curves."""
import dataclasses

import numpy

from ..scene import strands

STRANDS_MAX = 2_000_000


@dataclasses.dataclass(frozen=True)
class Strands:
    """points: (n, 3) in the space of the world or of the object; counts: points of each strand."""
    points: numpy.ndarray
    counts: numpy.ndarray
    root_radius: float
    tip_radius: float


def read_curves_object(data):
    """The Strands of a Curves data-block, in its own space; None if there are none."""
    point_count, curve_count = len(data.points), len(data.curves)
    if curve_count == 0 or curve_count > STRANDS_MAX:
        return None
    points = numpy.empty(3 * point_count, numpy.float32)
    data.points.foreach_get("position", points)
    counts = numpy.empty(curve_count, numpy.int32)
    data.curves.foreach_get("points_length", counts)
    firsts = numpy.concatenate([[0], numpy.cumsum(counts)[:-1]])
    radius = data.attributes.get("radius")
    radii = numpy.full(point_count, 0.005, numpy.float32)  # As Cycles without the attribute.
    if radius is not None and radius.domain == "POINT":
        radius.data.foreach_get("value", radii)
    return Strands(points.reshape(-1, 3), counts, float(radii[firsts].mean()),
                   float(radii[firsts + counts - 1].mean()))


def read_particle_hair(instance_object, system):
    """The Strands of a hair system, in world space; None if there are none.

    Blender gives points of particles only one by one.
    """
    settings = system.settings
    steps = 1 << settings.render_step
    parents, children = len(system.particles), len(system.child_particles)
    first = parents if children and not settings.use_parent_particles else 0
    strand_count = parents + children - first
    if strand_count == 0 or strand_count > STRANDS_MAX:
        return None
    points, counts = [], []
    for index in range(first, parents + children):
        before = len(points)
        for step in range(steps + 1):
            point = system.co_hair(object=instance_object, particle_no=index, step=step)
            if step and tuple(point) == (0.0, 0.0, 0.0):
                break  # Blender's answer beyond the end of a strand.
            points.append(tuple(point))
        counts.append(len(points) - before)
    scale = settings.radius_scale * 0.5 * instance_object.matrix_world.median_scale
    return Strands(numpy.array(points, numpy.float32), numpy.array(counts, numpy.int32),
                   settings.root_radius * scale,
                   0.0 if settings.use_close_tip else settings.tip_radius * scale)


def text_of(read):
    """The scene text of the strands."""
    return strands.strands_text(read.points, read.counts, 2 * read.root_radius,
                                2 * read.tip_radius)
