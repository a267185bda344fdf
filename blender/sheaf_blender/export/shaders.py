# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Material node trees as closures (scene/closures.py) and media."""
import dataclasses

from ..scene import closures, materials, principled, values
from ..scene.closures import BLACK, Closure
from ..scene.report import Report
from . import node_links, principled_node, settings
from .node_values import NodeValues


TILT_MIN_DEGREES = 12.0  # On average; below it the light differs by less than 3 %.


@dataclasses.dataclass(frozen=True)
class Medium:
    """A homogeneous medium, or the factors of a grid; per unit of world space."""
    absorption: tuple
    scattering: tuple
    anisotropy: float = 0.0
    emission: tuple = BLACK
    density_grid: str = ""
    temperature_grid: str = ""
    blackbody: float = 0.0


@dataclasses.dataclass(frozen=True)
class Shading:
    """A Blender material after conversion."""
    name: str
    closure: Closure
    medium: Medium | None = None
    has_surface: bool = True
    has_texture: bool = False  # Whether it uses the uv of the mesh.
    uv_map: str = ""           # Its name; empty: the one that is active for rendering.
    uv_base: tuple = ((1.0, 0.0), (0.0, 1.0))  # The uv of its meshes are multiplied with it.
    colors: tuple | None = None  # The colors of vertices that it reads: values.color_of_vertices.


PINK = Shading("cannot be read", Closure(materials.diffuse(closures.PINK)))


def read_material(material, report, images):
    """The Shading of a Blender material, which may be None."""
    if material is None:
        return Shading("default", Closure(materials.diffuse((0.8, 0.8, 0.8))))
    if not material.use_nodes or material.node_tree is None:
        return Shading(material.name, Closure(materials.diffuse(tuple(material.diffuse_color[:3]))))
    output = node_links.output_node(material.node_tree)
    if output is None:
        return Shading(material.name, Closure(materials.diffuse(BLACK)))
    first = Report()
    found, turns = _read_output(material, output, first, images, Shading.uv_base)
    if not turns:
        report.include(first)
        return found
    return _read_output(material, output, report, images, tuple(map(tuple, turns[0].tolist())))[0]


def _read_output(material, output, report, images, uv_base):
    """(Shading, matrices of Mapping nodes that uv_base leaves turned)."""
    item = f'material "{material.name}"'
    reader = ShaderReader(item, report, images, uv_base)
    place = node_links.Place(output)
    surface, volume = (node_links.input_of(place, name) for name in ("Surface", "Volume"))
    has_surface = node_links.source(surface)[0] is not None
    closure = reader.surface(surface) if has_surface else closures.EMPTY
    medium = reader.medium(volume)
    displacement = node_links.input_of(place, "Displacement")
    is_displaced = settings.note_material(material, report)
    if node_links.source(displacement)[0] is not None:
        if is_displaced:
            report.approximated(item, "displacement is rendered as bumps")
        bump = reader.displacement(displacement)
        if bump is not None:
            closure = dataclasses.replace(
                closure, material=materials.with_bumps(closure.material, None, bump))
    maps = reader.values.uv_maps
    if len(maps) > 1:
        report.approximated(item, f"{len(maps)} UV maps: the one that is active for rendering is "
                                  "used")
    closure, colors = _with_colors(closure, item, report)
    return (Shading(material.name, closure, medium, has_surface, bool(maps),
                    next(iter(maps)) if len(maps) == 1 else "", uv_base, colors),
            reader.values.uv_turns)


def _with_colors(closure, item, report):
    """The closure with one color of vertices alone, and which that is; None for none."""
    nodes = [node for node in values.nodes_of(closure) if values.color_of_vertices(node)]
    if not nodes:
        return closure, None
    colors = values.color_of_vertices(nodes[0])
    if any(values.color_of_vertices(node) != colors for node in nodes):
        report.left_out(item, f'all attributes but "{colors[0] or "the active color"}": meshes '
                              "have one color for each vertex; white is used")
    if not all(map(values.is_exact_at_vertices, nodes)):
        report.approximated(item, "nodes behind an attribute: they are computed at the vertices, "
                                  "and mixed between them")
    return values.with_nodes(closure, lambda node: node if values.color_of_vertices(node) in (
        None, colors) else (1.0, 1.0, 1.0) if node.wants_color else 1.0), colors


