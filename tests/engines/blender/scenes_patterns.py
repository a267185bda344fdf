# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes of texture nodes: one node on each tile of a wall, in several coordinates."""
import math

import bpy

# Type of node, its attributes, its inputs, the output that is seen.
NODES = (
    ("Noise", {}, {}, "Fac"),
    ("Noise", {}, {"Scale": 3, "Detail": 4.5, "Roughness": 0.7, "Distortion": 1.5}, "Color"),
    ("Noise", {"noise_dimensions": "2D"}, {"Scale": 8, "Detail": 0}, "Color"),
    ("Voronoi", {}, {}, "Distance"),
    ("Voronoi", {"feature": "F2", "distance": "MANHATTAN"}, {"Randomness": 0.7}, "Distance"),
    ("Voronoi", {"feature": "SMOOTH_F1"}, {"Smoothness": 0.8}, "Color"),
    ("Voronoi", {"feature": "DISTANCE_TO_EDGE"}, {"Scale": 4}, "Distance"),
    ("Voronoi", {"voronoi_dimensions": "2D", "distance": "CHEBYCHEV"}, {}, "Color"),
    ("Wave", {}, {"Scale": 2, "Distortion": 4, "Detail": 3}, "Fac"),
    ("Wave", {"wave_type": "RINGS", "rings_direction": "SPHERICAL", "wave_profile": "SAW"},
     {"Scale": 1, "Phase Offset": 1}, "Color"),
    ("Wave", {"bands_direction": "DIAGONAL", "wave_profile": "TRI"}, {"Scale": 1}, "Fac"),
    ("Magic", {}, {"Scale": 2}, "Color"),
    ("Magic", {"turbulence_depth": 5}, {"Distortion": 1.5}, "Fac"),
    ("Brick", {}, {"Scale": 4}, "Color"),
    ("Brick", {"squash": 1.5, "offset": 0.3, "offset_frequency": 3},
     {"Scale": 3, "Mortar Size": 0.05, "Bias": -0.3}, "Color"),
    ("Gradient", {"gradient_type": "RADIAL"}, {}, "Fac"),
    ("Gradient", {"gradient_type": "SPHERICAL"}, {}, "Color"),
    ("Gradient", {"gradient_type": "EASING"}, {}, "Fac"),
    ("Musgrave", {}, {"Detail": 4}, "Fac"),
    ("Musgrave", {"musgrave_type": "RIDGED_MULTIFRACTAL"}, {"Offset": 0.9, "Gain": 2}, "Fac"),
    ("Musgrave", {"musgrave_type": "MULTIFRACTAL"}, {"Dimension": 1}, "Fac"),
    ("Musgrave", {"musgrave_type": "HYBRID_MULTIFRACTAL"}, {"Offset": 0.3}, "Fac"),
    ("Musgrave", {"musgrave_type": "HETERO_TERRAIN"}, {"Offset": 0.2, "Detail": 3.5}, "Fac"),
    ("WhiteNoise", {}, {}, "Color"))
# Nodes of four dimensions, and Musgrave of two.
FOUR = (
    ("Noise", {"noise_dimensions": "4D"}, {"W": 0.7, "Detail": 3.5, "Distortion": 0.5}, "Color"),
    ("Musgrave", {"musgrave_dimensions": "4D"}, {"W": 0.4, "Detail": 3}, "Fac"),
    ("Musgrave", {"musgrave_dimensions": "2D", "musgrave_type": "RIDGED_MULTIFRACTAL"},
     {"Offset": 0.9}, "Fac"),
    ("Voronoi", {"voronoi_dimensions": "4D"}, {"W": 0.3}, "Color"),
    ("Voronoi", {"voronoi_dimensions": "4D", "feature": "SMOOTH_F1"}, {"W": -1.6}, "Distance"),
    ("Voronoi", {"voronoi_dimensions": "4D", "feature": "DISTANCE_TO_EDGE"}, {"W": 2.2},
     "Distance"))
