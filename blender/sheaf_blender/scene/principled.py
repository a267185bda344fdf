# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The Principled BSDF as Sheaf's material "principled" (docs/principled.md).

Blender's model is a mixture of three bases by Transmission and Metallic, below a coat and sheen:
opaque, glass and metal. Where they agree in all inputs they are one material whose parameters say
the mixture; otherwise there is a mix of materials.

Since Blender 4.0 each layer leaves the rest to what is below, as Sheaf's do, and the reflection at
normal incidence is that of IOR, times twice the level. Before, it is 0.08 Specular, and reflection,
coat and sheen are added to the base: it gets the color that has this albedo below Sheaf's layers.
Sources: Blender's manual of 3.4 and 4.3, "Principled BSDF"; Burley 2012, "Physically Based Shading
at Disney" (diffuse and sheen before 4.0).
"""
import dataclasses
import functools
import math

import numpy

from . import materials, values

WHITE = (1.0, 1.0, 1.0)
KIND = "principled"
SPECULAR_SCALE = 0.08      # Reflection of a Specular of 1, before Blender 4.0.
IOR_MAX = 10.0             # Sheaf's limit.
COAT_SCALE = 0.25          # Clearcoat before Blender 4.0.
# Sheen before Blender 4.0 is (1 - cos(h, l))^5 cos(l). This roughness and factor of Sheaf's sheen
# have its albedo, within 0.001 on average over the directions.
ADDED_SHEEN_ROUGHNESS, ADDED_SHEEN_SCALE, ADDED_SHEEN_ALBEDO = 0.35, 0.101, 0.0116
# Disney's diffuse albedo over Lambert's, averaged over directions: linear in roughness within
# 0.002.
ADDED_DIFFUSE, ADDED_DIFFUSE_SLOPE = 0.953, 0.112
DIRECTIONS_MAX = 0.03  # Difference from Lambert's albedo that shows between bright walls,
BRIGHT_MIN = 0.5       # which have this color or more.
SCALE_MIN = 1e-3       # Less than this of a reflection is not written.
# Since 4.0 sheen is that of Zeltner et al. 2022, "Practical Multiple-Scattering Sheen Using
# Linearly Transformed Cosines". Its roughness, then roughness and factor of Sheaf's sheen that fit
# the albedo which Cycles 4.3 shows on spheres: within 0.008 up to 0.6, within 0.03 at 0.7.
_FIBERS = ((0.0, 0.1, 0.0), (0.1, 0.1, 0.148), (0.2, 0.125, 0.676), (0.3, 0.2, 0.798),
           (0.4, 0.3, 0.787), (0.5, 0.4, 0.83), (0.6, 0.55, 0.97), (0.7, 0.875, 1.0),
           (0.8, 1.0, 1.0))
FIBERS_ROUGHNESS_MAX = 0.7
_ANGLES = 4096
_STEPS = 24         # In each of three dimensions; reflection_means are within 0.001.
_ALPHA_MIN = 1e-3   # Smoother facets are a mirror.
_ROUGHNESS_IS_ALPHA = {"bool remaproughness": False}


@functools.lru_cache(maxsize=256)
def fresnel_mean(ior):
    """The mean reflectance of a dielectric for diffuse light from outside."""
    total = 0.0
    for i in range(_ANGLES):
        sine_squared = (i + 0.5) / _ANGLES  # Uniform in it: the density of diffuse light.
        cosine = (1 - sine_squared) ** 0.5
        inside = (1 - sine_squared / ior**2) ** 0.5
        parallel = (ior * cosine - inside) / (ior * cosine + inside)
        perpendicular = (cosine - ior * inside) / (cosine + ior * inside)
        total += (parallel**2 + perpendicular**2) / 2
    return total / _ANGLES


@functools.lru_cache(maxsize=4096)
def reflection_means(ior, roughness):
    """(what one facet of a rough dielectric reflects of diffuse light from outside, what several
    facets reflect). roughness: Blender's. Visible facets: Heitz 2018, "Sampling the GGX
    Distribution of Visible Normals"; several: Kulla and Conty 2017, "Revisiting Physically Based
    Shading at Imageworks".
    """
    alpha, smooth = min(max(roughness, 0.0), 1.0) ** 2, fresnel_mean(ior)
    if alpha < _ALPHA_MIN:
        return smooth, 0.0
    steps = (numpy.arange(_STEPS) + 0.5) / _STEPS
    cosine, radius, turn = numpy.meshgrid(numpy.sqrt(steps), numpy.sqrt(steps), 2 * math.pi * steps)
    sine = numpy.sqrt(1 - cosine**2)
    x = alpha * sine  # The direction outside, where the surface is stretched to alpha 1.
    length = numpy.hypot(x, cosine)
    x, z = x / length, cosine / length
    a = radius * numpy.cos(turn)
    b = radius * numpy.sin(turn)
    half = (1 + z) / 2
    a = (1 - half) * numpy.sqrt(1 - b**2) + half * a
    c = numpy.sqrt(numpy.maximum(1 - a**2 - b**2, 0))
    facet = numpy.stack([alpha * (x * c - z * a), alpha * b, numpy.maximum(z * c + x * a, 1e-9)])
    facet /= numpy.linalg.norm(facet, axis=0)
    met = facet[0] * sine + facet[2] * cosine
    leaving = 2 * met * facet[2] - cosine
    shadow = lambda mu: 2 / (1 + numpy.sqrt(1 + alpha**2 * (1 / numpy.maximum(mu, 1e-6)**2 - 1)))
    first, second = shadow(cosine), shadow(leaving)
    seen = numpy.where(leaving > 0, second / (first + second - first * second), 0)
    inside = numpy.sqrt(1 - (1 - met**2) / ior**2)
    parallel = (ior * met - inside) / (ior * met + inside)
    perpendicular = (met - ior * inside) / (met + ior * inside)
    kept = float(seen.mean())
    once = float(((parallel**2 + perpendicular**2) / 2 * seen).mean())
    return once, (1 - kept) * smooth**2 * kept / (1 - smooth * (1 - kept))


def ior_of_reflectance(f0):
    """At most IOR_MAX, to six digits: sockets are floats of 32 bits."""
    root = min(max(f0, 0.0), 0.98) ** 0.5
    return min(round((1 + root) / (1 - root), 6), IOR_MAX)


def reflectance_of_ior(ior):
    return ((ior - 1) / (ior + 1)) ** 2


@dataclasses.dataclass
class PrincipledInputs:
    """Values of the sockets, by the names of the current Blender; the defaults are Blender's.
    Objects may be textures.
    """
    base_color: object = (0.8, 0.8, 0.8)
    metallic: object = 0.0
    roughness: object = 0.5
    ior: float = 1.5
    specular: object = 0.5         # Specular IOR Level, or Specular.
    specular_tint: object = WHITE  # Before 4.0 a number: how much of the base's hue it has.
    anisotropic: float = 0.0
    rotation: float = 0.0          # Turns.
    transmission: object = 0.0
    subsurface: float = 0.0
    subsurface_radius: tuple = (1.0, 0.2, 0.1)  # In units of the scene, scale included.
    sheen: object = 0.0
    sheen_roughness: float = 0.5
    sheen_tint: object = WHITE     # Before 4.0 a number, as specular_tint.
    coat: object = 0.0
    coat_roughness: float = 0.03
    coat_ior: float = 1.5
    coat_tint: object = WHITE
    film_nm: float = 0.0           # Thin Film Thickness.
    film_ior: float = 1.33
    is_layered: bool = True        # Blender 4.0 and later.
    keeps_energy: bool = True      # Multiscatter GGX.


def square(value):
    """Blender's roughness as the roughness of the facets (alpha)."""
    if values.is_constant(value):
        return max(values.gray(value), 0.0) ** 2
    if isinstance(value, values.ImageValue):
        return values.apply(value, "math", "POWER", 2.0, True)
    return values.ScaleValue(value, value)


