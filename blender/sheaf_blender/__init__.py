# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Sheaf as a render engine of Blender. Nothing is imported before register(), so that the packages
`scene` and `farm`, which need no Blender, can be used and tested alone.
"""
bl_info = {
    "name": "Sheaf",
    "author": "The Sheaf authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Render > Render Engine",
    "description": "Renders on a Sheaf farm, or with Sheaf on this machine",
    "category": "Render",
}


def register():
    from . import registration
    registration.register()


def unregister():
    from . import registration
    registration.unregister()
