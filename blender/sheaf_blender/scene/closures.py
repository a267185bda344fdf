# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Shader trees: what Mix Shader and Add Shader make of surfaces, light and transparency."""
import dataclasses

from . import materials, values

BLACK = (0.0, 0.0, 0.0)
PINK = (1.0, 0.0, 1.0)  # The color of what is missing, as in Cycles.


@dataclasses.dataclass(frozen=True)
class Closure:
    """material: None if nothing scatters. alpha: the part that is not transparent."""
    material: object = None
    alpha: object = 1.0
    emission: object = BLACK  # Radiance, of both sides, of the part that is not transparent.


EMPTY = Closure(None, 0.0)
NOTHING = Closure(None, 1.0)  # A socket without a shader: black, and light does not pass.
GLOW_ALPHA = 0.1  # For a surface that shines and is transparent: Sheaf cuts both by alpha.
# Light passes straight through the part that alpha leaves.
GLOW_MATERIAL = materials.make("thindielectric", floats={"eta": 1.0})


def mix(first, second, factor, item, report):
    """factor: the weight of second, a value."""
    factor = values.clamped(factor)
    if values.is_constant(factor):
        factor = values.gray(factor)
        if factor in (0.0, 1.0):
            return second if factor else first
    if is_transparent(first) or is_transparent(second):
        opaque, shown = (second, factor) if is_transparent(first) else (first, inverse(factor))
        return dataclasses.replace(opaque, alpha=_product(opaque.alpha, shown, item, report))
    if opacity(first) != 1.0 or opacity(second) != 1.0:
        report.approximated(item, "a mix of surfaces of which one is partly transparent: both have "
                                  "the mean of their alpha")
    alpha = values.mix(first.alpha, second.alpha, factor)
    emission = _mixed_emission(first, second, factor, alpha, item, report)
    a, b = (c.material or materials.diffuse(BLACK) for c in (first, second))
    if first.material is None and second.material is None:
        return Closure(None, alpha, emission)
    if "subsurface" in (a.kind, b.kind):
        report.approximated(item, "a mix with Subsurface Scattering: the larger part is shown")
        return Closure(a if not values.is_constant(factor) or factor < 0.5 else b, alpha, emission)
    if {a.kind, b.kind} == {"diffuse", "diffusetransmission"} and values.is_constant(factor):
        return Closure(_diffuse_both(a, b, factor), alpha, emission)
    return Closure(materials.mix(a, b, factor), alpha, emission)


def _mixed_emission(first, second, factor, alpha, item, report):
    """The emission that alpha cuts to what both shine together."""
    shares = [1.0, 1.0]
    opaque = [opacity(first), opacity(second)]
    total = float(values.gray(alpha)) if values.is_constant(alpha) else None
    if total and None not in opaque:
        shares = [part / total for part in opaque]
    return _sum(_weighted(first.emission, factor, True, shares[0], item, report),
                _weighted(second.emission, factor, False, shares[1], item, report), item, report)


def add(first, second, item, report):
    """The sum passes the light that both pass, and shines as both do."""
    if is_empty(first) or is_empty(second):
        return second if is_empty(first) else first
    solid = [c for c in (first, second) if c.material is not None]
    shines = [c.emission != BLACK for c in (first, second)]
    if len(solid) < 2:
        alpha = _added_alpha(first, second, item, report)
        if alpha == 0.0 and any(shines):
            return _glow(first, second, item, report)
        emission = BLACK
        for one in (first, second):
            emission = _sum(emission, _cut_by(one, alpha, item, report), item, report)
        return Closure(solid[0].material if solid else None, alpha, emission)
    a, b = (doubled(c.material) for c in solid)
    report.approximated(item, "Add Shader of two surfaces is an even mix with doubled colors, at "
                              "most white")
    return Closure(materials.mix(a, b, 0.5), solid[0].alpha,
                   _sum(first.emission, second.emission, item, report))


def _added_alpha(first, second, item, report):
    """1 less the sum of what is transparent."""
    a, b = first.alpha, second.alpha
    if values.is_constant(a) and values.is_constant(b):
        total = values.gray(a) + values.gray(b) - 1
        if total > 0 or is_transparent(first) or is_transparent(second):
            return min(max(total, 0.0), 1.0)
    elif values.is_constant(a) and values.gray(a) == 1.0:
        return b
    elif values.is_constant(b) and values.gray(b) == 1.0:
        return a
    report.approximated(item, "Add Shader of two transparent surfaces has the alpha of the first")
    return a


def _cut_by(closure, alpha, item, report):
    """The emission of a part of a sum whose alpha is given."""
    own, total = opacity(closure), values.gray(alpha) if values.is_constant(alpha) else None
    if closure.emission == BLACK or closure.alpha == alpha:
        return closure.emission
    if own is None or not total:
        report.approximated(item, "light of a surface whose alpha is a texture is cut by it")
        return closure.emission
    return values.apply(closure.emission, "multiply", *(own / total,) * 3)


def _glow(first, second, item, report):
    """Light in front of what is behind: some rays meet the surface and show more light."""
    report.approximated(item, f"a transparent surface that shines casts {GLOW_ALPHA:.0%} of a "
                              "shadow in the light of lamps without size")
    emission = BLACK
    for one in (first, second):
        if one.emission != BLACK:
            share = (1.0 if opacity(one) is None else opacity(one)) / GLOW_ALPHA
            emission = _sum(emission, values.apply(one.emission, "multiply", *(share,) * 3), item,
                            report)
    return Closure(GLOW_MATERIAL, GLOW_ALPHA, emission)


def is_empty(closure):
    """Whether it is that of a socket without a shader."""
    return closure is NOTHING


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


def _weighted(emission, factor, is_first, share, item, report):
    if emission == BLACK:
        return BLACK
    weight = inverse(factor) if is_first else factor
    if values.is_constant(weight):
        return values.apply(emission, "multiply", *(weight * share,) * 3)
    if values.is_constant(emission):
        return values.mix(BLACK, values.apply(emission, "multiply", *(share,) * 3), weight)
    report.approximated(item, "Emission of a texture that a texture mixes: half of it shines "
                              "everywhere")
    return values.apply(emission, "multiply", 0.5, 0.5, 0.5)


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