def surface(colors, floats, transmission=None, metallic=None):
    """A principled Material. Inputs at Sheaf's defaults and zeros are not written."""
    usual = {"specular_tint": WHITE, "sheen_color": (0.0, 0.0, 0.0), "ior": 1.5, "anisotropy": 0.0,
             "specular": 1.0, "coat": 0.0, "iridescence": 0.0, "transmission": 0.0, "metallic": 0.0}
    colors = {name: _within(values.color(value)) for name, value in colors.items()}
    floats = {name: value for name, value in {
        **floats, "transmission": transmission or 0.0, "metallic": metallic or 0.0}.items()}
    return materials.make(
        KIND, {name: value for name, value in colors.items() if value != usual.get(name)},
        {name: value for name, value in floats.items() if value != usual.get(name)})


def _within(value):
    """A constant within [0, 1]."""
    if not values.is_constant(value):
        return value
    return (tuple(min(max(float(x), 0.0), 1.0) for x in value) if isinstance(value, tuple)
            else min(max(float(value), 0.0), 1.0))


def facets(roughness, squeeze, turns, mean_of):
    """Parameters of facets that are rougher by 1 / squeeze along an axis, and by squeeze across it:
    Sheaf's strength is sqrt((along - across) / (1 - across)) for those values of alpha. turns: from
    the first tangent to the rough axis. mean_of: gives the mean of a texture.
    """
    roughness = _within(roughness)
    if squeeze >= 1:
        return {"roughness": roughness}
    alpha = min(mean_of(roughness) ** 2, 1.0)
    across, along = alpha * squeeze, min(alpha / squeeze, 1.0)
    strength = ((along - across) / (1 - across)) ** 0.5 if across < 1 else 0.0
    found = {"roughness": values.apply(roughness, "multiply", *(squeeze ** 0.5,) * 3),
             "anisotropy": strength}
    if turns % 1:
        found["anisotropy_rotation"] = 2 * math.pi * (turns % 1)
    return found


