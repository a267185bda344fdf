# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Values of material inputs: numbers, colors, and textures made of images, nodes, scales and mixes.

A constant is a float or a tuple of three floats (linear Rec.709). Operations on constants are
computed at once; operations on images are noted in the image and applied when it is written
(pixel_ops.py), so that a chain of nodes behind an image costs nothing when rendering.
"""
import dataclasses

import numpy

from . import pixel_ops

_LUMINANCE = (0.2126, 0.7152, 0.0722)
_IDENTITY = tuple(float(i % 5 == 0) for i in range(16))


@dataclasses.dataclass(frozen=True)
class ImageValue:
    source: str                    # The image's key in the writer of images.
    encoding: str = "sRGB"         # Its file's: "sRGB" or "linear".
    wrap: str = "repeat"           # "repeat", "clamp" or "black".
    mapping: tuple = (1.0, 1.0, 0.0, 0.0)  # Scale and offset of u and v.
    operations: tuple = ()         # ((name, arguments), ...) of pixel_ops.
    filter: str = "bilinear"


@dataclasses.dataclass(frozen=True)
class ScaleValue:
    value: object
    factor: object  # A float value.


@dataclasses.dataclass(frozen=True)
class MixValue:
    first: object
    second: object
    amount: object  # The weight of second.


@dataclasses.dataclass(frozen=True)
class RampValue:
    """A number that several textures make, after operations on it."""
    value: object
    reach: tuple       # Least and greatest of the number.
    operations: tuple  # ((name, arguments), ...) of pixel_ops on it.


@dataclasses.dataclass(frozen=True)
class ChannelsValue:
    """A color of three numbers, not all of which are constant."""
    parts: tuple


@dataclasses.dataclass(frozen=True)
class CheckerValue:
    first: object  # Where floor(u) + floor(v) is even.
    second: object
    mapping: tuple = (1.0, 1.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class NodeValue:
    """A texture node of Blender that the renderer computes."""
    node: str          # The name that Sheaf has for it.
    parameters: tuple  # ((name, value), ...) of the texture class "node".
    space: str         # Where its places are: "uv", "world", "object" or "generated".
    matrix: tuple      # 16 numbers by rows: from there to the texture's space.
    reach: tuple = (0.0, 1.0)    # Least and greatest of its factor.
    wants_color: bool = False    # Whether its color counts, not its factor.
    operations: tuple = ()       # ((name, arguments), ...) of pixel_ops on the factor.
    is_simplified: bool = False  # Whether its color was replaced by its factor.
    # The name of an ATTRIBUTE, a color of vertices, and the operations on it before the channel
    # of the parameters is taken.
    attribute: str = ""
    at_vertices: tuple = ()


RAMP_STOPS = 513
ATTRIBUTE = "attribute"
_CHANNELS = ("red", "green", "blue")
# Operations that agree with mixing between vertices.
_LINEAR = {"multiply"}


def attribute_of_vertices(name, channel=""):
    """A NodeValue: a color, or one of its channels: "mean", "alpha" ..."""
    return NodeValue(ATTRIBUTE, (("channel", channel or "luminance"),), "uv", _IDENTITY,
                     wants_color=not channel, attribute=name)


def color_of_vertices(node):
    """(attribute, operations) that a NodeValue of an attribute reads; None for others."""
    return (node.attribute, node.at_vertices) if node.node == ATTRIBUTE else None


def node_ramp(value):
    """(positions, colors) of what the operations of a NodeValue or RampValue make of the number."""
    low, high = value.reach
    if not value.operations:  # Negative factors are black, and a ramp is linear between stops.
        low = max(low, 0.0)
    high = max(high, low + 1e-6)
    count = RAMP_STOPS if value.operations else 2
    at = [low + (high - low) * i / (count - 1) for i in range(count)]
    pixels = numpy.repeat(numpy.array(at, numpy.float64)[:, None], 3, axis=1)
    return at, pixel_ops.run(pixels, value.operations)


def is_constant(value):
    return isinstance(value, (int, float, tuple))


def is_color(value):
    if isinstance(value, tuple):
        return True
    if isinstance(value, ImageValue):
        return _makes_color(value.operations, True)
    if isinstance(value, (NodeValue, RampValue)):  # Operations of a node begin with its factor.
        return _makes_color(value.operations, getattr(value, "wants_color", False))
    if isinstance(value, ChannelsValue):
        return True
    if isinstance(value, ScaleValue):
        return is_color(value.value)
    if isinstance(value, (MixValue, CheckerValue)):
        return is_color(value.first) or is_color(value.second)
    return False


def _makes_color(operations, found):
    """Whether operations end in a color. found: whether they begin with one."""
    for name, arguments in operations:
        found = name not in pixel_ops.GRAY and (found or name in (
            "ramp", "curves", "mix", "hue_saturation") or (
                name == "multiply" and len(set(arguments)) > 1))
    return found


def is_composite(value):
    """Whether several textures make the value."""
    return isinstance(value, (MixValue, ScaleValue, CheckerValue, RampValue, ChannelsValue))


def reach_of(value):
    """(least, greatest) of a value's numbers; those of colors for all channels."""
    if is_constant(value):
        return min(color(value)), max(color(value))
    if isinstance(value, ImageValue):
        value = RampValue(None, (0.0, 1.0), value.operations)
    if isinstance(value, (NodeValue, RampValue)):
        numbers = node_ramp(value)[1]
        return float(numbers.min()), float(numbers.max())
    if isinstance(value, ScaleValue):
        products = [x * y for x in reach_of(value.value) for y in reach_of(value.factor)]
        return min(products), max(products)
    parts = value.parts if isinstance(value, ChannelsValue) else (value.first, value.second)
    limits = [limit for part in parts for limit in reach_of(part)]
    return min(limits), max(limits)