def read_world_volume(world, report, images):
    """The Shading of the volume that fills the world, or None."""
    output = node_links.output_node(world.node_tree) if world.use_nodes else None
    if output is None:
        return None
    reader = ShaderReader(f'world "{world.name}"', report, images)
    medium = reader.medium(node_links.input_of(node_links.Place(output), "Volume"))
    return medium and Shading(world.name, closures.EMPTY, medium, False)


class ShaderReader:
    """Reads the shaders of one material."""

    def __init__(self, item, report, images, uv_base=Shading.uv_base):
        self.item, self.report = item, report
        self.values = NodeValues(item, report, images, uv_base)
        self._memory = node_links.Memory(report, item)
        self._media = node_links.Memory(report, item)

    def surface(self, wanted):
        """The Closure behind a shader socket."""
        place, output, _ = node_links.source(wanted)
        if place is None:
            return closures.NOTHING
        if output.type != "SHADER":  # Cycles makes an Emission of a color or a number.
            return Closure(None, 1.0, values.color(self.values.read(wanted)))
        return self._memory.read(place, output, lambda: self._surface(place), closures.NOTHING)

    def _surface(self, place):
        reader = _SURFACES.get(place.node.type)
        if reader is None:
            self.report.left_out(self.item, f'shader "{place.node.name}" ({place.node.bl_label}); '
                                            "the surface is gray")
            return Closure(materials.diffuse((0.5, 0.5, 0.5)))
        closure = reader(self, place)
        normal_map, bump = self.normals(node_links.input_of(place, "Normal"))
        return dataclasses.replace(
            closure, material=materials.with_bumps(closure.material, normal_map, bump))

    def has_own_uv(self):
        """Whether the tangents of its meshes are those of Blender's uv."""
        return bool((self.values.uv_base == ((1.0, 0.0), (0.0, 1.0))).all())

    def value(self, place, *names):
        return self.values.read(node_links.input_of(place, *names))

    def number(self, place, *names, usual=0.0):
        return self.values.number(node_links.input_of(place, *names), usual)

    def note_used(self, place, name, usual, text):
        """Reports an input without counterpart, unless it has its neutral value."""
        wanted = node_links.input_of(place, name)
        if wanted is None:
            return
        is_linked = node_links.source(wanted)[0] is not None
        if is_linked or abs(values.gray(self.values.read(wanted, usual)) - usual) > 1e-4:
            self.report.left_out(self.item, text)

    # Shaders.

    def principled(self, place):
        inputs = principled_node.read_inputs(self, place)
        material = principled.principled_material(inputs, self.item, self.report,
                                                  self.values.mean_of)
        emission = values.color(self.value(place, "Emission Color", "Emission"))
        strength = self.value(place, "Emission Strength")
        return Closure(material, values.gray(self.value(place, "Alpha")),
                       self._emission(emission, strength))

    def diffuse(self, place):
        self.note_used(place, "Roughness", 0.0, "Roughness of a Diffuse BSDF (Oren-Nayar)")
        return Closure(materials.diffuse(self.value(place, "Color")))

    def glossy(self, place):
        self._note_facets(place)
        anisotropy = min(max(self.number(place, "Anisotropy"), -0.99), 0.99)
        turns = 0.0
        if anisotropy:  # Where it is positive, the facets are rougher across the tangent.
            principled_node.note_tangent(self, place, "Anisotropy")
            turns = self.number(place, "Rotation") + (0.25 if anisotropy > 0 else 0.0)
        return Closure(principled.metal(
            self.value(place, "Color"), principled.facets(
                self._roughness(place), 1 - abs(anisotropy), turns, self.values.mean_of)))

    def _note_facets(self, place):
        model = getattr(place.node, "distribution", "GGX")
        if model not in ("GGX", "MULTI_GGX", "SHARP"):
            self.report.approximated(self.item, f"distribution {model} is rendered as GGX")

    def _roughness(self, place):
        if getattr(place.node, "distribution", "") == "SHARP":
            return 0.0
        return values.gray(self.value(place, "Roughness"))

    def glass(self, place):
        self._note_facets(place)
        color = self.value(place, "Color")
        return self._glass(place, color, 1.45, specular_tint=color)

    def refraction(self, place):
        self._note_facets(place)
        self.report.approximated(self.item, "a Refraction BSDF also reflects what cannot leave "
                                            "(total reflection)")
        return self._glass(place, self.value(place, "Color"), 1.45, specular=0.0)

    def _glass(self, place, color, usual_ior, **more):
        return Closure(principled.glass(color, self._roughness(place),
                                        self.number(place, "IOR", usual=usual_ior), self.item,
                                        self.report, **more))

    def transparent(self, place):
        color = self.value(place, "Color")
        if not values.is_constant(color) or min(values.color(color)) < 0.999:
            self.report.approximated(self.item, "the color of a Transparent BSDF is gray alpha "
                                                "over black")
            return Closure(materials.diffuse(BLACK), closures.inverse(values.gray(color)))
        return closures.EMPTY

    def translucent(self, place):
        return Closure(materials.make("diffusetransmission", {
            "reflectance": BLACK, "transmittance": self.value(place, "Color")}))

    def emission(self, place):
        emission = self._emission(values.color(self.value(place, "Color")),
                                  self.value(place, "Strength"))
        return Closure(None, 1.0, emission)

    def _emission(self, color, strength):
        if not values.is_constant(strength):
            strength = self.values.mean_of(strength)
            self.report.approximated(self.item, "a texture of the strength of Emission: its mean "
                                                "is used")
        return values.apply(color, "multiply", *(values.gray(strength),) * 3)

    def subsurface(self, place):
        scale = self.number(place, "Scale", usual=1.0)
        radius = self.value(place, "Radius")
        radius = values.color(radius) if values.is_constant(radius) else (1.0, 0.2, 0.1)
        # Cycles' closure has no reflection at the surface: its index guides the walk alone.
        return Closure(principled.subsurface(
            self.value(place, "Color"), tuple(scale * x for x in radius), 1.0, 0.0, self.item,
            self.report))

    def hair(self, place):
        node = place.node
        floats = {"beta_m": self.number(place, "Roughness", usual=0.3),
                  "beta_n": self.number(place, "Radial Roughness", usual=0.3),
                  "eta": self.number(place, "IOR", usual=1.55)}
        offset = self.number(place, "Offset", usual=0.0349)
        self.note_used(place, "Coat", 0.0, "Coat of hair")
        self.note_used(place, "Random Color", 0.0, "Random Color of hair")
        self.note_used(place, "Random Roughness", 0.0, "Random Roughness of hair")
        floats["alpha"] = offset * 57.29577951308232
        if getattr(node, "model", "CHIANG") != "CHIANG":
            self.report.approximated(self.item, f"hair of the model {node.model} is rendered by "
                                                "that of Chiang")
        if node.parametrization == "ABSORPTION":
            return Closure(materials.make("hair", {"sigma_a": self.value(
                place, "Absorption Coefficient")}, floats))
        if node.parametrization == "COLOR":
            return Closure(materials.make("hair", {"reflectance": self.value(place, "Color")},
                                          floats))
        melanin = self.number(place, "Melanin", usual=0.8)
        redness = self.number(place, "Melanin Redness", usual=1.0)
        return Closure(materials.make("hair", {"sigma_a": melanin_absorption(melanin, redness)},
                                      floats))

    def mix(self, place):
        first, second = (self.surface(node_links.Input(socket, place.groups))
                         for socket in place.node.inputs[1:3])
        wanted = node_links.Input(place.node.inputs[0], place.groups)
        fresnel, output, _ = node_links.source(wanted)
        if fresnel is not None and fresnel.node.type in ("FRESNEL", "LAYER_WEIGHT"):
            return self._coat(fresnel, output, first, second)
        return closures.mix(first, second, self.values.read(wanted, 0.5), self.item, self.report)

    def _coat(self, fresnel, output, first, second):
        """A mix by Fresnel of a diffuse base and a glossy layer is a coat."""
        ior, mean = self.values.of_angle(fresnel, output)
        a, b = first.material, second.material
        is_layer = a and b and a.kind == "diffuse" and "metallic" in dict(b.floats)
        if is_layer and output.name != "Facing":
            self.report.approximated(self.item, "Diffuse and Glossy mixed by Fresnel are a layer "
                                                "over a base, white at grazing angles")
            return Closure(principled.coated(
                dict(a.colors)["reflectance"], dict(b.floats)["roughness"], ior,
                dict(b.colors)["base_color"]))
        self.report.approximated(self.item, f'a mix by "{fresnel.node.name}" has the mean weight '
                                            f"{mean:.2f} in all directions")
        return closures.mix(first, second, mean, self.item, self.report)

    def add(self, place):
        first, second = (self.surface(node_links.Input(socket, place.groups))
                         for socket in place.node.inputs[:2])
        return closures.add(first, second, self.item, self.report)

    # Normals.

    def normals(self, wanted):
        """(normal map, bump) of a Normal input."""
        if wanted is None:
            return None, None
        place, _, _ = node_links.source(wanted)
        if place is None:
            return None, None
        if place.node.type == "NORMAL_MAP" and place.node.space == "TANGENT":
            color = self.value(place, "Color")
            strength = self.number(place, "Strength", usual=1.0)
            if isinstance(color, values.ImageValue):
                if strength != 1:
                    color = values.apply(color, "normal_strength", strength)
                if color.mapping != (1.0, 1.0, 0.0, 0.0) or not self.has_own_uv():
                    self.report.left_out(self.item, "the Mapping of a normal map")
                tilt = self.values.tilt_of(color)
                if tilt > TILT_MIN_DEGREES:
                    self.report.approximated(self.item, f"its normal map tilts by {tilt:.0f} "
                                             "degrees on average: brighter than in Cycles, which "
                                             "loses the light that leaves below the surface")
                return color, None
        elif place.node.type == "BUMP":
            height = values.gray(self.value(place, "Height"))
            distance = (self.number(place, "Distance", usual=1.0)
                        * self.number(place, "Strength", usual=1.0)
                        * (-1 if place.node.invert else 1))
            if node_links.source(node_links.input_of(place, "Normal"))[0] is not None:
                self.report.left_out(self.item, f'what "{place.node.name}" is combined with')
            if _scaled(height, distance) is not None:
                self.report.approximated(self.item, "Bump: where it is steep it is brighter than "
                                         "in Cycles, which loses the light that leaves below the "
                                         "surface")
            return None, _scaled(height, distance)
        self.report.left_out(self.item, f'normals of "{place.node.name}" ({place.node.bl_label})')
        return None, None

    def displacement(self, wanted):
        place, _, _ = node_links.source(wanted)
        if place.node.type != "DISPLACEMENT":
            self.report.left_out(self.item, f'displacement by "{place.node.name}"')
            return None
        height = values.gray(self.value(place, "Height"))
        return _scaled(height, self.number(place, "Scale", usual=1.0))

    # Media.

    def medium(self, wanted):
        """The Medium behind a Volume socket, or None."""
        place, output, _ = node_links.source(wanted)
        if place is None:
            return None
        return self._media.read(place, output, lambda: self._medium(place), None)

    def _medium(self, place):
        node = place.node
        if node.type == "PRINCIPLED_VOLUME":
            return self._principled_volume(place)
        if node.type in ("VOLUME_SCATTER", "VOLUME_ABSORPTION"):
            density = self.number(place, "Density", usual=1.0)
            color = self._constant_color(place, "Color")
            if node.type == "VOLUME_ABSORPTION":
                return Medium(tuple(density * max(1 - c, 0.0) for c in color), BLACK)
            return Medium(BLACK, tuple(density * c for c in color),
                          self.number(place, "Anisotropy"))
        if node.type == "ADD_SHADER":
            parts = [self.medium(node_links.Input(socket, place.groups))
                     for socket in node.inputs[:2]]
            return sum_of_media([part for part in parts if part is not None])
        if node.type == "EMISSION":
            strength = self.number(place, "Strength", usual=1.0)
            return Medium(BLACK, BLACK, emission=tuple(
                strength * c for c in self._constant_color(place, "Color")))
        self.report.left_out(self.item, f'volume shader "{node.name}" ({node.bl_label})')
        return None

    def _principled_volume(self, place):
        density = self.number(place, "Density", usual=1.0)
        color = self._constant_color(place, "Color")
        absorbed = self._constant_color(place, "Absorption Color")
        strength = self.number(place, "Emission Strength")
        emitted = self._constant_color(place, "Emission Color")
        blackbody = self.number(place, "Blackbody Intensity")
        return Medium(
            tuple(density * max(1 - c, 0.0) * max(1 - max(a, 0.0) ** 0.5, 0.0)
                  for c, a in zip(color, absorbed)),
            tuple(density * c for c in color), self.number(place, "Anisotropy"),
            tuple(strength * c for c in emitted), self._grid(place, "Density Attribute"),
            self._grid(place, "Temperature Attribute"), blackbody)

    def _grid(self, place, name):
        wanted = node_links.input_of(place, name)
        return str(wanted.socket.default_value) if wanted else ""

    def _constant_color(self, place, name):
        value = self.value(place, name)
        if values.is_constant(value):
            return values.color(value)
        self.report.left_out(self.item, f"a texture of {name} in a volume")
        return (0.5, 0.5, 0.5)


