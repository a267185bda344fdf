# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: draws each panel, and calls what its buttons call.

blender -b --factory-startup --python operators_in_blender.py -- SCENE sheaf SAMPLES OUTPUT FOLDER
"""
import os
import sys

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender

MANY_SAMPLES = 65536  # For a job that does not end by itself within the test.


class Layout:
    """Stands for a layout: notes the buttons, and that what they show exists."""

    def __init__(self):
        self.buttons, self.labels = set(), []

    def column(self, **_):
        return self

    row = column

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties, f"{data} has no property {name}"

    def label(self, text="", **_):
        self.labels.append(text)

    def operator(self, name, **_):
        module, _, operator = name.partition(".")
        getattr(getattr(bpy.ops, module), operator).get_rna_type()  # KeyError: there is none.
        self.buttons.add(name)


def draw(panel):
    """The buttons of a panel, drawn as Blender draws it."""
    class Drawn(panel):  # Not registered: layout is an attribute then.
        layout = Layout()
    assert panel.poll(bpy.context), panel
    if hasattr(panel, "draw_header"):
        panel.draw_header(Drawn, bpy.context)
    Drawn.column = lambda: Drawn.layout
    panel.draw(Drawn, bpy.context)
    return Drawn.layout


def refused(operator, words, **arguments):
    """An operator that fails says why."""
    try:
        operator(**arguments)
    except RuntimeError as error:
        assert words in str(error), error
        return
    raise AssertionError(f"{operator} did not fail")


def export_and_report(scene, output):
    import sheaf_blender.engine as engine
    import sheaf_blender.panels as panels
    path = output + ".pbrt"
    assert bpy.ops.sheaf.show_report() == {"FINISHED"}
    assert "Nothing was exported" in bpy.data.texts[engine.REPORT_TEXT].as_string()
    assert bpy.ops.sheaf.export_scene(filepath=path) == {"FINISHED"}
    with open(path, encoding="utf-8") as file:
        assert file.readline().startswith("# Written by Sheaf")
    scene.view_layers[0].use_pass_shadow = True  # Sheaf has no such pass.
    assert bpy.ops.sheaf.export_scene(filepath=path) == {"FINISHED"}
    assert bpy.ops.sheaf.show_report() == {"FINISHED"}
    assert "the pass Shadow (left out)" in bpy.data.texts[engine.REPORT_TEXT].as_string()
    assert any("the pass Shadow" in line for line in draw(panels.SHEAF_PT_report).labels)
    refused(bpy.ops.sheaf.export_scene, "there is no folder /nowhere/a",
            filepath="/nowhere/a/b.pbrt")


def frames(scene, output):
    own, ops = scene.sheaf, bpy.ops.sheaf
    scene.render.filepath = output
    own.samples = MANY_SAMPLES
    assert ops.submit_frames() == {"FINISHED"}
    assert own.frames_job.startswith("jobs/") and own.frames_state == "submitted"
    assert ops.refresh_frames() == {"FINISHED"}
    assert own.frames_state.startswith(("queued", "running", "pending")), own.frames_state
    assert ops.cancel_frames() == {"FINISHED"} and own.frames_state == "cancelled"
    assert ops.refresh_frames() == {"FINISHED"} and own.frames_state.startswith("cancelled")
    refused(ops.fetch_frames, "cancelled")
    own.address = "127.0.0.1:1"
    for operator in (ops.submit_frames, ops.refresh_frames, ops.cancel_frames, ops.fetch_frames):
        refused(operator, "Sheaf: ")
    own.address = ""


def main():
    name, _, samples, output, folder = sys.argv[sys.argv.index("--") + 1:][:5]
    scene = in_blender.build(name, folder)
    in_blender.use_sheaf(scene, int(samples))
    import sheaf_blender.panels as panels
    export_and_report(scene, output)
    frames(scene, output)
    scene.sheaf.where = "FARM"
    buttons = set().union(*(draw(panel).buttons for panel in panels.CLASSES))
    from sheaf_blender import operators
    assert buttons == {each.bl_idname for each in operators.CLASSES}, buttons
    print("OPERATORS_OK")


if __name__ == "__main__":
    main()
