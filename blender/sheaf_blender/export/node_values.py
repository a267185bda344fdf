# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Values of sockets: constants, images, and what nodes make of them."""
import numpy

from ..scene import image_pixels, pixel_ops, principled, values
from ..scene.closures import PINK
from . import node_links, texture_nodes

RAMP_SAMPLES = 257
CURVE_SAMPLES = 257
TURN_MIN = 1e-6  # A smaller part of a matrix beside its diagonal turns nothing.
_WRAPS = {"REPEAT": "repeat", "EXTEND": "clamp", "CLIP": "black", "MIRROR": "repeat"}
_FACTOR_BLENDS = pixel_ops.BLENDS


class NodeValues:
    """Evaluates the node tree of one item, as 'material "Gold"'. uv_base: the 2 x 2 matrix that the
    uv of its meshes are multiplied with.
    """

    def __init__(self, item, report, images, uv_base=((1.0, 0.0), (0.0, 1.0))):
        self.uv_base = numpy.array(uv_base, numpy.float64)
        self.uv_turns = []  # Matrices of Mapping nodes that uv_base does not leave diagonal.
        self.item, self._report, self._images = item, report, images
        self.uv_maps = set()  # Names of those that are used; "" is the one active for rendering.
        self._memory = node_links.Memory(report, item)
        self._mappings = node_links.Memory(report, item)

    def read(self, wanted, usual=0.0):
        """The value of a node_links.Input; usual if there is no such socket."""
        if wanted is None:
            return usual
        place, output, own = node_links.source(wanted)
        if place is None:
            return _default(own.socket, usual)
        reader = _READERS.get(place.node.type)
        value = self._memory.read(place, output, lambda: (
            reader(self, place, output) if reader else self.read_other(place, output)), None)
        if any(node.is_simplified for node in values.nodes_of(value)):
            self._report.approximated(self.item, "a node behind the color of a texture node: its "
                                                 "factor is used")
        if value is None:
            self._report.left_out(self.item, f'node "{place.node.name}" ({place.node.bl_label}) '
                                             f'behind "{wanted.socket.name}"; a constant is used')
            return _default(wanted.socket, usual)
        return value

    def read_other(self, place, output):
        """The value of a node that materials do not have; None if it has no counterpart."""
        return texture_nodes.read(self, place, output)

    def note(self, text):
        self._report.approximated(self.item, text)

    def number(self, wanted, usual=0.0):
        """A constant; a texture is replaced by its mean, and reported."""
        value = values.gray(self.read(wanted, usual))
        if values.is_constant(value):
            return float(value)
        self._report.approximated(self.item, f'a texture behind "{wanted.socket.name}": its mean '
                                             "is used")
        return self._images.mean(value)

    def mean_of(self, value):
        return self._images.mean(value)

    def tilt_of(self, value):
        """The mean angle in degrees by which an image of tangent space normals tilts them."""
        pixels = self._images.pixels(value)
        return 0.0 if pixels is None else image_pixels.mean_tilt_degrees(pixels)

    def place_input(self, place, *names):
        return self.read(node_links.input_of(place, *names))

    # Readers return None for what has no counterpart.

    def image(self, place, output):
        node = place.node
        if node.image is None:
            self._report.left_out(self.item, f'"{node.name}", which has no image; it is pink')
            return PINK if output.name == "Color" else 1.0
        if node.projection != "FLAT":
            return None
        if node.extension == "MIRROR":
            self._report.approximated(self.item, "an image that mirrors is repeated")
        mapping = self._mapping(node_links.input_of(place, "Vector"))
        is_alpha_used = any(socket.name == "Alpha" and socket.is_linked for socket in node.outputs)
        value = self._images.value(node.image, node.image_user, _WRAPS[node.extension], mapping,
                                   "point" if node.interpolation == "Closest" else "bilinear",
                                   output.name == "Alpha", is_alpha_used)
        if value is None:
            return PINK if output.name == "Color" else 1.0
        return value

    def _mapping(self, wanted):
        """Scale and offset of u and v."""
        matrix = self._uv_matrix(wanted)
        turn, offset = matrix[:2, :2], matrix[:2, 3]
        if not numpy.array_equal(self.uv_base, numpy.identity(2)):
            turn = numpy.round(turn @ numpy.linalg.inv(self.uv_base), 9)
        if max(abs(turn[0, 1]), abs(turn[1, 0])) > TURN_MIN * abs(turn).max():
            if abs(numpy.linalg.det(matrix[:2, :2])) > TURN_MIN:
                self.uv_turns.append(matrix[:2, :2])
            self._report.left_out(self.item, "Rotation of a Mapping node: other textures of the "
                                             "material are turned otherwise")
        return (*map(float, (turn[0, 0], turn[1, 1])), *map(float, offset))

    def _uv_matrix(self, wanted):
        """The 4 x 4 matrix from uv to the place of an image."""
        unmapped = numpy.identity(4)
        place, output, _ = node_links.source(wanted)
        if place is not None and place.node.type == "UVMAP":
            self.uv_maps.add(place.node.uv_map)
            return unmapped
        if place is None or place.node.type != "MAPPING":
            self.uv_maps.add("")
        if place is None:
            return unmapped
        if place.node.type == "MAPPING":
            return self._mappings.read(place, output, lambda: self._node_mapping(place), unmapped)
        if place.node.type == "TEX_COORD" and output.name == "UV":
            return unmapped
        self._report.approximated(self.item, f'texture coordinates of "{place.node.name}" '
                                             f"({output.name}): uv is used")
        return unmapped

    def _node_mapping(self, place):
        inner = self._uv_matrix(node_links.input_of(place, "Vector"))
        found = texture_nodes.mapping_matrix(self, place)
        if found is None:
            self._report.left_out(self.item, "a Mapping node of normals or with textures")
            return inner
        return found @ inner

    def checker(self, place, _):
        first, second = (self.place_input(place, name) for name in ("Color1", "Color2"))
        scale = self.number(node_links.input_of(place, "Scale"), 5.0)
        vector = node_links.input_of(place, "Vector")
        if node_links.source(vector)[0] is None:
            self._report.approximated(self.item, "coordinates of a Checker Texture: uv is used")
        u, v, du, dv = self._mapping(vector)
        # Blender's first color is where the sum of the cells is odd.
        return values.CheckerValue(second, first, (u * scale, v * scale, du * scale, dv * scale))

    def mix_colors(self, place, output):
        node = place.node
        if node.type == "MIX" and node.data_type not in ("RGBA", "FLOAT"):
            return None
        suffix = {"RGBA": "Color", "FLOAT": "Float"}.get(getattr(node, "data_type", "RGBA"))
        factor = self.place_input(place, "Factor_Float", "Fac")
        a = self.place_input(place, f"A_{suffix}", "Color1")
        b = self.place_input(place, f"B_{suffix}", "Color2")
        blend = node.blend_type if suffix == "Color" else "MIX"
        if getattr(node, "clamp_factor", True):
            factor = values.clamped(factor)
        value = self._blended(blend, a, b, factor)
        if value is not None and getattr(node, "use_clamp", getattr(node, "clamp_result", False)):
            value = values.apply(value, "clamp", 0.0, 1.0)
        return value

    def _blended(self, blend, a, b, factor):
        if blend == "MIX":
            return values.mix(a, b, factor)
        if blend not in _FACTOR_BLENDS:
            return None
        if values.is_constant(factor):
            factor = values.gray(factor)
            if values.is_constant(b):
                return values.apply(a, "mix", blend, factor, values.color(b), True)
            if values.is_constant(a):
                return values.apply(b, "mix", blend, factor, values.color(a), False)
        if blend == "ADD" and not values.is_color(factor):
            more = values.multiply(b, factor)
            return None if more is None else values.add(a, more)
        found = values.blend(blend, a, b)
        return None if found is None else values.mix(a, found, factor)

    def math(self, place, _):
        node = place.node
        inputs = [values.gray(self.read(node_links.Input(socket, place.groups)))
                  for socket in node.inputs if socket.enabled]
        a = inputs[0]
        b = inputs[1] if len(inputs) > 1 else 0.0
        if node.operation == "MULTIPLY_ADD":
            product = values.multiply(a, b)
            value = None if product is None else values.add(product, inputs[2])
        elif node.operation not in pixel_ops.MATH:
            return None
        elif values.is_constant(b):
            value = values.apply(a, "math", node.operation, values.gray(b), True)
        elif values.is_constant(a):
            value = values.apply(b, "math", node.operation, values.gray(a), False)
        else:
            value = values.math(node.operation, a, b)
        if value is not None and node.use_clamp:
            value = values.apply(value, "clamp", 0.0, 1.0)
        return value

    def ramp(self, place, output):
        ramp = place.node.color_ramp
        samples = [ramp.evaluate(i / (RAMP_SAMPLES - 1)) for i in range(RAMP_SAMPLES)]
        part = (lambda c: (c[3],) * 3) if output.name == "Alpha" else (lambda c: tuple(c[:3]))
        return values.apply(self.place_input(place, "Fac"), "ramp", tuple(map(part, samples)))

    def one_color(self, place, name, *arguments):
        return values.apply(self.place_input(place, "Color"), name, *arguments)

    def gamma(self, place, _):
        return self.one_color(place, "gamma", self.number(node_links.input_of(place, "Gamma"), 1.0))

    def invert(self, place, _):
        return self.one_color(place, "invert", self.number(node_links.input_of(place, "Fac"), 1.0))

    def bright_contrast(self, place, _):
        return self.one_color(place, "bright_contrast",
                              self.number(node_links.input_of(place, "Bright")),
                              self.number(node_links.input_of(place, "Contrast")))

    def hue_saturation(self, place, _):
        value = self.place_input(place, "Color")
        if values.is_composite(value) and not isinstance(value, values.CheckerValue):
            self.note("the hue of a mix of textures: it is that of both")
        numbers = [self.number(node_links.input_of(place, *names), usual) for names, usual in (
            (("Hue",), 0.5), (("Saturation",), 1.0), (("Value",), 1.0), (("Fac", "Factor"), 1.0))]
        return self.one_color(place, "hue_saturation", *numbers)

    def rgb_curves(self, place, _):
        mapping = place.node.mapping
        mapping.initialize()
        points = [point.location.x for curve in mapping.curves for point in curve.points]
        low, high = min(0.0, *points), max(1.0, *points)
        steps = [low + (high - low) * i / (CURVE_SAMPLES - 1) for i in range(CURVE_SAMPLES)]
        combined = [mapping.evaluate(mapping.curves[3], x) for x in steps]
        tables = tuple(tuple(mapping.evaluate(mapping.curves[i], x) for x in combined)
                       for i in range(3))
        return self.one_color(place, "curves", tables, low, high,
                              mapping.extend == "EXTRAPOLATED",
                              self.number(node_links.input_of(place, "Fac", "Factor"), 1.0))

    def of_angle(self, place, output):
        """(index, mean over the directions of diffuse light) of a Fresnel or Layer Weight node."""
        if place.node.type == "FRESNEL":
            ior = self.number(node_links.input_of(place, "IOR"), 1.45)
        else:
            blend = min(self.number(node_links.input_of(place, "Blend"), 0.5), 1 - 1e-3)
            if output.name == "Facing":  # 1 - cos^power, where the density is 2 cos.
                power = 2 * max(blend, 0.0) if blend < 0.5 else 0.5 / (1 - blend)
                return 1.0, 1 - 2 / (2 + power)
            ior = 1 / (1 - blend)
        ior = max(ior, 1.0001)
        return ior, principled.fresnel_mean(ior)

    def mean_of_angle(self, place, output):
        _, mean = self.of_angle(place, output)
        self.note(f'"{place.node.name}" has its mean {mean:.2f} in all directions')
        return mean

    def light_path(self, place, output):
        """Surfaces have one value for all rays: that of those that scatter."""
        self._report.approximated(self.item, f'Light Path > {output.name}: the value for rays that '
                                             "the camera or a surface sends is used for all")
        return 1.0 if output.name == "Is Camera Ray" else 0.0

    def to_gray(self, place, _):
        return values.gray(self.place_input(place, "Color"))

    def separate(self, place, output):
        if getattr(place.node, "mode", "RGB") != "RGB":
            return None
        index = [socket.name for socket in place.node.outputs].index(output.name)
        return values.apply(self.place_input(place, "Color", "Image"), "channel", index)

    def combine(self, place, _):
        if getattr(place.node, "mode", "RGB") != "RGB":
            return None
        parts = [values.gray(self.read(node_links.Input(socket, place.groups)))
                 for socket in place.node.inputs]
        if all(map(values.is_constant, parts)):
            return tuple(map(float, parts))
        return values.combined(parts[:3])

    def map_range(self, place, _):
        node = place.node
        if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
            return None
        limits = [self.number(node_links.input_of(place, name), usual) for name, usual in (
            ("From Min", 0.0), ("From Max", 1.0), ("To Min", 0.0), ("To Max", 1.0))]
        return values.apply(values.gray(self.place_input(place, "Value")), "map_range", *limits,
                            bool(node.clamp))

    def clamp(self, place, _):
        limits = [self.number(node_links.input_of(place, name), usual)
                  for name, usual in (("Min", 0.0), ("Max", 1.0))]
        return values.apply(values.gray(self.place_input(place, "Value")), "clamp", *limits)

    def constant_output(self, _, output):
        return _default(output, 0.0)

    def blackbody(self, place, _):
        from ..scene import units
        return units.blackbody_rgb(self.number(node_links.input_of(place, "Temperature"), 1500.0))


