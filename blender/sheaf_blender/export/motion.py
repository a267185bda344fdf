# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Reads the scene while the shutter is open: at as many even steps as its motion needs."""
import dataclasses

import mathutils
import numpy

from ..scene import ply
from . import meshes
from .collector import affine, motion_key

KEYS_MAX = 17             # As many steps as a mesh of Sheaf may have.
ERROR_MAX_PX = 0.25       # Between two keys, as the camera sees it.
KEYED_INSTANCES_MAX = 500  # Instances whose motion is written as a mesh of several keys.


@dataclasses.dataclass
class Snapshot:
    """The scene at one time. meshes: by geometry, [(positions, normals) of each part], or None if
    the mesh has other corners than at the frame.
    """
    matrices: dict
    meshes: dict
    camera: tuple  # (matrix of the camera, its window); see camera.state.


class Motion:
    """snapshots: at even steps from the opening to the closing shutter."""

    def __init__(self, snapshots, pixel_of):
        self.snapshots = snapshots
        self._pixel_of = pixel_of
        self._keyed = 0

    def matrices(self, key):
        """The matrices at all keys, without those at which the object is not there."""
        return [s.matrices[key] for s in self.snapshots if key in s.matrices]

    def of_instance(self, geometry, index):
        """(matrices, is even) of a moving instance: two if it moves evenly; ([], True) if it does
        not move.
        """
        key = geometry.keys[index]
        if key is None or not geometry.may_move:
            return [], True
        found = self.matrices(key)
        if len(found) != len(self.snapshots) or all(m == geometry.matrices[index] for m in found):
            return [], True
        worst = max(_error(matrix, interpolated(found[0], found[-1], i / (len(found) - 1)),
                           geometry.radius) for i, matrix in enumerate(found))
        if worst <= ERROR_MAX_PX * self._pixel_of(geometry.matrices[index].translation):
            return [found[0], found[-1]], True
        self._keyed += 1
        return found, False

    @property
    def is_full(self):
        """Whether no further instance is written as a mesh of several keys."""
        return self._keyed > KEYED_INSTANCES_MAX


def read(depsgraph, collector, camera_of, set_fraction, frame_fraction, pixel_of):
    """The Motion. set_fraction(t) evaluates the scene at t, 0 when the shutter opens and 1 when it
    closes; frame_fraction: where it stands when this is called. pixel_of(point): the size of a
    pixel there.
    """
    taken = {frame_fraction: _snapshot(depsgraph, collector, camera_of)}

    def at(time):
        if time not in taken:
            set_fraction(time)
            taken[time] = _snapshot(depsgraph, collector, camera_of)
        return taken[time]

    steps = 1
    at(0.0), at(1.0)
    while 2 * steps < KEYS_MAX:
        middles = [(2 * i + 1) / (2 * steps) for i in range(steps)]
        between = [(at(m - 0.5 / steps), at(m), at(m + 0.5 / steps)) for m in middles]
        whole = at(0.0), at(1.0)
        if not any(_needs_middle(collector, whole, middle, *three, pixel_of)
                   for middle, three in zip(middles, between)):
            break
        steps *= 2
    return Motion([at(i / steps) for i in range(steps + 1)], pixel_of)


def _snapshot(depsgraph, collector, camera_of):
    matrices, found = {}, {}
    deforming = {geometry.object_names[0]: geometry for geometry in collector.geometries.values()
                 if geometry.may_deform and geometry.object_names}
    for instance in depsgraph.object_instances:
        instance_object = instance.object
        matrices[motion_key(instance, instance_object)] = affine(instance.matrix_world)
        geometry = deforming.get(instance_object.name)
        if geometry is not None and geometry.name not in found:
            found[geometry.name] = _read_parts(geometry, instance_object)
    return Snapshot(matrices, found, camera_of())


def _read_parts(geometry, instance_object):
    is_copy = instance_object.type != "MESH"
    mesh = instance_object.to_mesh() if is_copy else instance_object.data
    try:
        parts = []
        for part in geometry.parts:
            read_now = meshes.read_at_corners(mesh, part.arrays.corners)
            if read_now is None or (read_now[1] is None) != (part.arrays.normals is None):
                return None
            parts.append(read_now)
        return parts
    finally:
        if is_copy:
            instance_object.to_mesh_clear()


