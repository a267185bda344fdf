# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Texture nodes in the space of objects: each place of such an object has a material of its own."""
import dataclasses

import numpy

from ..scene import values

_OF_OBJECTS = ("object", "generated")


def by_place(geometry):
    """The geometry, or one for each of its places, with its nodes in world space."""
    if not any(node.space in _OF_OBJECTS for part in geometry.parts
               for node in values.nodes_of(part.shading)):
        return [geometry]
    return [dataclasses.replace(geometry, parts=[_placed(part, geometry, matrix)
                                                 for part in geometry.parts],
                                matrices=[matrix], object_names=[name], keys=[key], groups=[group])
            for matrix, name, key, group in zip(geometry.matrices, geometry.object_names,
                                                geometry.keys, geometry.groups)]


def _placed(part, geometry, matrix):
    """matrix: world from object; None for the identity."""
    world = numpy.identity(4) if matrix is None else numpy.array(matrix, numpy.float64)
    return dataclasses.replace(part, shading=values.with_nodes(
        part.shading, lambda node: in_world_space(node, geometry.texture_space, world)))


def in_world_space(node, texture_space, world_from_object):
    """The NodeValue with world space in place of an object's."""
    if node.space not in _OF_OBJECTS:
        return node
    found = numpy.array(node.matrix).reshape(4, 4)
    if node.space == "generated":
        found = found @ _generated_from_object(*texture_space)
    if abs(numpy.linalg.det(world_from_object)) > 1e-300:  # Else it is flat, and has no inverse.
        found = found @ numpy.linalg.inv(world_from_object)
    return dataclasses.replace(node, space="world", matrix=tuple(map(float, found.ravel())))


def _generated_from_object(center, half_size):
    """The box becomes the unit cube; without extent it is 2 wide."""
    found = numpy.identity(4)
    for axis in range(3):
        width = 2 * (abs(half_size[axis]) or 1.0)
        found[axis, axis] = 1 / width
        found[axis, 3] = 0.5 - center[axis] / width
    return found