# Nodes of one dimension: W is a number, or the coordinate that is named last.
LINES = (
    ("Noise", {"noise_dimensions": "1D"}, {"W": 0.33}, "Color", ""),
    ("Noise", {"noise_dimensions": "1D"}, {"Detail": 4.5, "Distortion": 1}, "Color", "X"),
    ("Noise", {"noise_dimensions": "1D"}, {"Scale": 3}, "Fac", "Y"),
    ("Musgrave", {"musgrave_dimensions": "1D"}, {"Detail": 3}, "Fac", "Y"),
    ("Musgrave", {"musgrave_dimensions": "1D", "musgrave_type": "HETERO_TERRAIN"},
     {"Offset": 0.2}, "Fac", "X"),
    ("Voronoi", {"voronoi_dimensions": "1D"}, {}, "Color", "X"),
    ("Voronoi", {"voronoi_dimensions": "1D"}, {"Randomness": 0.8}, "Distance", "Y"),
    ("Voronoi", {"voronoi_dimensions": "1D", "feature": "F2"}, {}, "Distance", "X"),
    ("Voronoi", {"voronoi_dimensions": "1D", "feature": "SMOOTH_F1"}, {}, "Color", "X"),
    ("Voronoi", {"voronoi_dimensions": "1D", "feature": "DISTANCE_TO_EDGE"}, {}, "Distance", "X"),
    ("WhiteNoise", {"noise_dimensions": "1D"}, {"W": 0.7}, "Color", ""),
    ("WhiteNoise", {"noise_dimensions": "4D"}, {"W": 0.7}, "Color", "place"))
# Nodes of Blender 4.0 and later.
OCTAVES = (
    ("Voronoi", {}, {"Detail": 2}, "Distance"),
    ("Voronoi", {"normalize": True}, {"Detail": 2.5, "Roughness": 0.7}, "Distance"),
    ("Voronoi", {"feature": "F2", "distance": "MANHATTAN", "normalize": True}, {"Detail": 1.3},
     "Color"),
    ("Voronoi", {"feature": "F2", "normalize": True}, {"Detail": 1, "Randomness": 0.6},
     "Distance"),
    ("Voronoi", {"feature": "SMOOTH_F1"}, {"Detail": 3, "Lacunarity": 1.7}, "Color"),
    ("Voronoi", {"feature": "DISTANCE_TO_EDGE"}, {"Detail": 2.5, "Roughness": 0.8}, "Distance"),
    ("Voronoi", {"feature": "DISTANCE_TO_EDGE", "normalize": True}, {"Detail": 1.5}, "Distance"),
    ("Voronoi", {"voronoi_dimensions": "2D", "distance": "CHEBYCHEV", "normalize": True},
     {"Detail": 1.5}, "Distance"),
    ("Voronoi", {"voronoi_dimensions": "4D", "normalize": True}, {"Detail": 1, "W": 0.6},
     "Distance"),
    ("Voronoi", {"normalize": True}, {}, "Distance"),
    ("Noise", {"normalize": False}, {"Detail": 3, "Lacunarity": 2.5}, "Fac"),
    ("Noise", {"noise_dimensions": "4D"}, {"W": 0.7, "Roughness": 0.9}, "Color"))
# Types of noise of Blender 4.1 and later. Colors are at most 1, above which Cycles reflects more.
FRACTALS = (
    ("Noise", {"noise_type": "MULTIFRACTAL"}, {"Detail": 3, "Roughness": 0.4}, "Fac"),
    ("Noise", {"noise_type": "HYBRID_MULTIFRACTAL"}, {"Offset": 0.1, "Distortion": 0.7}, "Color"),
    ("Noise", {"noise_type": "HYBRID_MULTIFRACTAL"}, {"Detail": 4, "Offset": 0.3, "Gain": 1.5},
     "Fac"),
    ("Noise", {"noise_type": "HYBRID_MULTIFRACTAL"}, {"Detail": 2.5, "Offset": 0.4, "Gain": 0.8},
     "Fac"),
    ("Noise", {"noise_type": "RIDGED_MULTIFRACTAL"}, {"Detail": 3.5, "Offset": 0.9, "Gain": 2},
     "Fac"),
    ("Noise", {"noise_type": "RIDGED_MULTIFRACTAL"}, {"Detail": 2, "Offset": 0.8, "Gain": 1},
     "Color"),
    ("Noise", {"noise_type": "HETERO_TERRAIN"}, {"Detail": 3.5, "Offset": 0.2}, "Fac"),
    ("Noise", {"noise_type": "HETERO_TERRAIN"}, {"Detail": 2, "Offset": 0.3, "Lacunarity": 2.5},
     "Color"),
    ("Noise", {"normalize": False}, {"Detail": 3.5, "Roughness": 1.2}, "Fac"),
    ("Noise", {"noise_type": "RIDGED_MULTIFRACTAL", "noise_dimensions": "1D"}, {"Offset": 0.9},
     "Color", "X"),
    ("Noise", {"noise_type": "RIDGED_MULTIFRACTAL", "noise_dimensions": "2D"},
     {"Offset": 0.9, "Gain": 1.5}, "Fac"),
    ("Noise", {"noise_type": "HETERO_TERRAIN", "noise_dimensions": "4D"},
     {"W": 0.6, "Offset": 0.2, "Distortion": 0.4}, "Color"))
COLUMNS = 6


