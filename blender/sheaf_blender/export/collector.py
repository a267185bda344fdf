# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Reads the evaluated scene once: each geometry with all places where it stands."""
import dataclasses

import bpy
import numpy

from ..scene import mesh_arrays, ply, ray_visibility
from ..scene.ray_visibility import RAYS
from . import curves, meshes, shaders, smoke
from .light_groups import group_of

MESH_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
FLAT_TRIANGLES_MAX = 2  # A quad has two.
SHADOW_NOTE = ("Ray Visibility: lights and sky behind it are seen as Shadow says, also where "
               "Cycles samples them along other rays")
UNRENDERED_TYPES = {"EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}


@dataclasses.dataclass
class Part:
    """Triangles of one material."""
    shading: shaders.Shading
    file: str
    arrays: object = None        # MeshArrays.
    later_files: list = dataclasses.field(default_factory=list)  # The mesh at later keys.


@dataclasses.dataclass
class Geometry:
    name: str
    parts: list
    radius: float                                  # Radius of a sphere around its origin.
    strands: list = dataclasses.field(default_factory=list)  # [(Shading, file)]
    medium_grid: object = None                     # A VolumeObject.
    matrices: list = dataclasses.field(default_factory=list)
    object_names: list = dataclasses.field(default_factory=list)
    keys: list = dataclasses.field(default_factory=list)  # To find the instances again later.
    groups: list = dataclasses.field(default_factory=list)  # Blender's light groups.
    may_deform: bool = False
    may_move: bool = True
    smoke: object = None         # A smoke.Smoke inside the mesh.
    hidden_from: tuple = ()      # The kinds of rays that do not see it.
    # Center and half size of the box of Generated coordinates, in the object's space.
    texture_space: tuple = ((0.0,) * 3, (1.0,) * 3)


@dataclasses.dataclass
class VolumeObject:
    """A grid file with the corners of the box around it, in the object's space."""
    path: str
    corners: list
    shading: shaders.Shading
    is_object_space: bool


@dataclasses.dataclass
class LightPlace:
    """A light object, or one of its instances. light: the evaluated data."""
    name: str
    light: object
    matrix: object
    hidden_from: list
    key: tuple
    group: str = ""       # Blender's light group.
    is_seen: bool = True  # Whether it lies where the camera looks, if its size is more than 0.
    is_around: bool = False  # Whether it holds the camera.


class Collector:
    """Reads the scene as it is at the frame. geometries: by key, in the order of their first
    instance; lights: [LightPlace].
    """

    def __init__(self, depsgraph, content, images, report, has_motion, catchers="",
                 is_shown=None):
        """catchers, is_shown: see scene_export.Settings."""
        self._layer = depsgraph.view_layer_eval
        self._depsgraph, self._content = depsgraph, content
        self._images, self._report, self._has_motion = images, report, has_motion
        self.geometries = {}
        self.lights = []
        self._seen = {}
        self._shadings = {}
        self._taken = set()
        self.holdouts = set()  # Names of objects through which the camera sees nothing,
        self.catchers = set()  # and of those that show only the shadows on them.
        self._wanted_catchers, self._is_shown = catchers, is_shown
        self._hair_done = set()

    def collect(self):
        for instance in self._depsgraph.object_instances:
            if self._is_shown is not None and not self._is_shown(instance):
                continue
            with self._report.guard(f'object "{instance.object.name}"'):
                self._collect_one(instance, instance.object)

    def _collect_one(self, instance, instance_object):
        kind = instance_object.type
        if kind == "LIGHT":
            if instance.show_self:
                self.lights.append(LightPlace(
                    instance_object.name, instance_object.data, affine(instance.matrix_world),
                    self._hidden_rays(instance, instance_object),
                    motion_key(instance, instance_object),
                    group_of(instance, instance_object)))
            return
        if self._wanted_catchers == "alone" and not is_catcher(instance, instance_object):
            return
        is_drawn = self._layer.use_volumes if kind == "VOLUME" else self._layer.use_solid
        hidden = tuple(self._hidden_rays(instance, instance_object))
        if len(hidden) == len(RAYS):
            return
        if instance.show_self and kind not in UNRENDERED_TYPES and is_drawn:
            self._add(instance, instance_object, kind, hidden)
        if (instance.show_particles and instance_object.particle_systems
                and self._layer.use_strand):
            self._add_hair(instance, instance_object, hidden)

    def _add(self, instance, instance_object, kind, hidden):
        # Objects of instances come and go at the same addresses, each with its data.
        data = instance_object.data
        seen = (instance_object.as_pointer(), data.as_pointer() if data else 0, hidden)
        geometry = self._seen.get(seen)
        if geometry is None:
            key = (_geometry_key(instance_object, kind, seen),
                   self._motion_settings(instance_object, kind), hidden)
            geometry = self.geometries.get(key)
            if geometry is None:
                geometry = self.geometries[key] = self._read(instance_object, kind)
                geometry.hidden_from = hidden
                if ray_visibility.splits_shadow(hidden):
                    self._report.approximated(f'object "{instance_object.name}"', SHADOW_NOTE)
            self._seen[seen] = geometry
        geometry.matrices.append(affine(instance.matrix_world))
        geometry.object_names.append(instance_object.name)
        geometry.groups.append(group_of(instance, instance_object))
        geometry.keys.append(motion_key(instance, instance_object) if self._has_motion else None)
        self._note_holdout(instance, instance_object)

    def _note_holdout(self, instance, instance_object):
        maker = instance.parent if instance.is_instance and instance.parent else instance_object
        if maker.holdout_get(view_layer=self._layer):  # Originals have other values in -a.
            self.holdouts.add(instance_object.name)
        elif is_catcher(instance, instance_object):
            self.catchers.add(instance_object.name)

    def _read(self, instance_object, kind):
        name = self._free_name(instance_object.name)
        if kind in MESH_TYPES:
            return self._read_mesh(name, instance_object, kind)
        corners = [tuple(corner) for corner in instance_object.bound_box]
        radius = max(sum(x * x for x in corner) for corner in corners) ** 0.5
        if kind == "CURVES":
            read = curves.read_curves_object(instance_object.data)
            strands = self._strands(instance_object, 0, read) if read else []
            return Geometry(name, [], radius, strands)
        if kind == "VOLUME":
            return Geometry(name, [], radius,
                            medium_grid=self._read_volume(instance_object, corners))
        self._report.left_out(f'object "{instance_object.name}"', f"its type {kind}")
        return Geometry(name, [], 0.0)

    def _free_name(self, wanted):
        name, number = wanted, 1
        while name in self._taken:
            number += 1
            name = f"{wanted} ({number})"
        self._taken.add(name)
        return name

    def _hidden_rays(self, instance, instance_object):
        """The kinds of rays that do not see this instance of an object."""
        makers = [instance_object]
        if instance.is_instance and instance.parent is not None:
            makers.append(instance.parent)
        hidden = {ray for ray in RAYS if not all(
            getattr(maker, f"visible_{ray.replace(' ', '_')}", True) for maker in makers)}
        if makers[-1].original.indirect_only_get(view_layer=self._depsgraph.view_layer):
            hidden.add("camera")
        if self._wanted_catchers == "unseen" and is_catcher(instance, instance_object):
            hidden.add("camera")
        return [ray for ray in RAYS if ray in hidden]

    # Meshes.

    def _read_mesh(self, name, instance_object, kind):
        is_copy = kind != "MESH"
        mesh = instance_object.to_mesh() if is_copy else instance_object.data
        if mesh is None:
            return Geometry(name, [], 0.0)
        try:
            slots = list(instance_object.material_slots)
            shadings = [self.shading_of(slot.material) for slot in slots] or [self.shading_of(None)]
            may_move, may_deform = self._motion_settings(instance_object, kind)
            parts, radius = [], 0.0
            for slot, arrays in meshes.read_parts(mesh, shadings):
                if len(arrays.positions) == 0:
                    continue
                radius = max(radius, float((arrays.positions.astype(float)**2).sum(axis=1).max()))
                parts.append(self._part(shadings[slot], arrays, may_deform))
                self._note_tilt(instance_object, arrays)
            found = Geometry(name, parts, radius**0.5, may_deform=may_deform, may_move=may_move)
            found.texture_space = _texture_space(mesh)
            found.smoke = smoke.read(instance_object, shadings[0], self._report)
            if found.smoke is not None:
                found.may_deform = found.may_move = False
                for part in parts:
                    part.shading = smoke.without_medium(part.shading)
            return found
        finally:
            if is_copy:
                instance_object.to_mesh_clear()

    def _note_tilt(self, instance_object, arrays):
        tilt = mesh_arrays.normal_tilt_degrees(arrays)
        if tilt > shaders.TILT_MIN_DEGREES:
            self._report.approximated(
                f'object "{instance_object.name}"', f"its smooth normals are tilted by {tilt:.0f} "
                "degrees on average: brighter than in Cycles, which loses the light that leaves "
                "below the surface")

    def _motion_settings(self, instance_object, kind):
        """Whether the object moves, and whether its mesh may deform, while the shutter is open."""
        settings = getattr(instance_object, "cycles", None)
        if not self._has_motion or not getattr(settings, "use_motion_blur", True):
            return False, False
        original = instance_object.original
        return True, getattr(settings, "use_deform_motion", True) and (
            bool(original.modifiers) or kind != "MESH"
            or getattr(original.data, "shape_keys", None) is not None)

    def _part(self, shading, arrays, may_deform):
        if arrays.uvs is None and shading.has_texture:  # Blender's uv is 0 without a layer.
            arrays.uvs = numpy.zeros((len(arrays.positions), 2), numpy.float32)
            if arrays.source is not None:
                arrays.source = [*arrays.source, arrays.uvs]
        # A later key's mesh must have the vertices of this very file.
        source = None if may_deform else arrays.source
        path = self._content.put(ply.ply_chunks(arrays.positions, arrays.triangles, arrays.normals,
                                                arrays.uvs, arrays.colors), ".ply", source)
        return Part(shading, path, arrays)

    def shading_of(self, material):
        if self._layer.material_override is not None:
            material = self._layer.material_override
        return self._shading(material)

    def _shading(self, material):
        key = material.name_full if material else None
        if key not in self._shadings:
            found = shaders.PINK
            name = material.name if material else "default"
            with self._report.guard(f'material "{name}"'):
                found = shaders.read_material(material, self._report, self._images)
                if not self._layer.use_volumes:
                    found = dataclasses.replace(found, medium=None)
            self._shadings[key] = found
        return self._shadings[key]

    def has_fog(self):
        """Whether anything that was read scatters light inside."""
        return any(shading.medium is not None and max(shading.medium.scattering) > 0
                   for shading in self._shadings.values())

    def has_media(self):
        """Whether anything has a volume."""
        return self.has_volumes() or any(shading.medium is not None
                                         for shading in self._shadings.values())

    def clear_sides(self):
        """How many sides the transparent objects have: two each, and one of a plane."""
        return sum(len(geometry.matrices) * (2 if _has_depth(part.arrays) else 1)
                   for geometry in self.geometries.values() for part in geometry.parts
                   if part.shading.has_surface and part.shading.closure.alpha != 1.0)

    def has_volumes(self):
        return any(geometry.medium_grid is not None for geometry in self.geometries.values())

    # Hair.

    def _add_hair(self, instance, instance_object, hidden):
        name = instance_object.name
        for index, system in enumerate(instance_object.particle_systems):
            settings = system.settings
            if settings.type != "HAIR" or settings.render_type != "PATH":
                continue
            if instance.is_instance:
                self._report.left_out(f'object "{name}"', "hair of instances")
                return
            if (name, index) in self._hair_done:
                continue
            self._hair_done.add((name, index))
            read = curves.read_particle_hair(instance_object, system)
            if read is None:
                continue
            strands = self._strands(instance_object, settings.material - 1, read)
            geometry = Geometry(self._free_name(f"{name} {system.name}"), [], 0.0, strands,
                                hidden_from=hidden)
            geometry.matrices.append(None)  # It is in world space.
            geometry.object_names.append(name)
            geometry.keys.append(None)
            geometry.groups.append("")
            self._note_holdout(instance, instance_object)
            self.geometries[("hair", name, index)] = geometry

    def _strands(self, instance_object, slot, read):
        slots = instance_object.material_slots
        material = slots[min(slot, len(slots) - 1)].material if len(slots) else None
        text = curves.text_of(read)
        path = self._content.put([text.encode() + b"\n"], ".pbrt")
        self._report.approximated(f'object "{instance_object.name}"',
                                  "the radius of hair runs evenly from the mean at the root to "
                                  "that at the tip")
        return [(self.shading_of(material), path)]

    # Volumes.

    def _read_volume(self, instance_object, corners):
        volume = instance_object.data
        item = f'object "{instance_object.name}"'
        volume.grids.load()
        path = bpy.path.abspath(volume.grids.frame_filepath or volume.filepath)
        slots = instance_object.material_slots
        shading = self._shading(slots[0].material if len(slots) else None)
        if not path or shading.medium is None:
            self._report.left_out(item, "a volume without a file or without a volume shader")
            return None
        if shading.medium.density_grid not in ("", "density"):
            self._report.left_out(item, f'Density Attribute "{shading.medium.density_grid}": the '
                                        'grid "density" is used')
        try:
            stored = self._content.put_file(path)
        except OSError as error:
            self._report.left_out(item, f"{path}: {error.strerror}")
            return None
        return VolumeObject(stored, corners, shading,
                            getattr(volume.render, "space", "OBJECT") == "OBJECT")


def _has_depth(arrays):
    """Whether a mesh is more than one facet in a plane."""
    return arrays is None or len(arrays.triangles) > FLAT_TRIANGLES_MAX


def is_catcher(instance, instance_object):
    """Whether an instance or what makes it is a shadow catcher."""
    return getattr(instance_object, "is_shadow_catcher", False) or (
        instance.is_instance and getattr(instance.parent, "is_shadow_catcher", False))


def affine(matrix):
    """A copy whose last row is 0 0 0 1, as in Cycles: inverses of parents leave 0.99999994."""
    found = matrix.copy()
    found[3] = (0.0, 0.0, 0.0, 1.0)
    return found


def _texture_space(mesh):
    """Its names until Blender 3.4 had no underscore between words."""
    return tuple(tuple(getattr(mesh, f"texspace_{part}", None) or (usual,) * 3)
                 for part, usual in (("location", 0.0), ("size", 1.0)))


def _geometry_key(instance_object, kind, seen):
    """Equal for objects of the same shape and materials: linked duplicates without modifiers share
    their evaluated mesh.
    """
    if kind != "MESH":
        return instance_object.original.as_pointer(), seen[1]
    return seen[1], tuple(slot.material.name_full if slot.material else None
                          for slot in instance_object.material_slots)


def motion_key(instance, instance_object):
    return (instance_object.name, tuple(instance.persistent_id) if instance.is_instance else (),
            instance.parent.name if instance.is_instance and instance.parent else "")
