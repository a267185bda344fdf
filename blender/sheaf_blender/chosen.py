# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The user's choices in Blender: preferences of the add-on, folders, threads."""
import os
import tempfile
import types

import bpy

from .farm import program


def preferences():
    """The preferences of the add-on, or their defaults: `blender --addons` enables it without."""
    addon = bpy.context.preferences.addons.get(__package__)
    if addon is not None and addon.preferences is not None:
        return addon.preferences
    return types.SimpleNamespace(program_folder=program.default_program_folder(), address="",
                                 http_port=0, insecure=False, content_folder="")


def content_folder():
    return bpy.path.abspath(preferences().content_folder) or os.path.join(
        tempfile.gettempdir(), f"sheaf-blender-content-{os.getuid()}")


def threads(scene):
    return scene.render.threads if scene.render.threads_mode == "FIXED" else 0