def known(nodes):
    """Those that this Blender has: it had Musgrave until 4.0."""
    return [node for node in nodes if hasattr(bpy.types, f"ShaderNodeTex{node[0]}")]


def node_of(b, nodes, kind, attributes, inputs):
    node = nodes.new(f"ShaderNodeTex{kind}")
    for name, value in attributes.items():
        setattr(node, name, value)
    b.fill(node, inputs)
    return node


def painted(b, name, node, coordinates, behind=None):
    """A diffuse material of the node. coordinates: (node tree's nodes, links) -> output or None."""
    kind, attributes, inputs, output, *along = node
    material, nodes, links, surface = b.empty_material(name)
    texture, shader = node_of(b, nodes, kind, attributes, inputs), nodes.new(
        "ShaderNodeBsdfDiffuse")
    place = coordinates(nodes, links)
    if along and along[0] in ("X", "Y"):
        separate = nodes.new("ShaderNodeSeparateXYZ")
        links.new(place, separate.inputs[0])
        links.new(separate.outputs[along[0]], texture.inputs["W"])
    elif place is not None and along != [""]:
        links.new(place, texture.inputs["Vector"])
    color = texture.outputs[output]
    if behind is not None:
        color = behind(nodes, links, color)
    links.new(color, shader.inputs["Color"])
    links.new(shader.outputs[0], surface.inputs["Surface"])
    return material


