# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The world: a color, or an environment texture as an equal-area map."""
import math

import mathutils
import numpy

from ..scene import sphere_map, values
from . import node_links
from .images import write_pixels
from .node_values import NodeValues

BLACK = (0.0, 0.0, 0.0)


def write_world(text, world, images, content, report):
    if world is None:
        return
    item = f'world "{world.name}"'
    if not world.use_nodes or world.node_tree is None:
        _constant(text, tuple(world.color))
        return
    output = node_links.output_node(world.node_tree)
    if output is None:
        return
    place = node_links.Place(output)
    if node_links.source(node_links.input_of(place, "Volume"))[0] is not None:
        report.left_out(item, "the Volume of the world; put a large box with that volume around "
                              "the scene")
    shader = node_links.source(node_links.input_of(place, "Surface"))[0]
    if shader is None:
        return
    if shader.node.type == "MIX_SHADER":
        report.left_out(item, f'"{shader.node.name}"; its second shader is used')
        shader = node_links.source(node_links.Input(shader.node.inputs[2], shader.groups))[0]
    if shader is None or shader.node.type not in ("BACKGROUND", "EMISSION"):
        report.left_out(item, "its shader, which is not a Background; the world is black")
        return
    reader = NodeValues(item, report, images)
    strength = reader.number(node_links.input_of(shader, "Strength"), 1.0)
    wanted = node_links.input_of(shader, "Color")
    environment, _, _ = node_links.source(wanted)
    if environment is not None and environment.node.type == "TEX_ENVIRONMENT":
        _map(text, environment, strength, images, content, item, report)
        return
    color = reader.read(wanted)
    if not values.is_constant(color):
        report.left_out(item, "a texture that is no Environment Texture; its mean is used")
        color = images.mean(color)
    _constant(text, tuple(strength * c for c in values.color(color)))


def _constant(text, radiance):
    if max(radiance) > 0:
        text.directive("LightSource", "infinite", {"rgb L": tuple(max(0.0, c) for c in radiance)})


def _map(text, place, strength, images, content, item, report):
    node = place.node
    if node.image is None:
        _constant(text, (strength, 0.0, strength))  # Cycles shows a missing image in pink.
        return
    if node.projection != "EQUIRECTANGULAR":
        report.left_out(item, f"projection {node.projection}; the map is read as equirectangular")
    value = images.value(node.image, node.image_user, "repeat", (1.0, 1.0, 0.0, 0.0), "bilinear")
    pixels = None if value is None else images.pixels(value)
    if pixels is None:
        _constant(text, (strength, 0.0, strength))
        return
    square = sphere_map.equal_area_from_equirectangular(numpy.maximum(pixels, 0))
    path = write_pixels(content, square[::-1])
    text.directive("AttributeBegin")
    text.transform("ConcatTransform", _world_from_map(place, item, report))
    text.directive("LightSource", "infinite", {"string filename": path, "float scale": strength})
    text.directive("AttributeEnd")


def _world_from_map(place, item, report):
    """The inverse of the Mapping node, which turns directions before they are looked up."""
    mapping, _, _ = node_links.source(node_links.input_of(place, "Vector"))
    if mapping is None or mapping.node.type == "TEX_COORD":
        return mathutils.Matrix.Identity(4)
    if mapping.node.type != "MAPPING":
        report.left_out(item, f'coordinates of "{mapping.node.name}"')
        return mathutils.Matrix.Identity(4)
    reader = NodeValues(item, report, None)
    rotation = values.color(reader.read(node_links.input_of(mapping, "Rotation"), BLACK))
    scale = values.color(reader.read(node_links.input_of(mapping, "Scale"), (1.0, 1.0, 1.0)))
    if any(abs(abs(s) - abs(scale[0])) > 1e-4 for s in scale):
        report.left_out(item, "a Scale of the map that is not uniform")
        scale = (1.0, 1.0, 1.0)
    signs = mathutils.Matrix.Diagonal([math.copysign(1, s) for s in scale] + [1])
    turn = mathutils.Euler(rotation, "XYZ").to_matrix().to_4x4()
    map_from_world = turn @ signs
    if mapping.node.vector_type == "TEXTURE":
        return map_from_world
    return map_from_world.inverted()
