# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Binary PLY files, written as whole arrays."""
import numpy

_FACE = numpy.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def ply_chunks(positions, triangles, normals=None, uvs=None, colors=None):
    """The file's bytes as a list of buffers: x y z, nx ny nz, u v, red green blue alpha, and
    vertex_indices.
    """
    columns = [positions]
    names = ["x", "y", "z"]
    if normals is not None:
        columns.append(normals)
        names += ["nx", "ny", "nz"]
    if uvs is not None:
        columns.append(uvs)
        names += ["u", "v"]
    if colors is not None:
        columns.append(colors)
        names += ["red", "green", "blue", "alpha"]
    vertices = numpy.concatenate(columns, axis=1, dtype="<f4", casting="same_kind")
    if not numpy.isfinite(vertices).all():
        raise ValueError("the mesh has coordinates that are not finite numbers; correct it in "
                         "Blender (Mesh > Clean Up)")
    faces = numpy.empty(len(triangles), _FACE)
    faces["count"] = 3
    faces["vertices"] = triangles
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices",
               "end_header", ""]
    return ["\n".join(header).encode(), memoryview(vertices).cast("B"),
            memoryview(faces.view("u1")).cast("B")]