def _vertex_color(reader, place, output):
    """The value of a Color Attribute node."""
    return values.attribute_of_vertices(place.node.layer_name,
                                        "alpha" if output.name == "Alpha" else "")


def _attribute(reader, place, output):
    """The value of an Attribute node; None for those of objects and layers."""
    node = place.node
    if node.attribute_type != "GEOMETRY" or not node.attribute_name:
        return None
    channel = {"Fac": "mean", "Alpha": "alpha"}.get(output.name, "")
    return values.attribute_of_vertices(node.attribute_name, channel)


def _default(socket, usual):
    value = getattr(socket, "default_value", None)
    if value is None or isinstance(value, str):
        return usual
    if isinstance(value, (int, float)):
        return float(value)
    return tuple(float(x) for x in value)[:3]


_READERS = {
    "TEX_IMAGE": NodeValues.image, "TEX_CHECKER": NodeValues.checker,
    "RGB": NodeValues.constant_output, "VALUE": NodeValues.constant_output,
    "MIX_RGB": NodeValues.mix_colors, "MIX": NodeValues.mix_colors, "MATH": NodeValues.math,
    "VALTORGB": NodeValues.ramp, "GAMMA": NodeValues.gamma, "INVERT": NodeValues.invert,
    "BRIGHTCONTRAST": NodeValues.bright_contrast, "HUE_SAT": NodeValues.hue_saturation,
    "RGBTOBW": NodeValues.to_gray, "SEPARATE_COLOR": NodeValues.separate,
    "SEPRGB": NodeValues.separate, "COMBINE_COLOR": NodeValues.combine,
    "COMBRGB": NodeValues.combine, "MAP_RANGE": NodeValues.map_range, "CLAMP": NodeValues.clamp,
    "VERTEX_COLOR": _vertex_color, "ATTRIBUTE": _attribute,
    "BLACKBODY": NodeValues.blackbody, "CURVE_RGB": NodeValues.rgb_curves,
    "FRESNEL": NodeValues.mean_of_angle, "LAYER_WEIGHT": NodeValues.mean_of_angle,
    "LIGHT_PATH": lambda reader, place, output: reader.light_path(place, output),
}