def sheen_of_fibers(color, roughness, item, report):
    """(color, roughness) of Sheaf's sheen for that of Blender since 4.0."""
    nodes = numpy.array(_FIBERS).T
    if roughness > FIBERS_ROUGHNESS_MAX:
        report.approximated(item, f"Sheen Roughness {roughness:.2f}: from "
                                  f"{FIBERS_ROUGHNESS_MAX} on there is less sheen than in Cycles")
    ours, factor = (float(numpy.interp(roughness, nodes[0], nodes[i])) for i in (1, 2))
    return values.apply(color, "multiply", *(factor,) * 3), ours


def metal(color, facet_parameters):
    """A surface that reflects the color, more at grazing angles."""
    return surface({"base_color": color}, facet_parameters, metallic=1.0)


def glass(color, roughness, ior, item, report, **more):
    """A boundary that tints light by the color at each crossing. more: specular, specular_tint."""
    color = _within(values.color(color))
    tint = more.pop("specular_tint", WHITE)
    if color == WHITE and tint == WHITE and not more:
        return clear_glass(roughness, ior)
    if ior < 1:
        report.left_out(item, f"the color of glass with the index {ior:.3g}; it is clear")
        return clear_glass(roughness, ior)
    return surface({"base_color": color, "specular_tint": tint},
                   {"roughness": _within(roughness), "ior": _ior(ior), **more}, transmission=1.0)


def clear_glass(roughness, ior):
    if abs(ior - 1) < 1e-4:
        return materials.make("interface")
    return materials.make("dielectric", floats={"roughness": square(roughness),
                                                "eta": float(ior)}, others=_ROUGHNESS_IS_ALPHA)


def coated(color, roughness, ior, tint=WHITE):
    """A base below a reflection that leaves it the rest."""
    return surface({"base_color": color, "specular_tint": tint},
                   {"roughness": _within(roughness), "ior": _ior(ior)})


def _ior(ior):
    return min(max(float(ior), 1.0), IOR_MAX)


def subsurface(color, radius, ior, roughness, item, report):
    """ior, roughness: of the boundary, which reflects nothing where ior is 1; Blender's."""
    boundary = " behind a dielectric boundary" if ior > 1 else ""
    report.approximated(item, f"Subsurface is a random walk{boundary}; the radius is its mean free "
                              "path")
    mfp = tuple(max(r, 1e-6) for r in radius)
    return materials.make("subsurface", {"reflectance": values.apply(color, "clamp", 0.0, 0.98),
                                         "mfp": mfp},
                          {"eta": max(float(ior), 1.0), "roughness": square(roughness)},
                          _ROUGHNESS_IS_ALPHA)


def principled_material(inputs, item, report, mean_of=values.gray):
    """The material without alpha, emission and normals. mean_of: gives the mean of a texture."""
    return _Reader(inputs, item, report, mean_of).material()


