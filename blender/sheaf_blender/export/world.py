# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The world: a color, an environment texture as an equal-area map, or, for other trees, the map
that Cycles makes of it.
"""
import dataclasses

import mathutils
import numpy

from ..scene import sphere_map, values
from ..scene.closures import PINK
from ..scene.report import Report
from . import node_links, world_bake
from .images import write_pixels
from .node_values import NodeValues

BLACK = (0.0, 0.0, 0.0)
UNIFORM_ERROR_MAX = 1e-4  # Relative difference of the lengths of axes that are scaled alike.


@dataclasses.dataclass(frozen=True)
class Background:
    """The radiance of the sky: a color, or pixels of a map (rows from the bottom) that is looked up
    by the affine map of directions, times a factor.
    """
    color: tuple = BLACK
    pixels: object = None
    lookup: object = None      # A 4x4 matrix.
    projection: str = "EQUIRECTANGULAR"
    factor: float = 1.0
    seen: object = None        # The Background that the camera sees, if it is another.

    def radiance(self, directions):
        """The radiance from directions (..., 3)."""
        if self.pixels is None:
            return numpy.broadcast_to(numpy.float32(self.color), directions.shape)
        found = sphere_map.look_up(self.pixels, directions, numpy.array(self.lookup),
                                   self.projection)
        return self.factor * found


def write_world(text, scene, world, exposure, images, content, report):
    """Writes the world that lights the scene; returns its Background."""
    if world is None:
        return Background()
    item = f'world "{world.name}"'
    if not world.use_nodes or world.node_tree is None:
        return _write(text, Background(tuple(exposure * c for c in world.color)), None, content)
    output = node_links.output_node(world.node_tree)
    if output is None:
        return Background()
    surface = node_links.input_of(node_links.Place(output), "Surface")
    if node_links.source(surface)[0] is None:
        return Background()
    rays = light_path_outputs(world.node_tree)
    is_told = "Is Camera Ray" in rays
    others = sorted(rays - {"Is Camera Ray"})
    if others:
        report.approximated(item, f"Light Path > {', '.join(others)}: the value for rays that the "
                                  "camera sends is used for all")
    read = _Reading(item, surface, scene, world, exposure, images, report)
    lit, square = read.background(not is_told)
    written = _write(text, lit, square, content)
    if is_told:
        written = dataclasses.replace(written, seen=read.background(True)[0])
    return written


def light_path_outputs(tree):
    """The names of the outputs of Light Path nodes that are linked, here or in a group."""
    found = {link.from_socket.name for link in tree.links if link.from_node.type == "LIGHT_PATH"}
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree:
            found |= light_path_outputs(node.node_tree)
    return found


@dataclasses.dataclass
class _Reading:
    item: str
    surface: node_links.Input
    scene: object
    world: object
    exposure: float
    images: object
    report: Report

    def background(self, is_for_camera):
        """(Background, the equal-area map if there is one already), as camera rays or as all other
        rays see it.
        """
        tried = Report()  # A tree that cannot be read without loss is rendered by Cycles.
        reader = _WorldValues(self.item, tried, self.images, is_for_camera)
        value = reader.shader(self.surface)
        if value is not None and all("pink" in entry.text for entry in tried.entries):
            self.report.include(tried)
            if values.is_constant(value):
                return self._even(value), None
            pixels = (self.images.pixels(value) if isinstance(value, values.ImageValue)
                      else None)
            if pixels is not None and reader.lookup is not None:
                return Background(BLACK, pixels, reader.lookup, reader.projection,
                                  reader.strength * self.exposure), None
        try:
            pixels, square = world_bake.bake(self.world, self.scene, is_for_camera)
        except world_bake.BakeError as error:
            self.report.include(tried)
            self.report.left_out(self.item, f"its nodes, which cannot be rendered: {error}; the "
                                            "world is even")
            mean = value if value is not None else (0.5, 0.5, 0.5)
            if not values.is_constant(mean):
                mean = self.images.mean(mean)
            return self._even(mean), None
        return Background(BLACK, pixels, mathutils.Matrix.Identity(4), "EQUIRECTANGULAR",
                          self.exposure), square

    def _even(self, color):
        return Background(tuple(max(0.0, self.exposure * c) for c in values.color(color)))


def _write(text, background, square, content):
    """Writes the light; returns the Background."""
    if background.pixels is not None:
        return _map(text, background, content, square)
    return _constant(text, background.color)


def _constant(text, radiance):
    radiance = tuple(max(0.0, c) for c in radiance)
    if max(radiance) > 0:
        text.directive("LightSource", "infinite", {"rgb L": radiance})
    return Background(radiance)


def _map(text, background, content, square=None):
    """A lookup that only turns and mirrors directions is the light's transform. square: the
    equal-area map, if there is one already.
    """
    lookup = background.lookup
    lengths = [lookup.col[i].xyz.length for i in range(3)]
    axes = [lookup.col[i].xyz.normalized() for i in range(3)]
    is_turn = (lookup.translation.length <= UNIFORM_ERROR_MAX * lengths[0]
               and all(abs(x - lengths[0]) <= UNIFORM_ERROR_MAX * lengths[0] for x in lengths)
               and all(abs(axes[i].dot(axes[j])) < UNIFORM_ERROR_MAX
                       for i, j in ((0, 1), (0, 2), (1, 2))))
    turn = mathutils.Matrix.Identity(4)
    if is_turn:
        if not all(lookup[i][j] == (i == j) for i in range(4) for j in range(4)):
            sides = mathutils.Matrix.Diagonal([1 / lengths[0]] * 3).to_4x4()
            turn = (lookup @ sides if lengths[0] != 1 else lookup).inverted()
        inside = numpy.eye(4)
    else:
        inside = numpy.array(lookup)
    if square is None:
        square = sphere_map.equal_area(numpy.maximum(background.pixels, 0), inside,
                                       background.projection)
    text.directive("AttributeBegin")
    text.transform("ConcatTransform", turn)
    text.directive("LightSource", "infinite", {
        "string filename": write_pixels(content, square[::-1]), "float scale": background.factor})
    text.directive("AttributeEnd")
    return background


class _WorldValues(NodeValues):
    """Reads the shaders and the environment textures of a world. lookup: the matrix from
    directions to those of the one environment that is read. is_for_camera: whether Is Camera Ray
    is true.
    """

    def __init__(self, item, report, images, is_for_camera=True):
        super().__init__(item, report, images)
        self._is_for_camera = is_for_camera
        self.lookup, self.projection, self.strength = None, "EQUIRECTANGULAR", 1.0
        self._environment = None
        self._shaders = node_links.Memory(report, item)

    def shader(self, wanted):
        """The radiance as a value; None if it cannot be read. The strength of a single Background
        is in the attribute.
        """
        place, _, _ = node_links.source(wanted)
        if place is None:
            return BLACK
        kind = place.node.type
        if kind in ("BACKGROUND", "EMISSION"):
            color = values.color(self.read(node_links.input_of(place, "Color"), BLACK))
            strength = values.gray(self.read(node_links.input_of(place, "Strength"), 1.0))
            if not values.is_constant(strength):
                return None
            if values.is_constant(color):
                return tuple(strength * c for c in color)
            if wanted.socket.node.type == "OUTPUT_WORLD":
                self.strength = strength
                return color
            return values.apply(color, "multiply", *(strength,) * 3)
        if kind not in ("MIX_SHADER", "ADD_SHADER"):
            return None
        first, second = (self._shaders.read(place, socket, lambda socket=socket: self.shader(
            node_links.Input(socket, place.groups)), None)
                         for socket in place.node.inputs if socket.type == "SHADER")
        if first is None or second is None:
            return None
        if kind == "MIX_SHADER":
            factor = self.read(node_links.Input(place.node.inputs[0], place.groups), 0.5)
            if not values.is_constant(factor):
                return None
            factor = values.clamped(factor)
            if factor in (0.0, 1.0):
                return second if factor else first
            first, second = (values.apply(value, "multiply", *(weight,) * 3)
                             for value, weight in ((first, 1 - factor), (second, factor)))
        return _sum(first, second)

    def light_path(self, place, output):
        return float(self._is_for_camera and output.name == "Is Camera Ray")

    def read_other(self, place, output):
        if place.node.type != "TEX_ENVIRONMENT":
            return None
        node = place.node
        if node.image is None:
            self._report.left_out(self.item, f'"{node.name}", which has no image; it is pink')
            return PINK
        lookup = self._lookup_of(node_links.input_of(place, "Vector"))
        if lookup is None or (self._environment not in (None, node)):
            return None
        value = self._images.value(node.image, node.image_user, "repeat", (1.0, 1.0, 0.0, 0.0),
                                   "bilinear")
        if value is None:
            return PINK
        self._environment, self.lookup, self.projection = node, lookup, node.projection
        return value

    def _lookup_of(self, wanted):
        """The affine map of directions by Mapping and Texture Coordinate nodes; None for others."""
        place, output, _ = node_links.source(wanted)
        if place is None:
            return mathutils.Matrix.Identity(4)
        node = place.node
        if node.type == "TEX_COORD" and output.name in ("Generated", "Object"):
            if output.name == "Object" and node.object is not None:
                return node.object.matrix_world.inverted_safe()
            return mathutils.Matrix.Identity(4)
        if node.type != "MAPPING":
            return None
        inner = self._mappings.read(place, output, lambda: self._lookup_of(
            node_links.input_of(place, "Vector")), None)
        found = [values.color(self.read(node_links.input_of(place, name), usual))
                 for name, usual in (("Location", BLACK), ("Rotation", BLACK),
                                     ("Scale", (1.0, 1.0, 1.0)))]
        if inner is None or not all(map(values.is_constant, found)):
            return None
        return mapping_matrix(node.vector_type, *found) @ inner


def mapping_matrix(kind, location, rotation, scale):
    """The affine map of a Mapping node."""
    turn = mathutils.Euler(rotation, "XYZ").to_matrix().to_4x4()
    size = mathutils.Matrix.Diagonal([*scale, 1])
    if kind == "TEXTURE":
        inverse = mathutils.Matrix.Diagonal([*(1 / x if x else 0.0 for x in scale), 1])
        return inverse @ turn.transposed() @ mathutils.Matrix.Translation(
            [-x for x in location])
    if kind == "NORMAL":
        size = mathutils.Matrix.Diagonal([*(1 / x if x else 0.0 for x in scale), 1])
    found = turn @ size
    return mathutils.Matrix.Translation(location) @ found if kind == "POINT" else found


def _sum(first, second):
    """None for the sum of two textures."""
    if values.is_constant(first) and values.is_constant(second):
        return tuple(a + b for a, b in zip(values.color(first), values.color(second)))
    if values.is_constant(second):
        return values.apply(first, "mix", "ADD", 1.0, values.color(second), True)
    if values.is_constant(first):
        return values.apply(second, "mix", "ADD", 1.0, values.color(first), False)
    return None
