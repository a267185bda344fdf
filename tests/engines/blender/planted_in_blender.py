# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: plants an exception in each function of the export, one at a time, and
exports a scene that uses them. Each time there is a scene file and a line of the report, or the
frame fails with that exception as its message (FRAME); Blender runs on. Prints PLANTED_OK.

blender -b --factory-startup --python planted_in_blender.py -- FOLDER [MODULE ...]
"""
import importlib
import os
import pkgutil
import shutil
import sys
import types

import bpy
import mathutils

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import findings_in_blender
import in_blender
import scenes
import scenes_layers
import scenes_patterns

FOLDER, *CHOSEN = sys.argv[sys.argv.index("--") + 1:]
# Without these there is no frame: the text of the file and its camera, the content folder, the
# report, the options of the job, and what holds all items.
FRAME = ("export.camera.", "export.scene_export.", "scene.text.", "scene.report.",
         "scene.frame_size.", "scene.content.ContentFolder._read_index",
         "scene.ray_visibility.known_techniques", "export.light_groups.layer_name")
# Modules that the export of this scene does not run: another Blender does, or Submit Frames, or the
# viewport, they are lists, or the camera is in no volume.
NOT_REACHED = {"export.world_bake_script", "export.eyes", "scene.settings_without_effect",
               "scene.techniques", "scene.containment", "export.region_view"}


def planted(*_, **__):
    raise ArithmeticError("planted")


def everything(b):
    findings_in_blender.everything(b)
    scenes_layers.lamp(b, (2, -3, 5), 50.0, "Key")
    b.scene.view_layers[0].lightgroups.add(name="Key")
    b.light("AREA", (0, -3, 6), energy=50.0, size=1.0, spread=1.0)
    b.scene.camera.data.clip_end = 8.0
    pattern = scenes_patterns.painted(b, "Pattern", ("Voronoi", {}, {}, "Distance"),
                                      lambda nodes, links: None, scenes_patterns.ramp)
    b.cube("Patterned", mathutils.Matrix.Translation((-2, 1, 1)), pattern).is_holdout = True
    b.scene.render.use_multiview = True


def modules():
    import sheaf_blender
    for package in ("export", "scene"):
        folder = os.path.join(os.path.dirname(sheaf_blender.__file__), package)
        for found in pkgutil.iter_modules([folder]):
            name = f"{package}.{found.name}"
            if name not in NOT_REACHED and (not CHOSEN or name in CHOSEN):
                yield name, importlib.import_module(f"sheaf_blender.{name}")


def functions(module):
    """[(name, function)] of a module's own functions and methods, but for closures."""
    found = [(name, one) for name, one in vars(module).items()]
    for name, one in list(found):
        if isinstance(one, type) and one.__module__ == module.__name__:
            found += [(f"{name}.{part}", getattr(value, "fget", getattr(value, "__func__", value)))
                      for part, value in vars(one).items()]
    return [(name, one) for name, one in found
            if isinstance(one, types.FunctionType) and one.__module__ == module.__name__
            and not one.__code__.co_freevars and one.__code__.co_filename == module.__file__]


def reached_by(scene):
    """The code objects that one export runs."""
    found = set()
    sys.setprofile(lambda frame, event, _: found.add(frame.f_code) if event == "call" else None)
    try:
        exported(scene)
    finally:
        sys.setprofile(None)
    return found


def exported(scene):
    """(text, lines of the report, or None and why there is no frame)."""
    from sheaf_blender import operators
    shutil.rmtree(os.environ["SHEAF_TEST_CONTENT"], ignore_errors=True)
    path = os.path.join(FOLDER, "planted.pbrt")
    try:
        found = operators.export_frames(scene, path, [scene.frame_current])
    except RuntimeError as error:
        return None, [str(error)]
    with open(path, encoding="utf-8") as file:
        return file.read(), found[0].report.lines()


def operator_fails():
    """The message of a button for an exception; "" if there is none."""
    from sheaf_blender import jobs, operators
    saved = operators._farm, jobs.check_farm, operators.stereo_options
    operators._farm = lambda _: ("sheaf", "", False)
    jobs.check_farm, operators.stereo_options = lambda *_: None, planted
    try:
        bpy.ops.sheaf.submit_frames()
    except RuntimeError as error:
        return str(error)
    finally:
        operators._farm, jobs.check_farm, operators.stereo_options = saved
    return ""


def main():
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    builder = scenes.Builder(FOLDER)
    everything(builder)
    in_blender.use_sheaf(builder.scene, 16)
    exported(builder.scene)  # Reads the world once.
    whole, run = exported(builder.scene), reached_by(builder.scene)
    counts, failed = dict.fromkeys(("named", "frame", "unseen"), 0), []
    for module, found in modules():
        reached = 0
        for name, function in functions(found):
            label, code = f"{module}.{name}", function.__code__
            if code not in run:
                continue
            function.__code__ = planted.__code__
            try:
                text, lines = exported(builder.scene)
            finally:
                function.__code__ = code
            said = any("planted" in line for line in lines)
            reached += said
            if text is None:
                counts["frame"] += 1
                if not said or not (label.startswith(FRAME) or name.endswith(".__init__")):
                    failed.append(f"{label}: {lines}")
            elif said:
                counts["named"] += 1
            else:
                counts["unseen"] += 1
                if text != whole[0]:
                    failed.append(f"{label}: the scene differs without a word: " + next(
                        f"{a[:150]} / {b[:150]}" for a, b in zip(
                            text.splitlines() + ["-"], whole[0].splitlines() + [""]) if a != b))
        if not reached:
            failed.append(f"{module}: no function of it is reached")
    if not operator_fails().startswith("Error: Sheaf: planted (ArithmeticError"):
        failed.append(f"Submit Frames: {operator_fails()}")
    print(f"{counts['named']} exceptions are lines of the report, {counts['frame']} are the "
          f"message of their frame, {counts['unseen']} have no effect")
    for line in failed:
        print("  FAILED:", line)
    if failed:
        sys.exit(1)
    print("PLANTED_OK")


if __name__ == "__main__":
    main()
