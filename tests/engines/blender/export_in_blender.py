# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: exports a scene twice without rendering it."""
import os
import sys

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender

name, _, samples, output, folder = sys.argv[sys.argv.index("--") + 1:][:5]
scene = in_blender.build(name, folder)
in_blender.use_sheaf(scene, int(samples))
for _ in range(2):
    bpy.ops.sheaf.export_scene(filepath=output)
