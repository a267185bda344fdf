# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Texture nodes that the renderer computes (values.NodeValue), with the places they are read at."""
import math

import numpy

from ..scene import values
from . import node_links

_WIDE = (-4.0, 6.0)  # The reach of factors without bounds.


def read(reader, place, output):
    """The value of an output; None for nodes, modes and coordinates without counterpart. reader: a
    NodeValues.
    """
    found = _NODES.get(place.node.type)
    return found(_Node(reader, place, output)) if found else None


class _Node:
    def __init__(self, reader, place, output):
        self.reader, self.place, self.node = reader, place, place.node
        self.output = output.name

    def number(self, name, low, high, usual):
        found = self.reader.number(node_links.input_of(self.place, name), usual)
        return float(min(max(found, low), high))

    def numbers(self, *names):
        """((parameter, value), ...): of sockets of the usual names, within Sheaf's ranges."""
        return tuple((parameter, self.number(socket, low, high, usual))
                     for parameter, socket, low, high, usual in (_SOCKETS[name] for name in names))

    def value(self, name, parameters, reach=(0.0, 1.0), has_color=False, outputs=("Fac", "Factor"),
              dimensions=3):
        """None for an output that has no counterpart."""
        if self.output != "Color" and self.output not in outputs:
            return None
        if dimensions == 1:
            found, w = self._place_on_line()
        else:
            found, w = texture_place(self.reader, node_links.input_of(self.place, "Vector")), ()
        if dimensions == 4:
            w = (("w", self.number("W", -_MOST, _MOST, 0.0)),)
        if dimensions != 3:
            parameters = (("dimensions", float(dimensions)), *parameters, *w)
        if found is None:
            return None
        space, matrix = found
        if abs(numpy.linalg.det(matrix)) < 1e-30:
            return None
        return values.NodeValue(name, tuple(parameters), space, tuple(map(float, matrix.ravel())),
                                reach, has_color and self.output == "Color")


    def _place_on_line(self):
        """((space, matrix), parameters) of the input W: a number, or a coordinate of a place, which
        becomes the first one.
        """
        wanted = node_links.input_of(self.place, "W")
        source, output, _ = node_links.source(wanted)
        if source is None or source.node.type not in ("SEPXYZ", "SEPARATE_XYZ"):
            return (("world", numpy.identity(4)), (("w", self.number("W", -_MOST, _MOST, 0.0)),))
        found = texture_place(self.reader, node_links.input_of(source, "Vector"))
        if found is None:
            return None, ()
        axis = "XYZ".index(output.name)
        rows = [axis, (axis + 1) % 3, (axis + 2) % 3, 3]
        return (found[0], found[1][rows]), (("w_from", "x"),)


_MOST = 1e6
_SOCKETS = {
    "scale": ("scale", "Scale", -_MOST, _MOST, 5.0), "detail": ("detail", "Detail", 0, 15, 2.0),
    "roughness": ("roughness", "Roughness", 0, _MOST, 0.5),
    "voronoi_roughness": ("roughness", "Roughness", 0, 1, 0.5),
    "lacunarity": ("lacunarity", "Lacunarity", 1e-5, _MOST, 2.0),
    "distortion": ("distortion", "Distortion", -_MOST, _MOST, 0.0),
    "dimension": ("dimension", "Dimension", 1e-5, _MOST, 2.0),
    "offset": ("offset", "Offset", -_MOST, _MOST, 0.0), "gain": ("gain", "Gain", 0, _MOST, 1.0),
    "smoothness": ("smoothness", "Smoothness", 0, 1, 1.0),
    "exponent": ("exponent", "Exponent", 0.01, 32, 0.5),
    "randomness": ("randomness", "Randomness", 0, 1, 1.0),
    "detail_scale": ("detail_scale", "Detail Scale", -_MOST, _MOST, 1.0),
    "detail_roughness": ("detail_roughness", "Detail Roughness", 0, _MOST, 0.5),
    "phase": ("phase", "Phase Offset", -_MOST, _MOST, 0.0),
    "mortar_size": ("mortar_size", "Mortar Size", 0, _MOST, 0.02),
    "mortar_smooth": ("mortar_smooth", "Mortar Smooth", 0, _MOST, 0.1),
    "bias": ("bias", "Bias", -1, 1, 0.0),
    "brick_width": ("brick_width", "Brick Width", 1e-5, _MOST, 0.5),
    "row_height": ("row_height", "Row Height", 1e-5, _MOST, 0.25)}
