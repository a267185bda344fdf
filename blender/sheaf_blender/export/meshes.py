# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Meshes of evaluated objects as arrays, read in bulk."""
import numpy

from ..scene import mesh_arrays, pixel_ops


def read_parts(mesh, shadings):
    """[(material slot, MeshArrays)] of an evaluated mesh; empty without triangles. shadings:
    of the slots; they name their uv map, and what turns it.
    """
    slot_count = len(shadings)
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    if count == 0:
        return []
    triangles = _read(mesh.loop_triangles, "loops", 3 * count, numpy.int32).reshape(-1, 3)
    corner_vertices = _read(mesh.loops, "vertex_index", len(mesh.loops), numpy.int32)
    positions = read_positions(mesh)
    uvs_of = {chosen: _uvs(mesh, *chosen) for chosen in
              {(shading.uv_map, shading.uv_base) for shading in shadings}}
    normals = _normals(mesh)
    slots = (_read(mesh.loop_triangles, "material_index", count, numpy.int32) if slot_count > 1
             else None)
    normals_source = None if normals is None else _normals_source(mesh)
    parts = []
    for slot, chosen in mesh_arrays.by_material(slots, slot_count):
        uvs = uvs_of[shadings[slot].uv_map, shadings[slot].uv_base]
        colors = _colors(mesh, shadings[slot].colors, corner_vertices)
        arrays = mesh_arrays.build(positions, corner_vertices, triangles[chosen], normals, uvs,
                                   colors)
        if normals_source is not None:
            source = [positions, corner_vertices, triangles[chosen], *normals_source,
                      *[found for found in (uvs, colors) if found is not None]]
            arrays.source = [numpy.array([array.size for array in source]), *source]
        parts.append((slot, arrays))
    return parts


def read_positions(mesh):
    return _read(mesh.vertices, "co", 3 * len(mesh.vertices), numpy.float32).reshape(-1, 3)


def read_at_corners(mesh, corners):
    """(positions, normals or None) of the vertices that have these corners (MeshArrays.corners);
    None if the mesh has other corners now.
    """
    if len(corners) and corners.max() >= len(mesh.loops):
        return None
    corner_vertices = _read(mesh.loops, "vertex_index", len(mesh.loops), numpy.int32)
    normals = _normals(mesh)
    return (read_positions(mesh)[corner_vertices[corners]],
            None if normals is None else normals[corners])


def _read(collection, name, count, kind):
    values = numpy.empty(count, kind)
    collection.foreach_get(name, values)
    return values


def _uvs(mesh, name, base):
    layer = (mesh.uv_layers.get(name) if name else
             next((layer for layer in mesh.uv_layers if layer.active_render), None))
    if layer is None:
        return None
    found = _read(layer.data, "uv", 2 * len(mesh.loops), numpy.float32).reshape(-1, 2)
    if base == ((1.0, 0.0), (0.0, 1.0)):
        return found
    return (found @ numpy.array(base).T).astype(numpy.float32)


_COMPONENTS = {"FLOAT": ("value", 1), "FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2),
               "FLOAT_COLOR": ("color", 4), "BYTE_COLOR": ("color", 4)}


def _colors(mesh, wanted, corner_vertices):
    """(corners, 4) of an attribute of the mesh after operations on its colors, or None. wanted:
    Shading.colors. Without such an attribute it is black, as in Cycles.
    """
    if wanted is None:
        return None
    name, operations = wanted
    attribute = _attribute(mesh, name)
    found = numpy.zeros((len(corner_vertices), 4), numpy.float32)
    if attribute is None and name in mesh.uv_layers:  # No attribute before Blender 3.5.
        found[:, 3] = 1
        found[:, :2] = _uvs(mesh, name, ((1.0, 0.0), (0.0, 1.0)))
    elif attribute is not None:
        field, count = _COMPONENTS[attribute.data_type]
        numbers = _read(attribute.data, field, count * len(attribute.data),
                        numpy.float32).reshape(-1, count)
        numbers = numbers[_elements(mesh, attribute.domain, corner_vertices)]
        found[:, 3] = 1
        found[:, :count] = numbers
        if count == 1:
            found[:, :3] = numbers
    found[:, :3] = pixel_ops.run(found[:, :3].astype(numpy.float64), operations)
    return found


def _attribute(mesh, name):
    """The attribute; "" is the color attribute that is active for rendering."""
    if not name:
        index = mesh.color_attributes.render_color_index
        name = mesh.color_attributes[index].name if 0 <= index < len(
            mesh.color_attributes) else ""
    found = mesh.attributes.get(name) if name else None
    if found is None or found.data_type not in _COMPONENTS or found.domain not in (
            "POINT", "CORNER", "FACE"):
        return None
    return found


def _elements(mesh, domain, corner_vertices):
    """The index of each corner's element."""
    if domain == "POINT":
        return corner_vertices
    if domain == "CORNER":
        return slice(None)
    return numpy.repeat(numpy.arange(len(mesh.polygons)),
                        _read(mesh.polygons, "loop_total", len(mesh.polygons), numpy.int32))


def _normals_source(mesh):
    """The arrays from which Blender computes the normals, beside the shape. None if the mesh stores
    them, or if they are always bit-identical.

    Before 4.1 threads add up the normals of faces in any order: last bits differ from one
    evaluation to the next.
    """
    if hasattr(mesh, "corner_normals") or mesh.has_custom_normals:
        return None
    count = len(mesh.edges)
    return [_read(mesh.polygons, "use_smooth", len(mesh.polygons), bool),
            _read(mesh.edges, "use_edge_sharp", count, bool),
            numpy.array([mesh.use_auto_smooth, mesh.auto_smooth_angle], numpy.float32)]


def _normals(mesh):
    """Normals of corners; None if all faces are flat, which needs no normals."""
    if hasattr(mesh, "corner_normals"):  # Blender 4.1 and later.
        if mesh.normals_domain == "FACE":
            return None
        return _read(mesh.corner_normals, "vector", 3 * len(mesh.loops),
                     numpy.float32).reshape(-1, 3)
    is_smooth = _read(mesh.polygons, "use_smooth", len(mesh.polygons), bool)
    if not is_smooth.any() and not mesh.has_custom_normals:
        return None
    mesh.calc_normals_split()
    normals = _read(mesh.loops, "normal", 3 * len(mesh.loops), numpy.float32).reshape(-1, 3)
    return normals