def melanin_absorption(melanin, redness):
    """Absorption per radius: d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance Model", with
    Blender's quantity -ln(1 - melanin).
    """
    import math
    quantity = -math.log(max(1 - melanin, 1e-4))
    eumelanin, pheomelanin = quantity * (1 - redness), quantity * redness
    return tuple(eumelanin * e + pheomelanin * p
                 for e, p in zip((0.506, 0.841, 1.653), (0.343, 0.733, 1.924)))


def _scaled(height, factor):
    if values.is_constant(height) or factor == 0:
        return None
    return values.apply(height, "multiply", *(factor,) * 3)


def sum_of_media(parts):
    """One Medium in place of several in one space, or None."""
    if not parts:
        return None
    total = parts[0]
    for part in parts[1:]:
        add = lambda a, b: tuple(x + y for x, y in zip(a, b))
        scattering = [sum(p.scattering) for p in (total, part)]
        g = ((total.anisotropy * scattering[0] + part.anisotropy * scattering[1])
             / (sum(scattering) or 1.0))
        total = dataclasses.replace(
            total, absorption=add(total.absorption, part.absorption), anisotropy=g,
            scattering=add(total.scattering, part.scattering),
            emission=add(total.emission, part.emission),
            density_grid=total.density_grid or part.density_grid)
    return total


_SURFACES = {
    "BSDF_PRINCIPLED": ShaderReader.principled, "BSDF_DIFFUSE": ShaderReader.diffuse,
    "BSDF_GLOSSY": ShaderReader.glossy, "BSDF_ANISOTROPIC": ShaderReader.glossy,
    "BSDF_GLASS": ShaderReader.glass, "BSDF_REFRACTION": ShaderReader.refraction,
    "BSDF_TRANSPARENT": ShaderReader.transparent, "BSDF_TRANSLUCENT": ShaderReader.translucent,
    "EMISSION": ShaderReader.emission, "SUBSURFACE_SCATTERING": ShaderReader.subsurface,
    "BSDF_HAIR_PRINCIPLED": ShaderReader.hair, "MIX_SHADER": ShaderReader.mix,
    "ADD_SHADER": ShaderReader.add,
}