_DIMENSIONS = {"1D": 1, "2D": 2, "3D": 3, "4D": 4}


_FRACTALS = {"FBM": "fbm", "MULTIFRACTAL": "multifractal", "HYBRID_MULTIFRACTAL": "hybrid",
             "RIDGED_MULTIFRACTAL": "ridged", "HETERO_TERRAIN": "hetero"}


def _noise(node):
    dimensions = _DIMENSIONS.get(node.node.noise_dimensions)
    kind = _FRACTALS.get(getattr(node.node, "noise_type", "FBM"))  # Since Blender 4.1.
    if dimensions is None or kind is None:
        return None
    if kind != "fbm":
        numbers = node.numbers("scale", "detail", "roughness", "lacunarity", "distortion", "offset",
                               "gain")
        return node.value("noise", (("type", kind), *numbers), _WIDE, True, dimensions=dimensions)
    normalized = getattr(node.node, "normalize", True)
    numbers = node.numbers("scale", "detail", "roughness", "lacunarity", "distortion")
    if node_links.input_of(node.place, "Lacunarity") is None:  # Until Blender 3.6.
        numbers = tuple((name, min(x, 1.0) if name == "roughness" else x) for name, x in numbers)
    return node.value("noise", (("normalize", float(normalized)), *numbers),
                      (0.0, 1.0) if normalized else _WIDE, True, dimensions=dimensions)


def _musgrave(node):
    numbers = node.numbers("scale", "detail", "dimension", "lacunarity", "offset", "gain")
    return node.value("musgrave", (("type", _FRACTALS[node.node.musgrave_type]), *numbers),
                      _WIDE, outputs=("Fac", "Height"),
                      dimensions=_DIMENSIONS[node.node.musgrave_dimensions])


_FEATURES = {"F1": "f1", "F2": "f2", "SMOOTH_F1": "smooth_f1",
             "DISTANCE_TO_EDGE": "distance_to_edge"}


def _voronoi(node):
    dimensions = _DIMENSIONS.get(node.node.voronoi_dimensions)
    feature = _FEATURES.get(node.node.feature)
    if dimensions is None or feature is None:
        return None
    normalized = getattr(node.node, "normalize", False)  # Since Blender 4.0.
    numbers = node.numbers("scale", "smoothness", "exponent", "randomness")
    if node_links.input_of(node.place, "Detail") is not None:
        numbers += (*node.numbers("detail", "voronoi_roughness", "lacunarity"),
                    ("normalize", float(normalized)))
        if dict(numbers)["detail"] == 0:
            numbers = (*numbers[:4], ("detail", 0.0), ("normalize", float(normalized)))
    return node.value("voronoi", (("feature", feature), ("metric", node.node.distance.lower()),
                                  *numbers),
                      (0.0, 1.0 if normalized else 2.0), True, ("Distance",), dimensions)


def _wave(node):
    is_bands = node.node.wave_type == "BANDS"
    direction = node.node.bands_direction if is_bands else node.node.rings_direction
    profile = {"SIN": "sine", "SAW": "saw", "TRI": "triangle"}[node.node.wave_profile]
    return node.value("wave", (("type", "bands" if is_bands else "rings"),
                               ("direction", {"SPHERICAL": "diagonal"}.get(direction,
                                                                           direction.lower())),
                               ("profile", profile),
                               *node.numbers("scale", "distortion", "detail", "detail_scale",
                                             "detail_roughness", "phase")))


def _magic(node):
    return node.value("magic", (("depth", float(node.node.turbulence_depth)),
                                *node.numbers("scale", "distortion")), has_color=True)


