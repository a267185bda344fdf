# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The Principled BSDF as the closest materials that Sheaf has.

Opaque and not metallic: a diffuse base below a smooth or rough dielectric coat (coateddiffuse).
Metallic: a conductor. Transmission: a dielectric. In between: mixes of these.

Cycles adds the reflection to the base; light that the base of a coateddiffuse scatters is partly
reflected back by the coat from inside. So the base gets the color whose albedo through the coat is
that of the Principled BSDF: with Fe the mean reflectance of the coat from outside, Fi from inside
(Egan and Hilgeman 1973: 1 - Fi = (1 - Fe) / n^2), the albedo of a base b is
(1 - Fe) (1 - Fi) b / (1 - Fi b), which is solved for b.
"""
import dataclasses
import functools

from . import materials, values

SPECULAR_MIN = 0.002  # A reflectance at normal incidence below this is no coat.
_ANGLES = 4096


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


def ior_of_reflectance(f0):
    root = min(max(f0, 0.0), 0.98) ** 0.5
    return (1 + root) / (1 - root)


@dataclasses.dataclass
class PrincipledInputs:
    """Values of the sockets, by the names of the current Blender; the defaults are Blender's."""
    base_color: object = (0.8, 0.8, 0.8)
    metallic: object = 0.0
    roughness: object = 0.5
    ior: float = 1.5
    reflectance: float = 0.04    # Of the specular layer at normal incidence.
    transmission: object = 0.0
    alpha: object = 1.0
    subsurface: float = 0.0
    subsurface_radius: tuple = (1.0, 0.2, 0.1)  # In units of the scene, scale included.
    anisotropic: float = 0.0
    coat: float = 0.0
    coat_roughness: float = 0.03
    coat_ior: float = 1.5
    adds_layers: bool = False  # Before Blender 4.0 reflection is added to the base, not above it.


def square(value):
    """Blender's roughness as the roughness of the facets (alpha)."""
    if values.is_constant(value):
        return max(values.gray(value), 0.0) ** 2
    if isinstance(value, values.ImageValue):
        return values.apply(value, "math", "POWER", 2.0, True)
    return values.ScaleValue(value, value)


def roughness_parameters(roughness, anisotropic=0.0):
    alpha = square(roughness)
    if anisotropic > 0 and values.is_constant(alpha):
        aspect = (1 - 0.9 * min(anisotropic, 1.0)) ** 0.5
        return {"uroughness": alpha / aspect, "vroughness": alpha * aspect}
    return {"roughness": alpha}


_ALPHA = {"bool remaproughness": False}


def conductor(color, roughness, anisotropic=0.0):
    return materials.make("conductor", {"reflectance": color},
                          roughness_parameters(roughness, anisotropic), _ALPHA)


def dielectric(ior, roughness):
    if abs(ior - 1) < 1e-4:
        return materials.make("interface")
    return materials.make("dielectric", floats={**roughness_parameters(roughness),
                                                "eta": float(ior)}, others=_ALPHA)


def coated(color, roughness, ior, adds_layers):
    """A base of this albedo below a coat."""
    outside = fresnel_mean(ior)
    inside = 1 - (1 - outside) / ior**2
    wanted = color if adds_layers else values.apply(color, "multiply", *(1 - outside,) * 3)
    base = values.apply(wanted, "under_coat", (1 - outside) * (1 - inside), inside)
    return materials.make("coateddiffuse", {"reflectance": base},
                          {**roughness_parameters(roughness), "eta": float(ior),
                           "thickness": 1e-4}, _ALPHA)


def base_material(inputs, item, report):
    color, roughness = inputs.base_color, inputs.roughness
    if inputs.subsurface > 0:
        if inputs.subsurface >= 0.5:
            if inputs.subsurface < 1:
                report.approximated(item, f"Subsurface {inputs.subsurface:.2f} is rendered as 1")
            return subsurface(color, inputs.subsurface_radius, inputs.ior, roughness, item, report)
        report.left_out(item, f"Subsurface {inputs.subsurface:.2f} is below 0.5; the surface is "
                              "diffuse")
    if inputs.reflectance < SPECULAR_MIN:
        return materials.diffuse(color)
    if not values.is_constant(roughness):
        report.approximated(item, "a map of the Roughness of a coat: 0.5 is used")
        roughness = 0.5
    ior = ior_of_reflectance(inputs.reflectance)
    report.approximated(item, "base and specular are a coateddiffuse of the same albedo")
    return coated(color, roughness, ior, inputs.adds_layers)


def subsurface(color, radius, ior, roughness, item, report):
    report.approximated(item, "Subsurface is a random walk behind a dielectric boundary; the "
                              "radius is its mean free path")
    mfp = tuple(max(r, 1e-6) for r in radius)
    return materials.make("subsurface", {"reflectance": values.apply(color, "clamp", 0.0, 0.98),
                                         "mfp": mfp},
                          {"eta": max(float(ior), 1.0001)}, {})


def principled_material(inputs, item, report):
    """The material without its alpha, emission and normals."""
    metallic, transmission = inputs.metallic, inputs.transmission
    parts = None
    is_metal = values.is_constant(metallic) and values.gray(metallic) >= 1
    if not is_metal:
        is_glass = values.is_constant(transmission) and values.gray(transmission) >= 1
        if not is_glass:
            parts = base_material(inputs, item, report)
        if not values.is_constant(transmission) or values.gray(transmission) > 0:
            glass = glass_material(inputs.base_color, inputs.roughness, inputs.ior, item, report)
            if parts is not None and parts.kind == "subsurface":
                report.left_out(item, "Subsurface under Transmission; the surface is glass")
                parts = None
            parts = glass if parts is None else materials.mix(parts, glass, transmission)
    if is_metal or not values.is_constant(metallic) or values.gray(metallic) > 0:
        metal = metal_material(inputs, item, report)
        if parts is not None and parts.kind == "subsurface":
            report.left_out(item, "Subsurface beside Metallic; the surface is metal")
            parts = None
        parts = metal if parts is None else materials.mix(parts, metal, metallic)
    elif inputs.coat > 0:
        report.left_out(item, "Coat above a base that is not metallic")
    return parts


def metal_material(inputs, item, report):
    if inputs.anisotropic > 0:
        report.approximated(item, "Anisotropic follows the uv of the mesh, without Rotation")
    metal = conductor(inputs.base_color, inputs.roughness, inputs.anisotropic)
    if inputs.coat <= 0:
        return metal
    if not values.is_constant(inputs.base_color):
        report.left_out(item, "Coat above metal of a textured color")
        return metal
    coat = materials.make(
        "coatedconductor", {"reflectance": inputs.base_color},
        {"interface.roughness": square(inputs.coat_roughness),
         "interface.eta": float(inputs.coat_ior),
         "conductor.roughness": square(inputs.roughness)
         if values.is_constant(inputs.roughness) else 0.25}, _ALPHA)
    return materials.mix(metal, coat, inputs.coat)


def glass_material(color, roughness, ior, item, report):
    if values.is_constant(color):
        if min(values.color(color)) < 0.999:
            report.left_out(item, f"the color of glass ({', '.join(f'{x:.2f}' for x in color)}); "
                                  "it is clear (a Volume Absorption inside colors it)")
    else:
        report.left_out(item, "the texture of glass; it is clear")
    if not values.is_constant(roughness):
        report.approximated(item, "a map of the Roughness of glass: 0.25 is used")
        roughness = 0.25
    return dielectric(ior, roughness)
