# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Has Cycles render the nodes of a world to a map, in a Blender of its own: skies, gradients, noise
and mixes of them have Cycles' exact meaning.
"""
import hashlib
import os
import pathlib
import subprocess
import tempfile

import bpy
import numpy

from ..farm import images as image_files
from ..scene import sphere_map

WIDTH_PX, HEIGHT_PX = 2048, 1024  # A pixel is a third of the sun's disk.
EDGE_TEXELS = 1024                # The square's: a texel is as large as a pixel at the horizon.
SAMPLES = 4
SECONDS_MAX = 600
KEPT_MAPS_MAX = 4
_SCRIPT = pathlib.Path(__file__).with_name("world_bake_script.py")
_kept = {}  # By what the nodes are.


class BakeError(Exception):
    """Why there is no map, in one line."""


def bake(world, scene, is_for_camera=True):
    """(pixels, square): (height, width, 3) float32, rows from the bottom, and the equal-area square
    of them. is_for_camera: whether Is Camera Ray of Light Path nodes is true. Raises BakeError.
    """
    key = _fingerprint(world.node_tree), is_for_camera
    if key not in _kept:
        while len(_kept) >= KEPT_MAPS_MAX:
            del _kept[next(iter(_kept))]
        pixels = _rendered(world, scene, is_for_camera)
        _kept[key] = pixels, sphere_map.equal_area_from_equirectangular(
            numpy.maximum(pixels, 0), EDGE_TEXELS)
    return _kept[key]


def _rendered(world, scene, is_for_camera):
    with tempfile.TemporaryDirectory(prefix="sheaf-world-") as folder:
        file, image = os.path.join(folder, "world.blend"), os.path.join(folder, "world.exr")
        try:
            bpy.data.libraries.write(file, {world.original}, path_remap="ABSOLUTE",
                                     fake_user=True)
            frame = scene.frame_current + scene.frame_subframe
            done = subprocess.run(
                [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "3",
                 "--python", str(_SCRIPT), "--", file, image, str(frame), str(WIDTH_PX),
                 str(HEIGHT_PX), str(SAMPLES), str(int(is_for_camera))],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                text=True, errors="replace", timeout=SECONDS_MAX, check=False)
        except (OSError, RuntimeError, subprocess.TimeoutExpired) as error:
            raise BakeError(str(error)) from error
        if done.returncode != 0 or not os.path.exists(image):
            lines = done.stdout.strip().splitlines() or ["no output"]
            raise BakeError(f"Blender ended with {done.returncode}: {lines[-1]}")
        return numpy.ascontiguousarray(image_files.read_float(image)[::-1, :, :3])


def _fingerprint(tree):
    """Stands for the values of all nodes and links."""
    digest = hashlib.blake2b(digest_size=16)
    for line in _lines_of(tree):
        digest.update(line.encode() + b"\n")
    return digest.hexdigest()


def _lines_of(tree):
    for node in tree.nodes:
        yield f"node {node.name} {node.type} {node.mute}"
        yield from _values_of(node)
        for socket in node.inputs:
            yield f"{socket.identifier} {_plain(getattr(socket, 'default_value', None))}"
        for name in ("color_ramp", "mapping"):
            found = getattr(node, name, None)
            for curve in getattr(found, "curves", ()) or ():
                yield " ".join(_plain(point.location) for point in curve.points)
            for element in getattr(found, "elements", ()) or ():
                yield f"{element.position} {_plain(element.color)}"
        found = getattr(node, "object", None)
        if found is not None:
            yield str([tuple(row) for row in found.matrix_world])
        if node.type == "GROUP" and node.node_tree:
            yield from _lines_of(node.node_tree)
    for link in tree.links:
        yield (f"{link.from_node.name}.{link.from_socket.identifier} "
               f"{link.to_node.name}.{link.to_socket.identifier} {link.is_muted}")


def _values_of(node):
    for known in node.bl_rna.properties:
        if known.type in ("FLOAT", "INT", "ENUM", "BOOLEAN", "STRING"):
            yield f"{known.identifier} {_plain(getattr(node, known.identifier, None))}"
        elif known.type == "POINTER":
            found = getattr(node, known.identifier, None)
            yield f"{known.identifier} {getattr(found, 'name_full', '')}"


def _plain(value):
    if isinstance(value, (int, float, str, bool, type(None))):
        return repr(value)
    try:
        return repr([x for x in value])
    except TypeError:
        return ""