def wall(b, coordinates, behind=None, nodes=NODES):
    """All nodes, on tiles that face the camera."""
    nodes = known(nodes)
    rows = math.ceil(len(nodes) / COLUMNS)
    b.camera((0, -14, 0), (0, 0, 0), 50)
    b.background(1.0)
    for i, node in enumerate(nodes):
        tile = b.plane(1.9, painted(b, f"Node {i}", node, coordinates, behind))
        tile.name = f"Tile {i}"
        tile.location = (2.1 * (i % COLUMNS - (COLUMNS - 1) / 2), 0,
                         2.1 * ((rows - 1) / 2 - i // COLUMNS))
        tile.rotation_euler = (math.pi / 2, 0, 0)


def mapped(kind, output, rotation):
    def coordinates(nodes, links):
        place, mapping = nodes.new(kind), nodes.new("ShaderNodeMapping")
        mapping.inputs["Location"].default_value = (0.3, -0.2, 0.1)
        mapping.inputs["Rotation"].default_value = rotation
        mapping.inputs["Scale"].default_value = (1.5, 0.8, 1.2)
        links.new(place.outputs[output], mapping.inputs["Vector"])
        return mapping.outputs[0]
    return coordinates


def ramp(nodes, links, color):
    node = nodes.new("ShaderNodeValToRGB")
    node.color_ramp.elements[0].position, node.color_ramp.elements[1].position = 0.3, 0.7
    node.color_ramp.elements[0].color = (0.8, 0.1, 0.05, 1)
    node.color_ramp.elements[1].color = (0.1, 0.3, 0.7, 1)
    links.new(color, node.inputs["Fac"])
    return node.outputs["Color"]


def patterns_generated(b):
    wall(b, lambda nodes, links: None)


def patterns_object(b):
    wall(b, mapped("ShaderNodeTexCoord", "Object", (0.4, -0.3, 0.8)))


def patterns_uv(b):
    wall(b, mapped("ShaderNodeTexCoord", "UV", (0, 0, 0.6)))


def patterns_position(b):
    wall(b, mapped("ShaderNodeNewGeometry", "Position", (0.2, 0, 0)))


def patterns_line(b):
    wall(b, mapped("ShaderNodeTexCoord", "Object", (0, 0, 0.6)), nodes=LINES)


def patterns_four(b):
    wall(b, mapped("ShaderNodeTexCoord", "Object", (0.4, -0.3, 0.8)), nodes=FOUR)


def patterns_octaves(b):
    wall(b, mapped("ShaderNodeTexCoord", "Object", (0.4, -0.3, 0.8)), nodes=OCTAVES)


def halved(nodes, links, color):
    """Numbers within 0 and 1: Cycles reflects more above, and takes light away below."""
    if color.name == "Color":
        return color
    node = nodes.new("ShaderNodeMath")
    node.operation, node.use_clamp = "MULTIPLY", True
    node.inputs[1].default_value = 0.5
    links.new(color, node.inputs[0])
    return node.outputs[0]


def patterns_fractals(b):
    wall(b, mapped("ShaderNodeTexCoord", "Object", (0.4, -0.3, 0.8)), halved, FRACTALS)


def patterns_ramp(b):
    """Without nodes whose Color is not gray: a ramp takes its luminance, Sheaf the factor."""
    nodes = known(NODES)
    for i, (kind, _, _, output) in enumerate(nodes):
        if output == "Color" and kind not in ("Wave", "Gradient"):
            continue
        tile = b.plane(1.9, painted(b, f"Node {i}", nodes[i], lambda nodes, links: None,
                                    ramp))
        tile.name = f"Tile {i}"
        tile.location = (2.1 * (i % COLUMNS - (COLUMNS - 1) / 2), 0, 2.1 * (1.5 - i // COLUMNS))
        tile.rotation_euler = (math.pi / 2, 0, 0)
    b.camera((0, -14, 0), (0, 0, 0), 50)
    b.background(1.0)


# Ways to make one color of the factors of a noise and a wave: types of nodes, and their settings.
COMBINED = (
    ("Math", {"operation": "ADD", "use_clamp": True}), ("Math", {"operation": "SUBTRACT"}),
    ("Math", {"operation": "MULTIPLY"}), ("Math", {"operation": "DIVIDE", "use_clamp": True}),
    ("Math", {"operation": "MINIMUM"}), ("Math", {"operation": "MAXIMUM"}),
    ("Math", {"operation": "GREATER_THAN"}), ("Math", {"operation": "MULTIPLY_ADD"}),
    ("MixRGB", {"blend_type": "MIX"}), ("MixRGB", {"blend_type": "ADD"}),
    ("MixRGB", {"blend_type": "SCREEN"}), ("CombineRGB", {}))


def patterns_of_colors(b):
    """Blends of two ramps, by a number and by a texture."""
    b.camera((0, -14, 0), (0, 0, 0), 38)
    b.background(1.0)
    kinds = ("MULTIPLY", "ADD", "SUBTRACT", "DIFFERENCE", "DARKEN", "LIGHTEN", "SCREEN", "DIVIDE")
    for i in range(2 * len(kinds)):
        material, nodes, links, surface = b.empty_material(f"Node {i}")
        joint, shader = nodes.new("ShaderNodeMixRGB"), nodes.new("ShaderNodeBsdfDiffuse")
        joint.blend_type, joint.use_clamp = kinds[i % len(kinds)], True
        joint.inputs["Fac"].default_value = 0.7
        waves = [node_of(b, nodes, "Wave", {}, {"Scale": scale, "Distortion": 2})
                 for scale in (0.7, 1.3, 0.4)]
        for name, wave in zip(("Color1", "Color2"), waves):
            links.new(ramp(nodes, links, wave.outputs["Fac"]), joint.inputs[name])
        if i >= len(kinds):
            links.new(waves[2].outputs["Fac"], joint.inputs["Fac"])
        links.new(joint.outputs[0], shader.inputs["Color"])
        links.new(shader.outputs[0], surface.inputs["Surface"])
        tile = b.plane(1.9, material)
        tile.name = f"Tile {i}"
        tile.location = (2.1 * (i % COLUMNS - (COLUMNS - 1) / 2), 0, 2.1 * (1.5 - i // COLUMNS))
        tile.rotation_euler = (math.pi / 2, 0, 0)


def patterns_combined(b):
    """Each way as it is, and with a ramp behind it, but for the colors of the last one."""
    b.camera((0, -14, 0), (0, 0, 0), 38)
    b.background(1.0)
    for i in range(2 * len(COMBINED)):
        kind, attributes = COMBINED[i % len(COMBINED)]
        material, nodes, links, surface = b.empty_material(f"Node {i}")
        place, shader = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeBsdfDiffuse")
        joint = nodes.new(f"ShaderNode{kind}")
        for name, value in attributes.items():
            setattr(joint, name, value)
        sockets = [socket for socket in joint.inputs if socket.enabled][kind == "MixRGB":]
        for socket, (texture, inputs) in zip(sockets, (
                ("Noise", {"Scale": 3}), ("Wave", {"Scale": 1.5, "Distortion": 2}),
                ("Noise", {"Scale": 6}))):
            node = node_of(b, nodes, texture, {}, inputs)
            links.new(place.outputs["Object"], node.inputs["Vector"])
            links.new(node.outputs["Fac"], socket)
        color = joint.outputs[0]
        if i >= len(COMBINED) and kind != "CombineRGB":
            color = ramp(nodes, links, color)
        links.new(color, shader.inputs["Color"])
        links.new(shader.outputs[0], surface.inputs["Surface"])
        tile = b.plane(1.9, material)
        tile.name = f"Tile {i}"
        tile.location = (2.1 * (i % COLUMNS - (COLUMNS - 1) / 2), 0, 2.1 * (1.5 - i // COLUMNS))
        tile.rotation_euler = (math.pi / 2, 0, 0)
