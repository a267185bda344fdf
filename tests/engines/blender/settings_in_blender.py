# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: each property of the types that Cycles reads is in one of the lists of the
add-on. Prints SETTINGS_OK with the count.

blender -b --factory-startup --python settings_in_blender.py
"""
import sys

import bpy

bpy.ops.preferences.addon_enable(module="cycles")
bpy.ops.preferences.addon_enable(module="sheaf_blender")

import cycles.properties
from sheaf_blender.scene import settings_table, settings_without_effect as without


def properties(owner):
    found = getattr(bpy.types, owner, None) or getattr(cycles.properties, owner, None)
    return [] if found is None else [known.identifier for known in found.bl_rna.properties]


def main():
    unknown, twice, count = [], [], 0
    for owner in settings_table.TABLE:
        listed = settings_table.names(owner)
        silent = without.NAMES.get(owner, frozenset())
        twice += [f"{owner}.{name}" for name in listed & silent]
        found = properties(owner)
        count += len(found)
        unknown += [f"{owner}.{name}" for name in found
                    if name not in listed | silent | without.COMMON]
    missing = [owner for owner in settings_table.TABLE
               if not properties(owner) and owner != "CyclesCameraSettings"]
    if unknown or twice or missing or count < 500:
        print(f"in no list: {unknown}; in two lists: {twice}; no such type: {missing}; {count}")
        sys.exit(1)
    print(f"SETTINGS_OK {bpy.app.version_string}: {count} properties")


main()
