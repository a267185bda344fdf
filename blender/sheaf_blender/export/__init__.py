# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Reads Blender's evaluated scene and hands plain values to the package `scene`."""
