# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: keys all inputs that can be keyed, some at a time, and exports two frames in
three ways, which have to give the same text and the same report: a rendered animation, Submit
Frames, and the values that frame_set leaves, without the keys. Inputs are the properties of all
types that Cycles reads (settings_table.py), of the panel, and those of all shader nodes. Prints
KEYED_OK.

blender -b --factory-startup --python keyed_in_blender.py -- FOLDER AT_A_TIME [OWNER ...]
"""
import os
import sys

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender
import random_scenes
import scenes
import scenes_meaning

FOLDER, AT_A_TIME, *CHOSEN = sys.argv[sys.argv.index("--") + 1:]
FRAMES = (1, 2)
# Properties that make one of the table.
_MORE = {"Object": {"location", "rotation_euler", "scale", "delta_location",
                    "delta_rotation_euler", "delta_scale", "instance_faces_scale"}}
# Blender's own render reads the number of views of an animation before the first frame's keys.
_LEFT_OUT = {"use_multiview"}
INPUTS_MIN = 500  # A walk that finds fewer has lost some.


def owners(b):
    """{type: instance} of a scene that uses all types."""
    scene, layer = b.scene, b.scene.view_layers[0]
    b.camera()
    b.background(0.5)
    picture = scenes_meaning.picture(b, "picture.png")
    scenes_meaning.painted(b, picture)
    material = next(one for one in bpy.data.materials if "Image Texture" in one.node_tree.nodes)
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    ball = b.sphere("Ball", (0, 0, 1), 1.0, b.diffuse("Red", (0.7, 0.2, 0.1)), segments=8)
    lamps = {kind: b.light(kind, (-2, -1, 4), energy=10.0).data
             for kind in ("POINT", "SPOT", "SUN", "AREA")}
    volume = bpy.data.volumes.new("Volume")
    b.add("Volume", volume)
    camera = scene.camera.data
    node = material.node_tree.nodes["Image Texture"]
    found = {
        "ViewLayer": layer, "CyclesRenderLayerSettings": layer.cycles,
        "LayerCollection": layer.layer_collection.children[0], "Object": ball,
        "CyclesObjectSettings": ball.cycles, "PointLight": lamps["POINT"],
        "SpotLight": lamps["SPOT"], "SunLight": lamps["SUN"], "AreaLight": lamps["AREA"],
        "CyclesLightSettings": lamps["AREA"].cycles, "World": scene.world,
        "CyclesWorldSettings": scene.world.cycles,
        "CyclesVisibilitySettings": scene.world.cycles_visibility, "Scene": scene,
        "CyclesRenderSettings": scene.cycles, "CyclesCurveRenderSettings": scene.cycles_curves,
        "Camera": camera, "CyclesCameraSettings": getattr(camera, "cycles", None),
        "CameraDOFSettings": camera.dof, "CameraStereoData": camera.stereo,
        "RenderSettings": scene.render, "Image": picture, "ImageUser": node.image_user,
        "ColorManagedInputColorspaceSettings": picture.colorspace_settings,
        "Material": material, "CyclesMaterialSettings": material.cycles, "Volume": volume,
        "VolumeRender": volume.render, "SheafSettings": scene.sheaf}
    return found


def node_owner(kind):
    """A function that builds a scene whose wall has a node of a type, and returns the node."""
    def make(b):
        b.camera()
        b.background(0.5)
        material, nodes, links, output = b.empty_material("Wall")
        b.plane(4, material)
        node = nodes.new(kind)
        shader = next((one for one in node.outputs if one.type == "SHADER"), None)
        if shader is None and node.outputs:
            diffuse = nodes.new("ShaderNodeBsdfDiffuse")
            links.new(node.outputs[0], diffuse.inputs["Color"])
            shader = diffuse.outputs[0]
        if shader is not None:
            links.new(shader, output.inputs["Surface"])
        return node
    return make


def two_values(instance, known):
    """Two values of a property, the present one first; None if it has one alone."""
    now = getattr(instance, known.identifier)
    if known.type == "BOOLEAN" and not known.is_array:
        return now, not now
    if known.type in ("INT", "FLOAT"):
        least, most = max(known.soft_min, -50), min(known.soft_max, 50)
        middle = least + 0.375 * (most - least)
        other = int(middle) if known.type == "INT" else middle
        if known.is_array:
            return list(now), [other + 0.125 * i for i in range(len(now))]
        return now, other if other != now else other + 1
    if known.type == "ENUM" and not known.is_enum_flag:
        for item in known.enum_items:
            if item.identifier != now:
                return now, item.identifier
    return None


def inputs_of(owner, instance):
    """[(owner, property)] of what can be keyed: properties, and values of sockets."""
    from sheaf_blender.scene import settings_table
    wanted = None
    if owner in settings_table.TABLE:
        wanted = settings_table.names(owner) | _MORE.get(owner, set())
    if isinstance(instance, bpy.types.Node):  # Not those of the editor, nor of the class.
        wanted = {known.identifier for known in instance.bl_rna.properties} - {
            known.identifier for known in bpy.types.ShaderNode.bl_rna.properties} | {"mute"}
    found = [(instance, known) for known in instance.bl_rna.properties
             if known.is_animatable and not known.is_readonly
             and (wanted is None or known.identifier in wanted)
             and known.identifier not in _LEFT_OUT]
    if isinstance(instance, bpy.types.Node):
        found += [(socket, socket.bl_rna.properties["default_value"])
                  for socket in instance.inputs if hasattr(socket, "default_value")
                  and socket.bl_rna.properties["default_value"].is_animatable]
    return found


def insert_keys(instance, known):
    """Whether the property has two keys."""
    try:
        values = two_values(instance, known)
        for frame, value in zip(FRAMES, values or ()):
            setattr(instance, known.identifier, value)
            if not instance.keyframe_insert(known.identifier, frame=frame):
                return False
    except (TypeError, RuntimeError, ValueError, AttributeError):
        return False  # Blender's own refusal.
    return values is not None


def shown(exported):
    return [(open(one.path, encoding="utf-8").read(), one.report.lines()) for one in exported]


def animation(scene):
    """The export of `-a` and Ctrl-F12."""
    from sheaf_blender import engine
    scene.frame_start, scene.frame_end = FRAMES
    only = engine.ExportOnly.present = engine.ExportOnly(os.path.join(FOLDER, "a.####.pbrt"))
    try:
        bpy.ops.render.render(animation=True)
    finally:
        engine.ExportOnly.present = None
    return shown(only.exported)


def submitted(scene, frames=FRAMES):
    from sheaf_blender import operators
    return shown(operators.export_frames(scene, os.path.join(FOLDER, "b.####.pbrt"), frames))


def still(scene):
    """The frames with the values that frame_set leaves, and no keys."""
    animated = [one.animation_data for one in bpy.data.user_map() if
                getattr(one, "animation_data", None) and one.animation_data.action]
    animated += [one.node_tree.animation_data for group in (bpy.data.materials, bpy.data.worlds)
                 for one in group if one.node_tree and one.node_tree.animation_data]
    actions = [one.action for one in animated]
    found = []
    for frame in FRAMES:
        for one, action in zip(animated, actions):
            one.action = action
        scene.frame_set(frame)
        for one in animated:
            one.action = None
        found += submitted(scene, (frame,))
    return found


class Walk:
    """Counts, and what differs."""

    def __init__(self):
        self.keyed, self.refused, self.effective, self.failed = 0, 0, 0, []

    def owner(self, name, make):
        """make: (builder) -> instance, of a scene that is made anew for some of its inputs."""
        at, count = 0, 1
        while at < count:
            builder = scenes.Builder(FOLDER)
            in_blender.use_sheaf(builder.scene, 16)
            instance = make(builder)
            inputs = inputs_of(name, instance) if instance is not None else []
            count = len(inputs)
            self.inputs(name, builder.scene, inputs[at:at + int(AT_A_TIME)])
            at += int(AT_A_TIME)

    def inputs(self, owner, scene, inputs):
        keyed = [(instance, known) for instance, known in inputs if insert_keys(instance, known)]
        self.refused += len(inputs) - len(keyed)
        self.keyed += len(keyed)
        if not keyed:
            return
        label = f"{owner}: " + ", ".join(
            f"{instance.name}.{known.identifier}" if isinstance(instance, bpy.types.NodeSocket)
            else known.identifier for instance, known in keyed)
        print(label, flush=True)  # Blender itself may crash.
        try:
            ways = [animation(scene), submitted(scene), still(scene)]
        except RuntimeError as error:
            self.failed.append(f"{label}: {error}")
            return
        self.effective += ways[0][0] != ways[0][-1]
        for way, frames in zip(("Submit Frames", "frame_set"), ways[1:]):
            if frames != ways[0]:
                self.failed.append(f"{label}: -a and {way} differ: {difference(ways[0], frames)}")


def difference(first, second):
    for one, other in zip(first, second):
        for a, b in zip(one[0].splitlines() + one[1], other[0].splitlines() + other[1]):
            if a != b:
                return f"{a[:200]} / {b[:200]}"
    return "lengths"


def main():
    bpy.ops.preferences.addon_enable(module="cycles")
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    from sheaf_blender.scene import settings_table
    walk = Walk()
    for name in [*settings_table.TABLE, "SheafSettings"]:
        if not CHOSEN or name in CHOSEN:
            walk.owner(name, lambda b, name=name: owners(b)[name])
    for kind in random_scenes.node_types():
        if not CHOSEN or kind in CHOSEN or "nodes" in CHOSEN:
            walk.owner(kind, node_owner(kind))
    print(f"{walk.keyed} inputs keyed, {AT_A_TIME} at a time; {walk.effective} of these change "
          f"the scene file; Blender refuses keys of {walk.refused}")
    if not CHOSEN and walk.keyed < INPUTS_MIN:
        walk.failed.append("too few")
    for line in walk.failed:
        print("  FAILED:", line)
    if walk.failed:
        sys.exit(1)
    print("KEYED_OK")


if __name__ == "__main__":
    main()
