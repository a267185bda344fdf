# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes the scene file from what the collector has read."""
import dataclasses

import mathutils
import numpy

from ..scene import closures, materials, ray_visibility, values
from ..scene.text import parameters_text
from . import inside_of, lights, motion, placed_nodes, shaders, smoke
from .collector import Geometry

_MATRIX_FORMAT = "[" + " ".join(["%.9g"] * 16) + "]"


class SceneWriter:
    """Writes shapes, instances and media, with the names of Blender's objects for mattes."""

    def __init__(self, text, textures, images, content, exposure, report, groups):
        self._text, self._groups = text, groups
        self._textures, self._images, self._report = textures, images, report
        self._content, self._exposure = content, exposure
        self._materials = materials.MaterialTable(text, textures)
        self._media = {}    # By medium: two materials of one name may differ.
        self._prepared = {}
        self._around = ""   # The medium that fills the world,
        self._filling = None  # as a shaders.Medium.

    def fill_world(self, shading):
        """Writes the medium of the world, which surrounds and fills what has none of its own."""
        self._around, self._filling = self._medium(shading), shading.medium
        self._text.raw(self._usual_media())

    def _usual_media(self):
        return f'MediumInterface "{_plain(self._around)}" "{_plain(self._around)}"'

    def write(self, geometries, moved):
        """moved: a motion.Motion; None without motion blur."""
        # Media add up, unless the surfaces name the world's outside.
        with self._report.guard("volumes"):
            for name, other in inside_of.overlaps(geometries) if self._around else ():
                self._report.approximated(f'object "{name}"', f'its volume and that of "{other}" '
                                          "meet in the world's: one of them counts where Cycles "
                                          "has both")
        for geometry in geometries:
            with self._report.guard(f'object "{geometry.name}"'):
                for placed in placed_nodes.by_place(geometry):
                    self._write_placed(placed, moved)

    def _write_placed(self, geometry, moved):
        if not geometry.parts and not geometry.strands and geometry.medium_grid is None:
            return
        names = [self._prepare(part.shading) for part in geometry.parts]
        for shading, _ in geometry.strands:
            self._prepare(shading)
        with self._report.guard(_item(geometry)), self._text.whole():
            self._write_geometry(geometry, names, moved)

    def _write_geometry(self, geometry, names, moved):
        self._write_flat_ones(geometry, names)
        if geometry.medium_grid is not None:
            self._write_grids(geometry)
        elif geometry.smoke is not None:
            self._write_smoke(geometry, names)
        elif len(geometry.matrices) == 1 or any(map(self._emits, geometry.parts)):
            for i in range(len(geometry.matrices)):
                self._write_alone(geometry, names, i, moved)
        elif geometry.matrices:
            self._write_instances(geometry, names, moved)

    def _write_flat_ones(self, geometry, names):
        """Writes and drops the places at which the object is scaled to a plane, as a mesh in the
        world; drops those at which it is scaled to nothing.
        """
        for i in reversed(range(len(geometry.matrices))):
            matrix = geometry.matrices[i]
            if matrix is None or not inside_of.is_singular(matrix):
                continue
            if inside_of.is_plane(matrix):
                self._write_flat(geometry, names, i)
            for values_of in (geometry.matrices, geometry.object_names, geometry.keys,
                              geometry.groups):
                del values_of[i]

    def _write_flat(self, geometry, names, index):
        item = f'object "{geometry.object_names[index]}"'
        if geometry.strands or geometry.medium_grid is not None:
            self._report.left_out(item, "it is scaled to a plane; it is invisible")
            return
        parts = []
        for part in geometry.parts:
            file, = motion.baked_files(self._content, part, [geometry.matrices[index]], None)
            parts.append(dataclasses.replace(part, file=file, later_files=[]))
        self._write_shapes(dataclasses.replace(geometry, parts=parts),
                           [(material, "") for material, _ in names], geometry.object_names[index],
                           geometry.groups[index])

    def write_camera_medium(self, found, item):
        """The name of the medium around the camera; empty for none. found: see inside_of."""
        if not found:
            return self._around
        if len(found) > 1:
            self._report.approximated(item, f"it is in {len(found)} volumes; the first one counts")
        geometry, index, part = found[0]
        if part is None:
            return _grid_name(geometry, index)
        return self._prepare(part.shading)[1]

    def _prepare(self, shading):
        """(material, medium), which are written before shapes use them."""
        if shading not in self._prepared:
            found = None
            with self._report.guard(f'material "{shading.name}"'):
                found = self._written(shading)
            self._prepared[shading] = found or (self._materials.name_of(
                materials.diffuse(closures.PINK), "cannot be exported"), "")
        return self._prepared[shading]

    def _written(self, shading):
        closure = shading.closure
        material = closure.material
        if not shading.has_surface and shading.medium is not None:
            material = materials.make("interface")
        elif material is None:
            material = materials.diffuse((0.0, 0.0, 0.0))
        emission = closure.emission
        if values.is_constant(emission) and min(emission) < 0 and (
                max(emission) > 0 or not self._groups.can_subtract):
            self._report.left_out(f'material "{shading.name}"', "its negative Emission; it gives "
                                  "no light in the channels below 0")
        limited = materials.bounded(material)
        if limited != material:
            self._report.approximated(f'material "{shading.name}"',
                                      "a color above 1 reflects as much as 1")
            material = limited
        is_open = materials.is_boundary(material) or closures.opacity(closure) != 1.0
        if shading.medium is not None and not is_open:
            self._report.left_out(f'material "{shading.name}"',
                                  "its Volume, which its opaque surface hides")
        return self._materials.name_of(material, shading.name), self._medium(shading)

    def _medium(self, shading):
        medium = shading.medium
        if medium is None:
            return ""
        if self._filling is not None:
            medium = self._with_filling(medium, shading.name)
        if medium not in self._media:
            if medium.blackbody > 0:
                self._report.left_out(f'material "{shading.name}"',
                                      "Blackbody of a volume without a grid")
            name = shading.name
            while name in self._media.values():
                name += "'"
            self._text.directive("MakeNamedMedium", name, {
                "string type": "homogeneous", **_coefficients(medium, 1.0, self._exposure)})
            self._media[medium] = name
        return self._media[medium]

    def _with_filling(self, medium, name):
        """The medium and that of the world in one, as Cycles adds them."""
        both = [medium, self._filling]
        scatter = [one for one in both if max(one.scattering) > 0]
        if len(scatter) == 2 and scatter[0].anisotropy != scatter[1].anisotropy:
            self._report.approximated(f'material "{name}"', "its volume and that of the world "
                                      "scatter with the mean of their Anisotropy")
        return shaders.sum_of_media(both)

    def _note_filling(self, geometry):
        if self._filling is not None:
            self._report.left_out(_item(geometry), "the volume of the world inside its grid: it is "
                                                   "thinner there than in Cycles")

    def _emits(self, part):
        emission = part.shading.closure.emission
        if not values.is_constant(emission) or max(emission) > 0:
            return True
        return self._groups.can_subtract and min(emission) < 0

    def _write_alone(self, geometry, names, index, moved):
        text = self._text
        matrix = geometry.matrices[index]
        found, is_even = self._motion(geometry, index, moved)
        text.directive("AttributeBegin")
        if found and not is_even:
            self._write_baked(geometry, names, index, found, moved)
        else:
            if matrix is not None:
                lights.write_transform(text, *(found or (matrix, None)))
            self._write_shapes(geometry, names, geometry.object_names[index],
                               geometry.groups[index])
        text.directive("AttributeEnd")

    def _motion(self, geometry, index, moved):
        """See motion.Motion.of_instance."""
        if moved is None or geometry.keys[index] is None:
            return [], True
        found, is_even = moved.of_instance(geometry, index)
        item = f'object "{geometry.object_names[index]}"'
        if found and any(map(self._emits, geometry.parts)):
            self._report.left_out(item, "its motion while the shutter is open: it shines, and "
                                        "stands where it is at the frame")
            return [], True
        if any(map(inside_of.is_singular, found)):
            self._report.left_out(item, "its motion while the shutter is open: it is flat at times")
            return [], True
        if not is_even and (not geometry.parts or geometry.strands or moved.is_full):
            self._report.approximated(item, "its motion while the shutter is open is made even")
            return [found[0], found[-1]], True
        return found, is_even

    def _write_baked(self, geometry, names, index, found, moved):
        """Shapes whose vertices are in world space at each key."""
        deformed = [s.meshes.get(geometry.name) for s in moved.snapshots]
        parts = []
        for i, part in enumerate(geometry.parts):
            shapes = None if None in deformed else [parts_then[i] for parts_then in deformed]
            files = motion.baked_files(self._content, part, found, shapes)
            parts.append(dataclasses.replace(part, file=files[0], later_files=files[1:]))
        self._write_shapes(dataclasses.replace(geometry, parts=parts), names,
                           geometry.object_names[index])

    def _write_shapes(self, geometry: Geometry, names, object_name=None, group=""):
        """object_name: of shapes that stand alone; instances name those of an object. group: of
        their light.
        """
        text = self._text
        invisible = ray_visibility.parameter(geometry.hidden_from)
        for part, (material, medium) in zip(geometry.parts, names):
            parameters = {"string filename": part.file, **_name(object_name), **invisible}
            if part.arrays is not None and part.arrays.colors is not None:
                parameters["bool vertexcolors"] = True
            for i, file in enumerate(part.later_files):
                parameters[f"string filename{i + 1}"] = file
            alpha = part.shading.closure.alpha
            if alpha != 1.0 and part.shading.has_surface:
                parameters.update(self._textures.parameter("alpha", alpha, False))
            text.directive("NamedMaterial", material)
            if medium:
                text.raw(f'MediumInterface "{_plain(medium)}" "{_plain(self._around)}"')
            emits = self._emits(part)
            if emits:
                text.directive("AttributeBegin")
                self._write_emission(part, group)
            text.directive("Shape", "plymesh", parameters)
            if emits:
                text.directive("AttributeEnd")
            if medium:
                text.raw(self._usual_media())
        for shading, path in geometry.strands:
            material, _ = self._prepare(shading)
            text.directive("NamedMaterial", material)
            text.directive("AttributeBegin")
            if object_name is not None or invisible:
                text.directive("Attribute", "shape", {**_name(object_name), **invisible})
            text.directive("Include", path)
            text.directive("AttributeEnd")

    def _write_emission(self, part, group):
        emission = part.shading.closure.emission
        if not values.is_constant(emission):
            self._report.approximated(f'material "{part.shading.name}"',
                                      "a texture of Emission: its mean is used")
            mean = [self._images.mean(values.apply(emission, "channel", i)) for i in range(3)]
            emission = tuple(mean)
        emission = values.color(emission)
        is_negative = max(emission) <= 0
        if is_negative:
            emission = tuple(-c for c in emission)
        with self._text.lights_with(self._groups.parameters(group, is_negative)):
            self._text.directive("AreaLightSource", "diffuse", {
                "rgb L": tuple(max(0.0, self._exposure * c) for c in emission),
                "bool twosided": True})

    def _write_instances(self, geometry, names, moved):
        text = self._text
        text.directive("ObjectBegin", geometry.name)
        self._write_shapes(geometry, names)
        text.directive("ObjectEnd")
        moving = {i: found for i in range(len(geometry.matrices) if moved else 0)
                  if (found := self._motion(geometry, i, moved))[0]}
        places = [f'ObjectInstance "{_plain(geometry.name)}"{parameters_text(_name(name))}'
                  for name in geometry.object_names]
        flat = numpy.array([[x for column in matrix.col for x in column]
                            for matrix in geometry.matrices])
        if not numpy.isfinite(flat).all():
            raise ValueError(f'an instance of "{geometry.name}" has a transform that is not '
                             "finite; correct it in Blender")
        lines = [f"AttributeBegin ConcatTransform {_MATRIX_FORMAT % tuple(numbers)} {places[i]} "
                 "AttributeEnd" for i, numbers in enumerate(flat.tolist()) if i not in moving]
        if lines:
            text.raw("\n".join(lines))
        for i, (found, is_even) in moving.items():
            text.directive("AttributeBegin")
            if is_even:
                lights.write_transform(text, *found)
                text.raw(places[i])
            else:
                self._write_baked(geometry, names, i, found, moved)
            text.directive("AttributeEnd")

    def _write_smoke(self, geometry, names):
        """Each instance of a mesh with a grid of smoke of its own inside."""
        text = self._text
        self._note_filling(geometry)
        for i, matrix in enumerate(geometry.matrices):
            name = _grid_name(geometry, i)
            text.directive("AttributeBegin")
            text.transform("ConcatTransform", matrix)
            found = smoke.parameters(geometry.smoke,
                                     _coefficients(geometry.smoke.medium, 1.0, self._exposure))
            text.raw(f'MakeNamedMedium "{_plain(name)}"{parameters_text(found)}'
                     + smoke.densities(geometry.smoke))
            self._write_shapes(geometry, [(material, name) for material, _ in names],
                               geometry.object_names[i])
            text.directive("AttributeEnd")

    def _write_grids(self, geometry):
        """A box around each instance of a volume, filled with the grid of its file."""
        grid, text = geometry.medium_grid, self._text
        self._note_filling(geometry)
        medium = grid.shading.medium
        for i, matrix in enumerate(geometry.matrices):
            scale = matrix.median_scale if grid.is_object_space else 1.0
            name = _grid_name(geometry, i)
            text.directive("AttributeBegin")
            text.transform("ConcatTransform", matrix)
            parameters = {"string type": "openvdb", "string filename": grid.path,
                          **_coefficients(medium, 1 / (scale or 1.0), self._exposure)}
            if medium.blackbody > 0:
                parameters["float LeScale"] = medium.blackbody * self._exposure
            text.directive("MakeNamedMedium", name, parameters)
            text.raw(f'MediumInterface "{_plain(name)}" "{_plain(self._around)}"')
            text.directive("Material", "interface")
            text.directive("Shape", "trianglemesh",
                           {**_box(grid.corners), **_name(geometry.object_names[i]),
                            **ray_visibility.parameter(geometry.hidden_from)})
            text.directive("AttributeEnd")


