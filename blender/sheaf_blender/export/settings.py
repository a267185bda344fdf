# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Reports the settings of a scene that change Cycles' image and not Sheaf's: those of
scene/settings_table.py, and a few that depend on others.
"""
import math

import bpy

from ..scene import settings_table

COLLECTIONS_MAX = 100_000
TRANSPARENT_SHARE = 3  # Times that a way through a scene with bounces crosses its clear surfaces.
FULL_TURN_MIN = 1e-3  # Radians by which a panorama may miss the whole sphere.


def note_all(depsgraph, camera_object, collector, report):
    """Reports all settings. camera_object: None for a view without one."""
    scene = depsgraph.scene_eval
    layer = depsgraph.view_layer_eval
    _note("ViewLayer", layer, f'view layer "{layer.name}"', report)
    _note("CyclesRenderLayerSettings", getattr(layer, "cycles", None),
          f'view layer "{layer.name}"', report)
    _note_collections(depsgraph.view_layer.layer_collection, report)
    _note("RenderSettings", scene.render, "scene", report)
    cycles = getattr(scene, "cycles", None)
    _note("CyclesRenderSettings", cycles, "scene", report)
    if (scene.render.use_simplify and scene.render.simplify_volumes != 1
            and collector.has_volumes()):
        report.left_out("scene", "Simplify > Volume Resolution")
    if cycles and collector.has_fog() and cycles.volume_bounces < scene.sheaf.max_depth:
        report.approximated("scene", f"Cycles scatters light {cycles.volume_bounces} times in "
                            f"volumes, Sheaf up to {scene.sheaf.max_depth} times: volumes may be "
                            "brighter; set Volume Bounces of Cycles to compare")
    limit = getattr(cycles, "transparent_max_bounces", 8)
    if TRANSPARENT_SHARE * collector.clear_sides() > limit:
        report.approximated("scene", f"Cycles lets light pass {limit} transparent surfaces on its "
                            "way, Sheaf any number: what lies behind many is brighter; set "
                            "Transparent bounces of Cycles to compare")
    if scene.world is not None:
        item = f'world "{scene.world.name}"'
        _note("World", scene.world, item, report)
        _note("CyclesWorldSettings", getattr(scene.world, "cycles", None), item, report)
        _note("CyclesVisibilitySettings", getattr(scene.world, "cycles_visibility", None), item,
              report)
    if camera_object is not None:
        _note_camera(camera_object, report)
    for found in depsgraph.objects:
        _note_object(found, report)


def note_material(material, report):
    item = f'material "{material.name}"'
    cycles = getattr(material, "cycles", None)
    _note("Material", material, item, report)
    _note("CyclesMaterialSettings", cycles, item, report)
    method = getattr(material, "displacement_method", None) or getattr(
        cycles, "displacement_method", "BUMP")
    return method != "BUMP"


def note_light(light, item, report):
    _note(f"{light.type.title()}Light", light, item, report)
    _note("CyclesLightSettings", getattr(light, "cycles", None), item, report)


def _note(owner, instance, item, report):
    if instance is not None:
        settings_table.note(owner, instance, item, report)


def _note_collections(first, report):
    left, visited = [first], 0
    while left and visited < COLLECTIONS_MAX:
        found = left.pop()
        visited += 1
        if found.exclude:
            continue
        _note("LayerCollection", found, f'collection "{found.name}"', report)
        left += found.children


def _note_object(found, report):
    item = f'object "{found.name}"'
    _note("Object", found, item, report)
    cycles = getattr(found, "cycles", None)
    if found.type == "MESH" or found.type == "CURVES":
        _note("CyclesObjectSettings", cycles, item, report)
    linking = getattr(found, "light_linking", None)
    if linking is not None and (linking.receiver_collection or linking.blocker_collection):
        report.left_out(item, "Light Linking: it lights all, and all light it")
    if found.type == "VOLUME" and bpy.context.scene.render.use_motion_blur:
        report.left_out(item, "velocities: a volume stands still while the shutter is open")


def _note_camera(camera_object, report):
    camera = camera_object.data
    item = f'camera "{camera_object.name}"'
    _note("CameraDOFSettings", camera.dof, item, report)
    if camera.type == "PANO":
        _note_panorama(camera if hasattr(camera, "panorama_type") else camera.cycles, item, report)
        if camera.stereo.use_spherical_stereo and bpy.context.scene.render.use_multiview:
            report.left_out(item, "Spherical Stereo: both eyes of a panorama are in one place")


def _note_panorama(camera, item, report):
    full = (camera.latitude_max - camera.latitude_min, math.pi), (
        camera.longitude_max - camera.longitude_min, 2 * math.pi)
    if camera.panorama_type != "EQUIRECTANGULAR" or any(
            abs(have - want) > FULL_TURN_MIN for have, want in full):
        report.approximated(item, "a panorama is a full equirectangular one")
