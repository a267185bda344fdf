# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Reads the sockets of a Principled BSDF, of Blender before and since 4.0."""
import bpy

from ..scene import principled, values
from . import node_links

_IS_LAYERED = bpy.app.version >= (4, 0, 0)


def read_inputs(reader, place):
    """PrincipledInputs. reader: a ShaderReader."""
    number = reader.number
    gray = lambda *names: values.gray(reader.value(place, *names))
    inputs = principled.PrincipledInputs(
        base_color=reader.value(place, "Base Color"), metallic=gray("Metallic"),
        roughness=gray("Roughness"), ior=number(place, "IOR", usual=1.5),
        specular=gray("Specular IOR Level", "Specular"),
        specular_tint=_hue(reader, place, "Specular Tint"),
        anisotropic=number(place, "Anisotropic"),
        transmission=gray("Transmission Weight", "Transmission"),
        subsurface=number(place, "Subsurface Weight", "Subsurface"),
        sheen=gray("Sheen Weight", "Sheen"), coat=gray("Coat Weight", "Clearcoat"),
        is_layered=_IS_LAYERED,
        keeps_energy=getattr(place.node, "distribution", "GGX") == "MULTI_GGX")
    if inputs.anisotropic > 0:
        note_tangent(reader, place, "Anisotropic")
        inputs.rotation = number(place, "Anisotropic Rotation")
    if inputs.sheen != 0.0:
        inputs.sheen_roughness = number(place, "Sheen Roughness", usual=0.5)
        inputs.sheen_tint = _hue(reader, place, "Sheen Tint")
    if inputs.coat != 0.0:
        inputs.coat_roughness = number(place, "Coat Roughness", "Clearcoat Roughness", usual=0.03)
        inputs.coat_ior = number(place, "Coat IOR", usual=1.5)
        inputs.coat_tint = _color(reader, place, "Coat Tint")
    if inputs.subsurface > 0:
        _read_subsurface(reader, place, inputs)
    if node_links.input_of(place, "Thin Film Thickness") is not None:
        inputs.film_nm = number(place, "Thin Film Thickness")
        inputs.film_ior = number(place, "Thin Film IOR", usual=1.33)
    _note_left_out(reader, place, inputs)
    return inputs


def _color(reader, place, name):
    """White if there is no such socket."""
    wanted = node_links.input_of(place, name)
    return principled.WHITE if wanted is None else reader.values.read(wanted)


def _hue(reader, place, name):
    """A color, or, before 4.0, a number."""
    value = _color(reader, place, name)
    return value if _IS_LAYERED else values.gray(value)


def _read_subsurface(reader, place, inputs):
    radius = reader.value(place, "Subsurface Radius")
    if not values.is_constant(radius):
        reader.report.left_out(reader.item, "a texture of Subsurface Radius")
        radius = (1.0, 0.2, 0.1)
    scale = reader.number(place, "Subsurface Scale", usual=1.0) if _IS_LAYERED else 1.0
    inputs.subsurface_radius = tuple(scale * x for x in values.color(radius))
    if not _IS_LAYERED:
        inputs.base_color = values.mix(inputs.base_color, reader.value(place, "Subsurface Color"),
                                       inputs.subsurface)
    reader.note_used(place, "Subsurface Anisotropy", 0.0, "Subsurface Anisotropy")


def note_tangent(reader, place, name):
    """Reports an anisotropy whose tangents are not those of the uv."""
    wanted = node_links.input_of(place, "Tangent")
    source = node_links.source(wanted)[0] if wanted is not None else None
    if not reader.has_own_uv():
        reader.report.approximated(reader.item, f"{name} follows the uv that a Mapping node turns")
    elif source is None or source.node.type != "TANGENT" or source.node.direction_type != "UV_MAP":
        reader.report.approximated(reader.item, f"{name} follows the uv of the mesh")


def _note_left_out(reader, place, inputs):
    reader.note_used(place, "Diffuse Roughness", 0.0, "Diffuse Roughness (Oren-Nayar)")
    if inputs.transmission != 0.0:
        reader.note_used(place, "Transmission Roughness", 0.0, "Transmission Roughness")
    wanted = node_links.input_of(place, "Coat Normal", "Clearcoat Normal")
    if wanted is not None and node_links.source(wanted)[0] is not None:
        reader.report.left_out(reader.item, f"{wanted.socket.name}: the coat has the normals of "
                                            "the base")