class _Reader:
    """Makes the material of one node."""

    def __init__(self, inputs, item, report, mean_of):
        self.inputs, self.item, self.report, self.mean_of = inputs, item, report, mean_of

    def material(self):
        transmission, metallic = _within(self.inputs.transmission), _within(self.inputs.metallic)
        shared = self._shared()
        if metallic == 1.0:
            return self._metal(shared)
        if transmission == 1.0:
            base = self._glass(shared)
        else:
            base = self._opaque(shared)
            if transmission != 0.0:
                base = self._blend(base, self._glass(shared), "transmission", transmission)
        if metallic != 0.0:
            base = self._with_metal(base, shared, metallic)
        return simplified(base)

    def _shared(self):
        """(colors, floats) of all three bases."""
        inputs = self.inputs
        squeeze = (1 - 0.9 * min(max(inputs.anisotropic, 0.0), 1.0)) ** 0.5
        floats = facets(inputs.roughness, squeeze, inputs.rotation, self.mean_of)
        coat = _within(inputs.coat)
        if coat != 0.0:
            floats["coat"] = coat if inputs.is_layered else self._product(coat, COAT_SCALE)
            floats["coat_roughness"] = _within(inputs.coat_roughness)
            floats["coat_ior"] = _ior(inputs.coat_ior)
        if inputs.film_nm > 0:
            floats.update({"iridescence": 1.0, "iridescence_ior": _ior(inputs.film_ior),
                           "iridescence_thickness_nm": min(inputs.film_nm, 10000.0)})
        colors = {}
        if _within(inputs.sheen) != 0.0:
            colors["sheen_color"], floats["sheen_roughness"] = self._sheen()
        return colors, floats

    def _sheen(self):
        """(color, roughness)."""
        inputs = self.inputs
        if inputs.is_layered:
            return sheen_of_fibers(self._product(inputs.sheen_tint, inputs.sheen),
                                   inputs.sheen_roughness, self.item, self.report)
        color = self._product(self._hue(inputs.sheen_tint), inputs.sheen)
        for other in (inputs.metallic, inputs.transmission):
            color = self._product(color, _inverse(other))
        return self._product(color, ADDED_SHEEN_SCALE), ADDED_SHEEN_ROUGHNESS

    def _hue(self, amount):
        """White, or by the amount the base color at a luminance of 1."""
        amount = self.mean_of(values.gray(amount))
        return values.apply(self.inputs.base_color, "hue", amount) if amount else WHITE

    def _product(self, a, b):
        found = values.multiply(a, b)
        if found is not None:
            return found
        self.report.approximated(self.item, "a product of two colored textures: the mean of one is "
                                            "used")
        return values.multiply(a, self.mean_of(values.gray(b)))

    def _opaque(self, shared):
        inputs, item, report = self.inputs, self.item, self.report
        if inputs.subsurface >= 0.5:
            if inputs.subsurface < 1:
                report.approximated(item, f"Subsurface {inputs.subsurface:.2f} is rendered as 1")
            return subsurface(inputs.base_color, inputs.subsurface_radius, inputs.ior,
                              inputs.roughness, item, report)
        if inputs.subsurface > 0:
            report.left_out(item, f"Subsurface {inputs.subsurface:.2f} is below 0.5; the surface "
                                  "is diffuse")
        ior, tint = self._specular()
        color = self._below_coat(inputs.base_color)
        floats = {**shared[1], "ior": ior}
        if not inputs.is_layered:
            color, floats["specular"] = self._added_to(color, ior)
        return surface({"base_color": color, "specular_tint": self._below_coat(tint), **shared[0]},
                       floats)

    def _specular(self):
        """(index, tint) of the opaque base's reflection."""
        inputs = self.inputs
        tint = inputs.specular_tint if inputs.is_layered else self._hue(inputs.specular_tint)
        f0 = 2 * reflectance_of_ior(inputs.ior) if inputs.is_layered else SPECULAR_SCALE
        level = inputs.specular
        if values.is_constant(level):
            f0 *= max(values.gray(level), 0.0)
        else:  # The index is that of a level of 1, and the texture makes it less.
            tint = self._product(tint, level)
        if values.is_constant(tint):
            tint = values.color(tint)
            if max(tint) > 1:
                f0, tint = f0 * max(tint), tuple(x / max(tint) for x in tint)
        return ior_of_reflectance(f0), tint

    def _below_coat(self, color):
        """The color as a tinted coat shows it at normal incidence."""
        inputs = self.inputs
        tint, weight = values.color(inputs.coat_tint), _within(inputs.coat)
        if weight == 0.0 or tint == WHITE:
            return color
        if not values.is_constant(tint) or not values.is_constant(weight):
            self.report.left_out(self.item, "a texture of Coat Tint, or of the weight of a tinted "
                                            "coat")
            return color
        self.report.approximated(self.item, "Coat Tint tints what is below the coat, in all "
                                            "directions alike")
        return self._product(color, tuple(1 + (x - 1) * weight for x in tint))

    def _added_to(self, color, ior):
        """(base that has this albedo below layers, factor of their reflection), of Blender before
        4.0.
        """
        inputs = self.inputs
        mean = lambda value: self.mean_of(values.gray(_within(value)))
        roughness = round(mean(inputs.roughness), 3)
        once, more = reflection_means(ior, roughness) if ior > 1 else (0.0, 0.0)
        # Cycles loses what several facets reflect.
        scale = once / (once + more) if once and not inputs.keeps_energy else 1.0
        coat = reflection_means(_ior(inputs.coat_ior), round(mean(inputs.coat_roughness), 3))
        left = 1 - scale * (once + more)
        left *= 1 - COAT_SCALE * mean(inputs.coat) * sum(coat)
        left *= 1 - ADDED_SHEEN_ALBEDO * mean(inputs.sheen)
        diffuse = ADDED_DIFFUSE + ADDED_DIFFUSE_SLOPE * roughness
        if abs(diffuse - 1) > DIRECTIONS_MAX and mean(color) > BRIGHT_MIN:
            self.report.approximated(self.item, "its base is as bright as Disney's in the mean of "
                                     "all directions: up to 5 % off in closed rooms")
        scale = 1.0 if scale > 1 - SCALE_MIN else round(scale, 4)
        if values.is_constant(color):
            return _within(tuple(diffuse / left * x for x in values.color(color))), scale
        return values.ScaleValue(color, diffuse / left), scale

    def _glass(self, shared):
        inputs = self.inputs
        color = self._below_coat(inputs.base_color)
        if inputs.is_layered:  # Light that crosses twice has the color.
            color, tint = values.apply(color, "math", "SQRT", 0.0, True), inputs.specular_tint
        else:
            tint = values.mix(WHITE, inputs.base_color,
                              self.mean_of(values.gray(inputs.specular_tint)))
        if inputs.ior < 1:
            return glass(color, inputs.roughness, inputs.ior, self.item, self.report)
        return surface({"base_color": color, "specular_tint": tint, **shared[0]},
                       {**shared[1], "ior": _ior(inputs.ior)}, transmission=1.0)

    def _metal(self, shared):
        if self.inputs.is_layered and self.inputs.specular_tint != WHITE:
            self.report.left_out(self.item, "Specular Tint of metal, at grazing angles")
        return surface({"base_color": self._below_coat(self.inputs.base_color), **shared[0]},
                       shared[1], metallic=1.0)

    def _with_metal(self, base, shared, metallic):
        metal_part = self._metal(shared)
        if base.kind == KIND and (dict(base.colors)["base_color"]
                                  == dict(metal_part.colors)["base_color"]):
            return _with(base, "metallic", metallic)  # Its other inputs mean nothing to metal.
        return self._blend(base, metal_part, "metallic", metallic)

    def _blend(self, first, second, name, amount):
        if "subsurface" in (first.kind, second.kind):
            other = {"transmission": "the surface is glass", "metallic": "the surface is metal"}
            self.report.left_out(self.item, f"Subsurface beside {name.title()}; {other[name]}")
            return second
        if first.kind == KIND and _with(first, name, 1.0) == second:
            return _with(first, name, amount)
        return materials.mix(simplified(first), simplified(second), amount)


def _inverse(value):
    if values.is_constant(value):
        return 1 - min(max(values.gray(value), 0.0), 1.0)
    return values.apply(value, "invert", 1.0)


def _with(material, name, value):
    return dataclasses.replace(
        material, floats=tuple(sorted({**dict(material.floats), name: value}.items())))


def simplified(material):
    """The material, or a simpler one that scatters in the same way."""
    floats, colors = dict(material.floats), dict(material.colors)
    if material.kind != KIND or set(colors) != {"base_color"}:
        return material
    color, ior = colors["base_color"], floats.get("ior", 1.5)
    if set(floats) <= {"roughness", "ior", "transmission"}:
        if floats.get("transmission") == 1.0 and color == WHITE:
            return clear_glass(floats["roughness"], ior)
        if "transmission" not in floats and ior == 1:
            return materials.diffuse(color)
    return material
