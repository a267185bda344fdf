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
    """(positions, colors) of what the operations make of the node's factor."""
    low, high = value.reach
    if not value.operations:  # Negative factors are black, and a ramp is linear between stops.
        low = max(low, 0.0)
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
        return not any(name in pixel_ops.GRAY for name, _ in value.operations)
    if isinstance(value, NodeValue):
        if not value.operations:
            return value.wants_color
        return not any(name in pixel_ops.GRAY for name, _ in value.operations)
    if isinstance(value, ScaleValue):
        return is_color(value.value)
    if isinstance(value, (MixValue, CheckerValue)):
        return is_color(value.first) or is_color(value.second)
    return False


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
    """The value after an operation of pixel_ops. Mixes and checkers pass it on to their parts,
    which is exact for multiplications, and for other operations where the amount is 0 or 1.
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
    if isinstance(value, ScaleValue):
        if name == "multiply":
            return ScaleValue(apply(value.value, name, *arguments), value.factor)
        return ScaleValue(apply(value.value, name, *arguments), apply(value.factor, "clamp", 0, 1))
    return dataclasses.replace(value, first=apply(value.first, name, *arguments),
                               second=apply(value.second, name, *arguments))


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
    """None where the format has no such texture: the product of two colored ones."""
    if is_constant(b):
        return apply(a, "multiply", *color(b)) if b not in (1, 1.0, (1.0, 1.0, 1.0)) else a
    if is_constant(a):
        return multiply(b, a)
    if not is_color(b):
        return ScaleValue(a, b)
    return ScaleValue(b, a) if not is_color(a) else None


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
