# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes whose materials read attributes of meshes: colors of points and of corners, numbers."""
import math

import bpy
import numpy

SIDE = 5  # Squares along each side of a tile.


def painted_tile(b, name, place, material):
    """A tile of squares with a float color of points, a byte color of corners, and numbers of
    points and of faces.
    """
    side = numpy.linspace(-0.95, 0.95, SIDE + 1)
    points = [(x, 0, z) for z in side for x in side]
    row = SIDE + 1
    faces = [(j * row + i, j * row + i + 1, (j + 1) * row + i + 1, (j + 1) * row + i)
             for j in range(SIDE) for i in range(SIDE)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    random = numpy.random.default_rng(7)
    for title, kind, domain, count in (
            ("Bytes", "BYTE_COLOR", "CORNER", len(mesh.loops)),
            ("Floats", "FLOAT_COLOR", "POINT", len(points))):
        color = mesh.color_attributes.new(title, kind, domain)
        color.data.foreach_set("color", random.random(4 * count).astype(numpy.float32))
    for title, domain, count in (("Numbers", "POINT", len(points)), ("Faces", "FACE", len(faces))):
        numbers = mesh.attributes.new(title, "FLOAT", domain)
        numbers.data.foreach_set("value", random.random(count).astype(numpy.float32))
    mesh.color_attributes.render_color_index = 1  # Floats.
    made = b.add(name, mesh, None, material)
    made.location = place
    return made


def attribute(nodes, kind, name):
    node = nodes.new("ShaderNodeVertexColor" if kind == "color" else "ShaderNodeAttribute")
    if kind == "color":
        node.layer_name = name
    else:
        node.attribute_name = name
    return node


def tiles(b, makers):
    """A tile for each (kind of node, name, output, function of (nodes, links, socket) or None)."""
    columns = math.ceil(math.sqrt(len(makers)))
    rows = math.ceil(len(makers) / columns)
    b.camera((0, -4.2 * columns, 0), (0, 0, 0), 50)
    b.background(1.0)
    for i, (kind, name, output, behind) in enumerate(makers):
        material, nodes, links, surface = b.empty_material(f"Tile {i}")
        socket = attribute(nodes, kind, name).outputs[output]
        if behind is not None:
            socket = behind(nodes, links, socket)
        shader = nodes.new("ShaderNodeBsdfDiffuse")
        links.new(socket, shader.inputs["Color"])
        links.new(shader.outputs[0], surface.inputs["Surface"])
        painted_tile(b, f"Tile {i}", (2.1 * (i % columns - (columns - 1) / 2), 0,
                                      2.1 * ((rows - 1) / 2 - i // columns)), material)


def colors_of_vertices(b):
    tiles(b, (("color", "Bytes", "Color", None), ("color", "Floats", "Color", None),
              ("color", "", "Color", None), ("color", "Bytes", "Alpha", None),
              ("attribute", "Floats", "Color", None), ("attribute", "Floats", "Fac", None),
              ("attribute", "Numbers", "Fac", None), ("attribute", "Faces", "Fac", None),
              ("attribute", "Nothing", "Color", None)))


def _ramp(nodes, links, socket):
    node = nodes.new("ShaderNodeValToRGB")
    node.color_ramp.elements[0].color = (0.8, 0.1, 0.05, 1)
    node.color_ramp.elements[1].color = (0.1, 0.3, 0.7, 1)
    node.color_ramp.elements.new(0.5).color = (0.9, 0.9, 0.2, 1)
    links.new(socket, node.inputs["Fac"])
    return node.outputs["Color"]


def _tinted(nodes, links, socket):
    node = nodes.new("ShaderNodeMixRGB")
    node.blend_type = "MULTIPLY"
    node.inputs["Fac"].default_value = 0.7
    node.inputs["Color2"].default_value = (0.3, 0.9, 0.5, 1)
    links.new(socket, node.inputs["Color1"])
    return node.outputs["Color"]


def _green(nodes, links, socket):
    node = nodes.new("ShaderNodeSeparateRGB")
    links.new(socket, node.inputs[0])
    return node.outputs["G"]


def colors_by_nodes(b):
    tiles(b, (("color", "Floats", "Color", _ramp), ("color", "Bytes", "Color", _tinted),
              ("color", "Bytes", "Color", _green), ("attribute", "Numbers", "Fac", _ramp)))


def colors_turned(b):
    """Operations that are not those of mixing: reported."""
    def turned(nodes, links, socket):
        node = nodes.new("ShaderNodeHueSaturation")
        node.inputs["Hue"].default_value = 0.8
        links.new(socket, node.inputs["Color"])
        return node.outputs["Color"]
    tiles(b, (("color", "Floats", "Color", turned),))


def colors_of_two(b):
    """One material reads two attributes: reported."""
    def both(nodes, links, socket):
        node = nodes.new("ShaderNodeMixRGB")
        links.new(socket, node.inputs["Color1"])
        links.new(attribute(nodes, "color", "Floats").outputs["Color"], node.inputs["Color2"])
        return node.outputs["Color"]
    tiles(b, (("color", "Bytes", "Color", both),))
