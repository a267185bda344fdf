# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Materials as values, and the tables that write each texture and each material once."""
import dataclasses

import numpy

from . import values


@dataclasses.dataclass(frozen=True)
class Material:
    """kind: a material of pbrt-v4, or "principled". Inputs are sorted tuples of (name, value)."""
    kind: str
    colors: tuple = ()
    floats: tuple = ()
    others: tuple = ()       # (("bool remaproughness", False), ...)
    parts: tuple = ()        # The two materials of a mix.
    normal_map: object = None  # An ImageValue of tangent space normals.
    bump: object = None        # A float value, in units of the scene.


def make(kind, colors=None, floats=None, others=None, **more):
    return Material(kind, tuple(sorted((colors or {}).items())),
                    tuple(sorted((floats or {}).items())), tuple(sorted((others or {}).items())),
                    **more)


def diffuse(color):
    return make("diffuse", {"reflectance": color})


def mix(first, second, amount):
    """amount: the weight of second."""
    if values.is_constant(amount):
        amount = values.gray(amount)
        if amount <= 0 or first == second:
            return first
        if amount >= 1:
            return second
    return make("mix", floats={"amount": amount}, parts=(first, second))


def with_bumps(material, normal_map, bump):
    """The material, or all parts of a mix, with the map and the bumps."""
    if material is None or (normal_map is None and bump is None):
        return material
    if material.kind == "mix":
        return dataclasses.replace(material, parts=tuple(with_bumps(part, normal_map, bump)
                                                         for part in material.parts))
    if material.normal_map is not None or material.bump is not None:
        return material
    return dataclasses.replace(material, normal_map=normal_map,
                               bump=None if normal_map is not None else bump)


# Colors that a surface multiplies light by; the format refuses those above 1.
_SHARES = {"reflectance", "transmittance", "base_color", "specular_tint", "sheen_color"}


def bounded(material):
    """The material with constant colors of at most 1."""
    colors = tuple((name, tuple(min(x, 1.0) for x in values.color(value))
                    if name in _SHARES and values.is_constant(value)
                    and max(values.color(value)) > 1 else value)
                   for name, value in material.colors)
    parts = tuple(map(bounded, material.parts))
    if colors == material.colors and parts == material.parts:
        return material
    return dataclasses.replace(material, colors=colors, parts=parts)


def is_boundary(material):
    """Whether light enters the shape, so that a medium inside is seen."""
    crosses = ("transmission" in dict(material.floats) if material.kind == "principled" else
               material.kind in ("dielectric", "interface", "subsurface"))
    return crosses or any(is_boundary(part) for part in material.parts)


# The format's ranges, where Blender takes more: docs/pbrt-v4.md, docs/principled.md.
_INDEX = {"eta": (0.01, 100)}
_RANGES = {"dielectric": _INDEX, "thindielectric": _INDEX, "subsurface": _INDEX,
           "coateddiffuse": _INDEX,
           "hair": {"alpha": (-90, 90), "beta_m": (0, 1), "beta_n": (0, 1), "eta": (0.1, 10)},
           "principled": {
               "anisotropy": (0, 1), "coat": (0, 1), "coat_ior": (1, 10), "coat_roughness": (0, 1),
               "ior": (1, 10), "iridescence_ior": (1, 10),
               "iridescence_thickness_nm": (0, 10000), "metallic": (0, 1), "roughness": (0, 1),
               "sheen_roughness": (0, 1), "specular": (0, 1), "transmission": (0, 1)}}


def _bounded(kind, name, value):
    """A constant within the range of the format."""
    limits = _RANGES.get(kind, {}).get(name)
    if limits is None or not values.is_constant(value):
        return value
    return min(max(float(values.gray(value)), limits[0]), limits[1])


