# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: submits frames of a scene as one job, and fetches their images."""
import os
import sys

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender

name, _, samples, output, folder = sys.argv[sys.argv.index("--") + 1:][:5]
scene = in_blender.build(name, folder)
in_blender.use_sheaf(scene, int(samples))
scene.render.filepath = output
assert bpy.ops.sheaf.submit_frames() == {"FINISHED"}
assert bpy.ops.sheaf.refresh_frames() == {"FINISHED"}
print(scene.sheaf.frames_job, scene.sheaf.frames_state)
assert bpy.ops.sheaf.fetch_frames() == {"FINISHED"}
sizes = [os.path.getsize(f"{output}{frame:04d}.exr") for frame in range(1, 5)]
assert min(sizes) > 1000, sizes
print("FRAMES_OK")
