# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The files of a scene: scene text, meshes, materials, units. Needs numpy, but not Blender."""