def _needs_middle(collector, whole, time, before, middle, after, pixel_of):
    """Whether the scene at this time differs from what is made of the other keys: from the even
    motion of the whole shutter, and from the straight way of vertices between before and after.
    """
    for geometry in collector.geometries.values():
        for key, matrix in zip(geometry.keys, geometry.matrices):
            five = [s.matrices.get(key) for s in (*whole, before, middle, after)]
            if (None in five or not geometry.may_move or not geometry.parts
                    or all(one == five[0] for one in five)):
                continue
            limit = ERROR_MAX_PX * pixel_of(matrix.translation)
            first, last, left, now, right = five
            if (_error(now, interpolated(first, last, time), geometry.radius) > limit
                    and _error(now, (left + right) * 0.5, geometry.radius) > limit):
                return True
        if geometry.may_deform and _bends(geometry, before, middle, after, pixel_of):
            return True
    return False


def _bends(geometry, before, middle, after, pixel_of):
    three = [s.meshes.get(geometry.name) for s in (before, middle, after)]
    if None in three:
        return False
    scale = max(abs(x) for x in geometry.matrices[0].to_scale())
    limit = ERROR_MAX_PX * pixel_of(geometry.matrices[0].translation)
    return any(float(numpy.abs((a[0] + c[0]) / 2 - b[0]).max(initial=0)) * scale > limit
               for a, b, c in zip(*three))


def _error(matrix, made, radius):
    """How far apart two matrices put the points of a sphere around the origin."""
    moved = (matrix.translation - made.translation).length
    return moved + radius * max((matrix.col[i].xyz - made.col[i].xyz).length for i in range(3))


def interpolated(first, last, weight):
    """The matrix between two, as the format defines it: place and scale run evenly, and the
    rotation takes the shorter way.
    """
    if first == last:
        return first
    a, b = first.decompose(), last.decompose()
    return mathutils.Matrix.LocRotScale(a[0].lerp(b[0], weight), a[1].slerp(b[1], weight),
                                        a[2].lerp(b[2], weight))


def write_deformed(motion, collector, content, report):
    """Stores the meshes of all keys of what deforms."""
    for geometry in collector.geometries.values():
        if not geometry.may_deform:
            continue
        with report.guard(f'object "{geometry.object_names[0]}"'):
            found = [s.meshes.get(geometry.name) for s in motion.snapshots]
            if None in found:
                report.left_out(f'object "{geometry.object_names[0]}"', "its deformation: its mesh "
                                "changes while the shutter is open")
                continue
            for i, part in enumerate(geometry.parts):
                keys = [parts[i] for parts in found]
                if all((positions == part.arrays.positions).all() for positions, _ in keys):
                    continue
                files = key_files(content, part, keys)
                part.file, part.later_files = files[0], files[1:]


def key_files(content, part, keys):
    """Files of a part at several times. keys: [(positions, normals or None)]."""
    arrays = part.arrays
    return [content.put(ply.ply_chunks(positions, arrays.triangles, normals, arrays.uvs,
                                       arrays.colors), ".ply") for positions, normals in keys]


def baked_files(content, part, matrices, deformed):
    """Files of a part in world space at the keys. deformed: [(positions, normals)] of the keys, or
    None if the part keeps its shape.
    """
    arrays = part.arrays
    keys = []
    flips = matrices[0].determinant() < 0
    for i, matrix in enumerate(matrices):
        positions, normals = deformed[i] if deformed else (arrays.positions, arrays.normals)
        rows = numpy.array(matrix, numpy.float64)
        placed = positions.astype(numpy.float64) @ rows[:3, :3].T + rows[:3, 3]
        is_flat = abs(numpy.linalg.det(rows[:3, :3])) <= 1e-9 * numpy.abs(rows[:3, :3]).max() ** 3
        if is_flat:
            normals = None
        if normals is not None:
            normals = normals @ numpy.linalg.inv(rows[:3, :3])
            normals /= numpy.maximum(numpy.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
            normals = normals.astype(numpy.float32)
        keys.append((placed.astype(numpy.float32), normals))
    triangles = arrays.triangles[:, ::-1] if flips else arrays.triangles
    return [content.put(ply.ply_chunks(positions, numpy.ascontiguousarray(triangles), normals,
                                       arrays.uvs, arrays.colors), ".ply")
            for positions, normals in keys]


def note_lights(motion, collector, report):
    for place in collector.lights:
        if any(matrix != place.matrix for matrix in motion.matrices(place.key)):
            report.left_out(f'light "{place.name}"', "its motion while the shutter is open: it "
                                                     "stands where it is at the frame")