def color(value):
    """A constant as three floats; others as they are."""
    return (float(value),) * 3 if isinstance(value, (int, float)) else value


def gray(value):
    """As Blender turns colors into numbers: by luminance."""
    if isinstance(value, tuple):
        return sum(weight * part for weight, part in zip(_LUMINANCE, value))
    return apply(value, "gray") if is_color(value) else value


def nodes_of(value):
    """All NodeValues within a value, a material or any other of these dataclasses."""
    if isinstance(value, NodeValue):
        return [value]
    if isinstance(value, tuple):
        return [node for part in value for node in nodes_of(part)]
    if dataclasses.is_dataclass(value):
        return [node for field in dataclasses.fields(value)
                for node in nodes_of(getattr(value, field.name))]
    return []


def with_nodes(value, change):
    """The same with change(node) in place of each NodeValue within."""
    if isinstance(value, NodeValue):
        return change(value)
    if isinstance(value, tuple):
        return tuple(with_nodes(part, change) for part in value)
    if dataclasses.is_dataclass(value):
        return dataclasses.replace(value, **{
            field.name: with_nodes(getattr(value, field.name), change)
            for field in dataclasses.fields(value)})
    return value


def largest(value):
    """An upper bound of a constant's channels; 1 for textures."""
    return max(color(value)) if is_constant(value) else 1.0


def apply(value, name, *arguments):
    """The value after an operation of pixel_ops. Numbers that several textures make become a ramp,
    and colors one for each channel. Hues of mixes are those of their parts, which is exact where
    the amount is 0 or 1.
    """
    if is_constant(value):
        pixels = numpy.array([color(value)], numpy.float64)
        result = tuple(float(x) for x in pixel_ops.run(pixels, ((name, arguments),))[0])
        is_number = isinstance(value, (int, float)) or name in pixel_ops.GRAY
        return result[0] if is_number and len(set(result)) == 1 else result
    if isinstance(value, ImageValue):
        return dataclasses.replace(value, operations=value.operations + ((name, arguments),))
    if isinstance(value, NodeValue) and value.node == ATTRIBUTE and value.wants_color:
        return _apply_at_vertices(value, name, arguments)
    if isinstance(value, NodeValue):
        return dataclasses.replace(value, operations=value.operations + ((name, arguments),),
                                   wants_color=False,
                                   is_simplified=value.is_simplified or value.wants_color)
    if isinstance(value, RampValue):
        return dataclasses.replace(value, operations=value.operations + ((name, arguments),))
    if isinstance(value, ChannelsValue) and name in ("channel", "multiply", "gray"):
        return _apply_to_channels(value.parts, name, arguments)
    if name == "ramp" and is_color(value):  # It begins with the luminance.
        return apply(gray(value), name, *arguments)
    is_passed_on = name in pixel_ops.GRAY or name == "multiply" or isinstance(value, CheckerValue)
    if not is_passed_on and not is_color(value):
        return RampValue(value, reach_of(value), ((name, arguments),))
    if not is_passed_on and name not in pixel_ops.HUES:
        return combined([apply(apply(apply(value, "channel", i), name, *arguments), "channel", i)
                         for i in range(3)])
    if isinstance(value, ChannelsValue):
        return value  # A hue; NodeValues reports it.
    if isinstance(value, ScaleValue):
        return ScaleValue(apply(value.value, name, *arguments), value.factor)
    return dataclasses.replace(value, first=apply(value.first, name, *arguments),
                               second=apply(value.second, name, *arguments))


def _apply_to_channels(parts, name, arguments):
    if name == "channel":
        return parts[arguments[0]]
    weights = arguments if name == "multiply" else _LUMINANCE
    found = [multiply(part, weight) for part, weight in zip(parts, weights)]
    return combined(found) if name == "multiply" else add(add(found[0], found[1]), found[2])


