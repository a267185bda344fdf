# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Operations on pixels, (n, 3) arrays of linear values: the nodes of Blender that change each color
by itself. Formulas are those of Blender's manual for the nodes.
"""
import numpy

GRAY = {"gray", "channel"}  # Their results are numbers: the three channels are equal.
HUES = {"hue", "hue_saturation", "normal_strength"}  # A channel depends on the others.


def run(pixels, operations):
    for name, arguments in operations:
        pixels = _OPERATIONS[name](pixels, *arguments)
    return pixels


def _gray(p):
    return numpy.repeat((p @ numpy.array([0.2126, 0.7152, 0.0722]))[:, None], 3, axis=1)


def _channel(p, index):
    return numpy.repeat(p[:, index:index + 1], 3, axis=1)


def _multiply(p, *factors):
    return p * numpy.array(factors)


def _mix(p, blend, factor, other, other_is_second):
    """Blender's Mix node of the pixels and a constant color."""
    constant = numpy.broadcast_to(numpy.array(other, float), p.shape)
    a, b = (p, constant) if other_is_second else (constant, p)
    return a + (blend_colors(blend, a, b) - a) * factor


def blend_colors(blend, a, b):
    if blend == "MULTIPLY":
        return a * b
    if blend == "ADD":
        return a + b
    if blend == "SUBTRACT":
        return a - b
    if blend == "DIFFERENCE":
        return numpy.abs(a - b)
    if blend == "DARKEN":
        return numpy.minimum(a, b)
    if blend == "LIGHTEN":
        return numpy.maximum(a, b)
    if blend == "SCREEN":
        return 1 - (1 - a) * (1 - b)
    if blend == "OVERLAY":
        return numpy.where(a < 0.5, 2 * a * b, 1 - 2 * (1 - a) * (1 - b))
    if blend == "DIVIDE":
        return numpy.divide(a, b, out=numpy.zeros_like(a), where=b != 0)
    return b


BLENDS = {"MIX", "MULTIPLY", "ADD", "SUBTRACT", "DIFFERENCE", "DARKEN", "LIGHTEN", "SCREEN",
          "OVERLAY", "DIVIDE"}


def _math(p, operation, other, other_is_second):
    constant = numpy.broadcast_to(float(other), p.shape)
    return math(operation, *((p, constant) if other_is_second else (constant, p)))


def math(operation, a, b):
    with numpy.errstate(all="ignore"):
        result = MATH[operation](a, b)
    return numpy.where(numpy.isfinite(result), result, 0.0)


MATH = {
    "ADD": lambda a, b: a + b, "SUBTRACT": lambda a, b: a - b, "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: a / b, "POWER": numpy.power, "MINIMUM": numpy.minimum,
    "MAXIMUM": numpy.maximum, "SQRT": lambda a, _: numpy.sqrt(a),
    "ABSOLUTE": lambda a, _: numpy.abs(a), "LESS_THAN": lambda a, b: (a < b) * 1.0,
    "GREATER_THAN": lambda a, b: (a > b) * 1.0, "FRACT": lambda a, _: a - numpy.floor(a),
    "FLOOR": lambda a, _: numpy.floor(a), "CEIL": lambda a, _: numpy.ceil(a),
    "ROUND": lambda a, _: numpy.floor(a + 0.5), "EXPONENT": lambda a, _: numpy.exp(a),
    "SINE": lambda a, _: numpy.sin(a), "COSINE": lambda a, _: numpy.cos(a),
    "MODULO": numpy.fmod,
}


def _gamma(p, exponent):
    return numpy.where(p > 0, numpy.power(numpy.maximum(p, 1e-30), exponent), p)


def _invert(p, factor):
    return p + (1 - 2 * p) * factor


def _bright_contrast(p, brightness, contrast):
    return numpy.maximum((1 + contrast) * p + brightness - contrast * 0.5, 0)


def _clamp(p, low, high):
    return numpy.clip(p, low, high)


def _map_range(p, from_min, from_max, to_min, to_max, clamps):
    t = (p - from_min) / ((from_max - from_min) or 1.0)
    return to_min + (numpy.clip(t, 0, 1) if clamps else t) * (to_max - to_min)


def _ramp(p, colors):
    """colors: evenly spaced samples over [0, 1], as ((r, g, b), ...)."""
    table = numpy.array(colors, float)
    places = numpy.linspace(0, 1, len(table))
    factor = p @ numpy.array([0.2126, 0.7152, 0.0722])
    return numpy.stack([numpy.interp(factor, places, table[:, i]) for i in range(3)], axis=1)


def _curves(p, tables, low, high, is_extrapolated, factor):
    """tables: three rows of even samples from low to high."""
    places = numpy.linspace(low, high, len(tables[0]))
    turned = numpy.empty_like(p)
    for i, table in enumerate(tables):
        turned[:, i] = numpy.interp(p[:, i], places, table)
        if is_extrapolated:
            step = (high - low) / (len(table) - 1)
            below, above = p[:, i] < low, p[:, i] > high
            turned[below, i] += (p[below, i] - low) * (table[1] - table[0]) / step
            turned[above, i] += (p[above, i] - high) * (table[-1] - table[-2]) / step
    return p + (turned - p) * factor


def _hue_saturation(p, hue, saturation, value, factor):
    high, low = p.max(axis=1), p.min(axis=1)
    span = high - low
    safe = numpy.where(span > 0, span, 1)
    r, g, b = p.T
    h = numpy.select([high == r, high == g], [(g - b) / safe, 2 + (b - r) / safe],
                     4 + (r - g) / safe) / 6
    h = (h * (span > 0) + hue + 0.5) % 1.0
    s = numpy.clip(numpy.where(high > 0, span / numpy.where(high > 0, high, 1), 0) * saturation,
                   0, 1)
    v = high * value
    k = (numpy.array([5.0, 3.0, 1.0])[None, :] + 6 * h[:, None]) % 6
    turned = v[:, None] * (1 - s[:, None] * numpy.clip(numpy.minimum(k, 4 - k), 0, 1))
    return numpy.maximum(p + (turned - p) * factor, 0)


def _hue(p, amount):
    """Towards the color at a luminance of 1, from white; black is white."""
    luminance = _gray(p)
    hue = numpy.where(luminance > 0, p / numpy.where(luminance > 0, luminance, 1), 1)
    return 1 + (hue - 1) * amount


def _normal_strength(p, strength):
    """Moves a tangent space normal map towards (0, 0, 1) by 1 - strength, or beyond."""
    n = 2 * p - 1
    n = numpy.array([0.0, 0.0, 1.0]) + (n - numpy.array([0.0, 0.0, 1.0])) * strength
    n[:, 2] = numpy.maximum(n[:, 2], 1e-3)
    n /= numpy.linalg.norm(n, axis=1, keepdims=True)
    return n * 0.5 + 0.5


_OPERATIONS = {
    "gray": _gray, "channel": _channel, "multiply": _multiply, "mix": _mix, "math": _math,
    "gamma": _gamma, "invert": _invert, "bright_contrast": _bright_contrast, "clamp": _clamp,
    "map_range": _map_range, "ramp": _ramp, "hue_saturation": _hue_saturation,
    "hue": _hue, "curves": _curves, "normal_strength": _normal_strength,
}