def _item(geometry):
    return f'object "{(geometry.object_names or [geometry.name])[0]}"'


def _grid_name(geometry, index):
    return f"{geometry.name} {index + 1}"


def _coefficients(medium, scale, exposure):
    found = {"rgb sigma_a": medium.absorption, "rgb sigma_s": medium.scattering,
             "float scale": float(scale),
             "float g": min(max(medium.anisotropy, -0.99), 0.99)}
    if max(medium.emission) > 0:
        found["rgb Le"] = tuple(exposure * x for x in medium.emission)
    return found


def _name(name):
    """Sheaf takes printable names of mattes."""
    if name is None:
        return {}
    return {"string name": "".join(c if c.isprintable() else "_" for c in name)}


def _plain(name):
    return "".join(c if c >= " " else " " for c in name).replace("\\", "\\\\").replace('"', '\\"')


def _box(corners):
    """The faces of Blender's bounding box, a little larger, seen from outside."""
    low = [min(corner[i] for corner in corners) for i in range(3)]
    high = [max(corner[i] for corner in corners) for i in range(3)]
    margin = [1e-3 * (b - a) + 1e-6 for a, b in zip(low, high)]
    box = [(a - m, b + m) for a, b, m in zip(low, high, margin)]
    points = [box[0][i & 1] if axis == 0 else box[1][i >> 1 & 1] if axis == 1 else box[2][i >> 2]
              for i in range(8) for axis in range(3)]
    faces = [0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
             2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5]
    return {"point3 P": tuple(map(float, points)), "integer indices": tuple(faces)}


def sphere_of(geometries):
    """(center, radius) around all instances."""
    centers, radii = [], []
    for geometry in geometries:
        for matrix in geometry.matrices:
            if matrix is not None:
                centers.append(matrix.translation)
                radii.append(geometry.radius * max(abs(x) for x in matrix.to_scale()))
    if not centers:
        return mathutils.Vector((0, 0, 0)), 1.0
    points = numpy.array([tuple(center) for center in centers])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float((numpy.linalg.norm(points - middle, axis=1) + numpy.array(radii)).max())
    return mathutils.Vector(middle), radius