def _apply_at_vertices(value, name, arguments):
    if name in pixel_ops.GRAY:
        channel = "luminance" if name == "gray" else _CHANNELS[arguments[0]]
        return dataclasses.replace(value, parameters=(("channel", channel),), wants_color=False)
    if name == "ramp":  # It begins with the luminance.
        return apply(apply(value, "gray"), name, *arguments)
    return dataclasses.replace(value, at_vertices=value.at_vertices + ((name, arguments),))


def is_exact_at_vertices(node):
    """Whether colors that are computed at the vertices are so between them."""
    return all(name in _LINEAR or name == "mix" and arguments[0] in ("MIX", "MULTIPLY", "ADD")
               for name, arguments in node.at_vertices)


# Operations whose results lie within 0 and 1.
_BOUNDED = {"gray", "channel", "clamp"}


def clamped(amount):
    """The value within 0 and 1, as factors of mixes are in Blender."""
    if is_constant(amount):
        return min(max(gray(amount), 0.0), 1.0)
    if isinstance(amount, ImageValue) and (
            all(name in _BOUNDED for name, _ in amount.operations)):
        return amount
    return apply(amount, "clamp", 0.0, 1.0)


def multiply(a, b):
    """The product; of two colors by channels."""
    if is_constant(b):
        return apply(a, "multiply", *color(b)) if b not in (1, 1.0, (1.0, 1.0, 1.0)) else a
    if is_constant(a):
        return multiply(b, a)
    if not is_color(b):
        return ScaleValue(a, b)
    return ScaleValue(b, a) if not is_color(a) else by_channel(multiply, a, b)


def by_channel(function, a, b):
    """The color of which each channel is function(a, b) of the channels; None where that is."""
    def channels(value):
        if is_constant(value):
            return color(value)
        return [apply(value, "channel", i) for i in range(3)] if is_color(value) else [value] * 3
    return combined([function(*both) for both in zip(channels(a), channels(b))])


def combined(parts):
    """The color of three numbers; None if one of them is."""
    if None in parts:
        return None
    parts = tuple(map(gray, parts))
    return parts if all(map(is_constant, parts)) else ChannelsValue(parts)


def sum_of_channels(value):
    """A ChannelsValue as the sum of three colored textures."""
    colors = [multiply(part, tuple(float(i == axis) for i in range(3)))
              for axis, part in enumerate(value.parts)]
    return add(add(colors[0], colors[1]), colors[2])


def add(a, b):
    """The sum: twice the even mix."""
    if is_constant(a) and is_constant(b):
        found = tuple(x + y for x, y in zip(color(a), color(b)))
        return found if is_color(a) or is_color(b) else found[0]
    return ScaleValue(MixValue(a, b, 0.5), 2.0)


def math(operation, a, b):
    """Blender's Math of two textures that are numbers; None for operations without counterpart."""
    if operation == "MULTIPLY":
        return multiply(a, b)
    if operation == "DIVIDE":
        return multiply(a, gray(apply(b, "math", "DIVIDE", 1.0, False)))
    if operation == "ADD":
        return add(a, b)
    difference = add(a, gray(apply(b, "multiply", -1.0, -1.0, -1.0)))
    if operation in ("LESS_THAN", "GREATER_THAN"):
        return apply(difference, "math", operation, 0.0, True)
    if operation == "SUBTRACT":
        return difference
    if operation in ("MINIMUM", "MAXIMUM"):
        return add(b, apply(difference, "math", operation, 0.0, True))
    return None


_MATH_OF_BLENDS = {"DARKEN": "MINIMUM", "LIGHTEN": "MAXIMUM", "MULTIPLY": "MULTIPLY",
                   "SUBTRACT": "SUBTRACT", "DIVIDE": "DIVIDE"}


def blend(kind, a, b):
    """Blender's mix of two values with the factor 1; None for kinds without counterpart."""
    if is_color(a) or is_color(b):
        return by_channel(lambda x, y: blend(kind, x, y), a, b)
    if kind in _MATH_OF_BLENDS:
        return math(_MATH_OF_BLENDS[kind], a, b)
    if kind == "DIFFERENCE":
        return apply(math("SUBTRACT", a, b), "math", "ABSOLUTE", 0.0, True)
    if kind == "SCREEN":
        return add(a, math("SUBTRACT", b, multiply(a, b)))
    return None


def mix(a, b, amount):
    amount = clamped(amount)
    if is_constant(amount):
        if amount == 0 or a == b:
            return a
        if amount == 1:
            return b
        if is_constant(a) and is_constant(b):
            result = tuple(x + (y - x) * amount for x, y in zip(color(a), color(b)))
            return result[0] if not (is_color(a) or is_color(b)) else result
    return MixValue(a, b, gray(amount))