class TextureTable:
    """Writes a Texture for each value that is not constant, once.

    image_file: gives the path and the encoding of an ImageValue, or None if it cannot be written.
    """

    def __init__(self, text, image_file):
        self._text = text
        self.image_file = image_file
        self._names = {}

    def parameter(self, name, value, as_color):
        """{"rgb NAME": ...}, {"float NAME": ...} or {"texture NAME": ...}."""
        if values.is_constant(value):
            if as_color:
                return {f"rgb {name}": tuple(max(0.0, x) for x in values.color(value))}
            return {f"float {name}": float(values.gray(value))}
        return {f"texture {name}": self._texture(value, as_color)}

    def _texture(self, value, as_color):
        key = (value, as_color)
        if key in self._names:
            return self._names[key]
        kind, parameters = self._class_of(value, as_color)
        name = f"t{len(self._names) + 1}"
        type_name = "spectrum" if as_color else "float"
        if kind == "node" and value.space != "uv":
            self._text.directive("AttributeBegin")
            self._text.transform("Transform", numpy.linalg.inv(_rows(value.matrix)))
            self._text.directive("Texture", name, type_name, kind, parameters)
            self._text.directive("AttributeEnd")
        else:
            self._text.directive("Texture", name, type_name, kind, parameters)
        self._names[key] = name
        return name

    def _class_of(self, value, as_color):
        if isinstance(value, values.ImageValue):
            found = self.image_file(value)
            if found is None:
                return "constant", ({"rgb value": (0.5, 0.5, 0.5)} if as_color
                                    else {"float value": 0.5})
            return "imagemap", {"string filename": found[0], "string encoding": found[1],
                                "string wrap": value.wrap, "string filter": value.filter,
                                **mapping(value.mapping)}
        if isinstance(value, values.NodeValue):
            return self._node(value, as_color)
        if as_color and values.is_composite(value) and not values.is_color(value) and not (
                isinstance(value, values.RampValue)):
            value = values.RampValue(value, values.reach_of(value), ())  # Colors are not below 0.
        if isinstance(value, values.RampValue):
            return self._ramp(value, value.value, as_color)
        if isinstance(value, values.ChannelsValue):
            value = values.sum_of_channels(value) if as_color else values.gray(value)
        if isinstance(value, values.ScaleValue):
            return "scale", {**self.parameter("tex", value.value, as_color),
                             **self.parameter("scale", value.factor, False)}
        parts = {**self.parameter("tex1", value.first, as_color),
                 **self.parameter("tex2", value.second, as_color)}
        if isinstance(value, values.MixValue):
            return "mix", {**parts, **self.parameter("amount", value.amount, False)}
        return "checkerboard", {**parts, **mapping(value.mapping)}

    def _node(self, value, as_color):
        """A node itself, or a ramp over its factor."""
        if not value.operations and as_color == value.wants_color:
            place = {"string from": "position"}
            if value.space == "uv":
                rows = _rows(value.matrix)[:3].ravel()
                place = {"string from": "uv", "float placement": tuple(map(float, rows))}
            return "node", {"string node": value.node, **place,
                            **{("string " if isinstance(x, str) else "float ") + name: x
                               for name, x in value.parameters}}
        factor = dataclasses.replace(value, operations=(), wants_color=False, is_simplified=False)
        return self._ramp(value, factor, as_color)

    def _ramp(self, value, factor, as_color):
        positions, colors = values.node_ramp(value)
        colors = numpy.clip(colors, 0.0, None) if as_color else colors
        return "ramp", {"texture input": self._texture(factor, False),
                        "float positions": tuple(map(float, positions)),
                        **({"float colors": tuple(map(float, colors.ravel()))} if as_color else
                           {"float values": tuple(float(values.gray(tuple(c))) for c in colors)})}


def _rows(numbers):
    return numpy.array(numbers, numpy.float64).reshape(4, 4)


def mapping(scale_and_offset):
    names = ("uscale", "vscale", "udelta", "vdelta")
    return {f"float {name}": value for name, value, usual
            in zip(names, scale_and_offset, (1.0, 1.0, 0.0, 0.0)) if value != usual}


class MaterialTable:
    """Writes each material once, under the name that Blender has for it where that is free."""

    def __init__(self, text, textures):
        self._text = text
        self._textures = textures
        self._names = {}
        self._taken = set()

    def name_of(self, material, wanted):
        if material in self._names:
            return self._names[material]
        parts = tuple(self.name_of(part, f"{wanted} {i + 1}")
                      for i, part in enumerate(material.parts))
        parameters = {"string type": material.kind}
        if parts:
            parameters["string materials"] = parts
        for name, value in material.colors:
            parameters.update(self._textures.parameter(name, value, True))
        for name, value in material.floats:
            parameters.update(self._textures.parameter(
                name, _bounded(material.kind, name, value), False))
        parameters.update(material.others)
        parameters.update(self._bumps(material))
        name = wanted
        while name in self._taken:
            name += "'"
        self._text.directive("MakeNamedMaterial", name, parameters)
        self._taken.add(name)
        self._names[material] = name
        return name

    def _bumps(self, material):
        if material.kind == "mix" or material.kind == "hair":
            return {}
        if material.normal_map is not None:
            found = self._textures.image_file(material.normal_map)
            return {"string normalmap": found[0]} if found else {}
        if material.bump is not None and not values.is_constant(material.bump):
            return self._textures.parameter("displacement", material.bump, False)
        return {}
