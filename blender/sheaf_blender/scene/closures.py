# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Shader trees: what Mix Shader and Add Shader make of surfaces, light and transparency."""
import dataclasses

from . import materials, values

BLACK = (0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Closure:
    """material: None if nothing scatters. alpha: the part that is not transparent."""
    material: object = None
    alpha: object = 1.0
    emission: object = BLACK  # Radiance, of both sides.


EMPTY = Closure(None, 0.0)


def mix(first, second, factor, item, report):
    """factor: the weight of second, a value."""
    if values.is_constant(factor):
        factor = min(max(values.gray(factor), 0.0), 1.0)
        if factor in (0.0, 1.0):
            return second if factor else first
    emission = _sum(_weighted(first.emission, factor, True, item, report),
                    _weighted(second.emission, factor, False, item, report), item, report)
    if is_transparent(first) or is_transparent(second):
        opaque, shown = (second, factor) if is_transparent(first) else (first, inverse(factor))
        alpha = _product(opaque.alpha, shown, item, report)
        return Closure(opaque.material, alpha, emission)
    if opacity(first) != 1.0 or opacity(second) != 1.0:
        report.approximated(item, "a mix of surfaces of which one is partly transparent: both have "
                                  "the mean of their alpha")
    alpha = values.mix(first.alpha, second.alpha, factor)
    a, b = (c.material or materials.diffuse(BLACK) for c in (first, second))
    if "subsurface" in (a.kind, b.kind):
        report.approximated(item, "a mix with Subsurface Scattering: the larger part is shown")
        return Closure(a if not values.is_constant(factor) or factor < 0.5 else b, alpha, emission)
    if {a.kind, b.kind} == {"diffuse", "diffusetransmission"} and values.is_constant(factor):
        return Closure(_diffuse_both(a, b, factor), alpha, emission)
    return Closure(materials.mix(a, b, factor), alpha, emission)


def add(first, second, item, report):
    emission = _sum(first.emission, second.emission, item, report)
    solid = [c for c in (first, second) if c.material is not None]
    if len(solid) < 2:
        chosen = solid[0] if solid else max((first, second), key=lambda c: opacity(c) or 0)
        return Closure(chosen.material, chosen.alpha, emission)
    a, b = (doubled(c.material) for c in solid)
    report.approximated(item, "Add Shader of two surfaces is an even mix with doubled colors, at "
                              "most white")
    return Closure(materials.mix(a, b, 0.5), solid[0].alpha, emission)


def is_transparent(closure):
    return closure.material is None and closure.emission == BLACK and closure.alpha == 0.0


def opacity(closure):
    return float(values.gray(closure.alpha)) if values.is_constant(closure.alpha) else None


def inverse(factor):
    if values.is_constant(factor):
        return 1.0 - values.gray(factor)
    return values.apply(factor, "invert", 1.0)


def doubled(material):
    return dataclasses.replace(
        material, parts=tuple(map(doubled, material.parts)),
        colors=tuple((name, values.apply(values.apply(value, "multiply", 2, 2, 2), "clamp", 0, 1))
                     for name, value in material.colors))


def _diffuse_both(a, b, factor):
    """A mix of diffuse reflection and transmission as one material."""
    weights = {a: 1 - factor, b: factor}
    result = {"reflectance": BLACK, "transmittance": BLACK}
    for material, weight in weights.items():
        for name, value in material.colors:
            scaled = values.apply(value, "multiply", weight, weight, weight)
            if result[name] == BLACK:
                result[name] = scaled
            elif scaled != BLACK:
                return materials.mix(a, b, factor)
    return materials.make("diffusetransmission", result)


def _weighted(emission, factor, is_first, item, report):
    if emission == BLACK:
        return BLACK
    weight = inverse(factor) if is_first else factor
    if not values.is_constant(weight):
        report.approximated(item, "Emission that a texture mixes: half of it shines everywhere")
        weight = 0.5
    return values.apply(emission, "multiply", weight, weight, weight)


def _sum(a, b, item, report):
    if a == BLACK or b == BLACK:
        return b if a == BLACK else a
    if values.is_constant(a) and values.is_constant(b):
        return tuple(x + y for x, y in zip(values.color(a), values.color(b)))
    report.left_out(item, "the second of two emissions of which one has a texture")
    return a


def _product(a, b, item, report):
    product = values.multiply(a, b)
    if product is None:
        report.approximated(item, "a product of two textures as alpha: the first is used")
        return a
    return product
