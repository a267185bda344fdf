# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""What is written: scene text, meshes, materials, units. Needs numpy, and no Blender."""