def _brick(node):
    source = node.node
    parameters = (*node.numbers("scale", "mortar_size", "mortar_smooth", "bias", "brick_width",
                                "row_height"),
                  ("offset", float(source.offset)),
                  ("offset_frequency", float(source.offset_frequency)),
                  ("squash", float(source.squash)),
                  ("squash_frequency", float(source.squash_frequency)))
    mortar = node.value("brick", (*parameters, ("output", "mortar")))
    if mortar is None or node.output != "Color":
        return mortar
    tint = node.value("brick", (*parameters, ("output", "tint")))
    first, second, between = (node.reader.place_input(node.place, name)
                              for name in ("Color1", "Color2", "Mortar"))
    bricks = values.MixValue(first, second, tint) if first != second else first
    return values.MixValue(bricks, between, mortar)


_GRADIENTS = {"LINEAR": "linear", "QUADRATIC": "quadratic", "EASING": "easing",
              "DIAGONAL": "diagonal", "RADIAL": "radial",
              "QUADRATIC_SPHERE": "quadratic_sphere", "SPHERICAL": "spherical"}


def _gradient(node):
    return node.value("gradient", (("type", _GRADIENTS[node.node.gradient_type]),))


def _white_noise(node):
    dimensions = _DIMENSIONS[node.node.noise_dimensions]
    # Without a link its place is a point, not Generated coordinates.
    linked, _, _ = node_links.source(node_links.input_of(node.place, "Vector")) if (
        dimensions > 1) else (node.place, None, None)
    if linked is None:
        return None
    return node.value("white_noise", (), has_color=True, outputs=("Value",), dimensions=dimensions)


_NODES = {"TEX_NOISE": _noise, "TEX_MUSGRAVE": _musgrave, "TEX_VORONOI": _voronoi,
          "TEX_WAVE": _wave, "TEX_MAGIC": _magic, "TEX_BRICK": _brick,
          "TEX_GRADIENT": _gradient, "TEX_WHITE_NOISE": _white_noise}


def texture_place(reader, wanted):
    """("uv", "world", "object" or "generated", 4 x 4 matrix from there to the texture's space) of a
    Vector input; None if it has no counterpart.
    """
    place, output, _ = node_links.source(wanted)
    if place is None:
        return "generated", numpy.identity(4)
    if place.node.type == "MAPPING":
        found = texture_place(reader, node_links.input_of(place, "Vector"))
        mapping = mapping_matrix(reader, place)
        return None if found is None or mapping is None else (found[0], mapping @ found[1])
    if place.node.type == "TEX_COORD" and output.name == "Object" and place.node.object:
        return "world", numpy.linalg.inv(numpy.array(place.node.object.matrix_world))
    spaces = {"TEX_COORD": {"Generated": "generated", "Object": "object", "UV": "uv"},
              "NEW_GEOMETRY": {"Position": "world"}, "UVMAP": {"UV": "uv"}}
    space = spaces.get(place.node.type, {}).get(output.name)
    if space == "uv":
        reader.uv_maps.add(getattr(place.node, "uv_map", ""))
        matrix = numpy.identity(4)
        matrix[:2, :2] = numpy.linalg.inv(reader.uv_base)
        return space, matrix
    return None if space is None else (space, numpy.identity(4))


def mapping_matrix(reader, place):
    """The affine map of a Mapping node; None for normals, and where textures say how it maps."""
    kind = place.node.vector_type
    found = [reader.read(node_links.input_of(place, name), usual) for name, usual in (
        ("Location", (0.0,) * 3), ("Rotation", (0.0,) * 3), ("Scale", (1.0,) * 3))]
    if kind == "NORMAL" or not all(map(values.is_constant, found)):
        return None
    location, angles, scale = map(values.color, found)
    rotation = rotation_matrix(angles)
    matrix = numpy.identity(4)
    if kind == "TEXTURE":
        shrink = numpy.diag([1 / x if x else 0.0 for x in scale])
        matrix[:3, :3] = shrink @ rotation.T
        matrix[:3, 3] = -matrix[:3, :3] @ numpy.array(location)
    else:
        matrix[:3, :3] = rotation @ numpy.diag(scale)
        if kind == "POINT":
            matrix[:3, 3] = location
    return matrix


def rotation_matrix(angles):
    """About x, then y, then z, as Blender's XYZ angles say."""
    result = numpy.identity(3)
    for axis, angle in enumerate(angles):
        c, s = math.cos(angle), math.sin(angle)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = numpy.identity(3)
        turn[i, i] = turn[j, j] = c
        turn[i, j], turn[j, i] = -s, s
        result = turn @ result
    return result
