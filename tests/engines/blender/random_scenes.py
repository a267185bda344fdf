# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Makes seeded scenes out of Blender's own lists: nodes of all shader types, linked at random, with
random values; objects of all kinds; random settings of render, camera, lights, objects, layers and
world.
"""
import random

import bpy
import mathutils

NODES_MAX = 8
OBJECTS_MAX = 7
SETTINGS_MAX = 12
# Nodes that need a file, a script or another engine.
_NODES_LEFT_OUT = {"ShaderNodeScript", "ShaderNodeTexIES", "ShaderNodeEeveeSpecular",
                   "ShaderNodeShaderToRGB", "ShaderNodeCustomGroup", "ShaderNodeTree",
                   "ShaderNodeGroup", "ShaderNodeOutputLineStyle", "ShaderNodeUVAlongStroke",
                   "ShaderNodeHoldout", "ShaderNodeTexPointDensity"}
# Settings whose random values take minutes, need other hardware, or end Blender 3.4.
_SETTINGS_LEFT_OUT = {
    "resolution_x", "resolution_y", "resolution_percentage", "engine", "filepath", "threads",
    "threads_mode", "use_freestyle", "device", "feature_set", "use_multiview", "use_simplify",
    "type", "preview_pixel_size", "use_sequencer", "use_compositing", "use_nodes", "tile_size",
    "pixel_aspect_x", "pixel_aspect_y", "hide_render", "instance_type", "display_type",
    "use_single_layer", "mode", "rotation_mode", "parent_type", "use_border", "use_lock_interface",
    "frame_map_old", "frame_map_new", "fps", "fps_base", "use_persistent_data", "frame_current",
    "hide_viewport", "use"}
_PRIMITIVES = ("cube_add", "uv_sphere_add", "ico_sphere_add", "cylinder_add", "cone_add",
               "torus_add", "monkey_add", "plane_add")


def node_types():
    """The names of Blender's shader nodes."""
    return sorted(name for name in dir(bpy.types) if name.startswith("ShaderNode")
                  and name not in _NODES_LEFT_OUT and not name.startswith("ShaderNodeOutput")
                  and name not in ("ShaderNode",))


class RandomScene:
    """Builds one scene with a builder of scenes.py."""

    def __init__(self, builder, seed):
        self.b, self.random = builder, random.Random(seed)
        self._types = node_types()

    def build(self):
        self.b.camera()
        self.b.background(self.random.uniform(0.1, 1.0))
        self.b.plane(20, self.material("Floor"))
        for _ in range(self.random.randint(1, OBJECTS_MAX)):
            self.object()
        for _ in range(self.random.randint(0, 3)):
            self.light()
        if self.random.random() < 0.5:
            self.tree(self.b.scene.world.node_tree)
        self.settings()

    # Nodes.

    def material(self, name):
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        self.tree(made.node_tree)
        return made

    def tree(self, tree):
        """Adds nodes to a tree and links sockets at random; the output keeps some shader."""
        added = []
        for _ in range(self.random.randint(1, NODES_MAX)):
            try:
                node = tree.nodes.new(self.random.choice(self._types))
            except RuntimeError:
                continue  # Not for this kind of tree.
            self.values(node)
            added.append(node)
        for node in added + list(tree.nodes):
            for socket in node.inputs:
                if self.random.random() < 0.4:
                    self.link(tree, node, socket)

    def link(self, tree, node, socket):
        sources = [output for other in tree.nodes if other != node for output in other.outputs
                   if (output.type == "SHADER") == (socket.type == "SHADER") and output.enabled]
        if sources:
            tree.links.new(self.random.choice(sources), socket)

    def values(self, node):
        for socket in node.inputs:
            value = getattr(socket, "default_value", None)
            if isinstance(value, float):
                socket.default_value = self.random.choice((0.0, 1.0, self.random.uniform(-1, 3)))
            elif value is not None and hasattr(value, "__len__") and not isinstance(value, str):
                for i in range(len(value)):
                    value[i] = self.random.uniform(0, 1)
        self.set_some(node, 3)

    def set_some(self, owner, count):
        """Sets some enumerations, switches and numbers of an owner."""
        known = [found for found in owner.bl_rna.properties
                 if found.type in ("ENUM", "BOOLEAN", "FLOAT", "INT") and not found.is_readonly
                 and found.identifier not in _SETTINGS_LEFT_OUT
                 and not found.identifier.startswith(("show_", "lock_", "is_", "bl_", "use_stamp",
                                                      "debug_", "bake", "select", "hide"))
                 and not getattr(found, "is_array", False)]
        for found in self.random.sample(known, min(count, len(known))):
            try:
                setattr(owner, found.identifier, self.value_of(found))
            except (IndexError, TypeError, ValueError, RuntimeError, AttributeError):
                pass  # Not for this owner as it is now.

    def value_of(self, found):
        if found.type == "ENUM":
            return self.random.choice([item.identifier for item in found.enum_items])
        if found.type == "BOOLEAN":
            return self.random.random() < 0.5
        low, high = max(found.soft_min, -10), min(found.soft_max, 10)
        if found.type == "INT":
            return self.random.randint(int(low), max(int(low), int(high)))
        return self.random.uniform(low, max(low, high))

    # Objects.

    def place(self, made):
        seeded = self.random
        made.location = [seeded.uniform(-2.5, 2.5), seeded.uniform(-2, 3), seeded.uniform(0, 2)]
        made.rotation_euler = [seeded.uniform(-3, 3) for _ in range(3)]
        made.scale = [seeded.choice((1, 1, 0.5, -0.7, 0, seeded.uniform(0.1, 1.5)))
                      for _ in range(3)]

    def object(self):
        kind = self.random.random()
        if kind < 0.7:
            getattr(bpy.ops.mesh, "primitive_" + self.random.choice(_PRIMITIVES))()
        elif kind < 0.8:
            bpy.ops.object.text_add()
        elif kind < 0.88:
            bpy.ops.curve.primitive_bezier_circle_add()
            bpy.context.object.data.bevel_depth = 0.1
        elif kind < 0.95:
            bpy.ops.object.metaball_add()
        else:
            bpy.ops.object.empty_add()
        made = bpy.context.object
        self.place(made)
        if made.type == "EMPTY":
            return
        for _ in range(self.random.randint(0, 2)):
            made.data.materials.append(self.random.choice(
                [None, self.material("Random"), bpy.data.materials[0]]))
        if made.type == "MESH" and self.random.random() < 0.3:
            made.modifiers.new("M", self.random.choice(("SUBSURF", "BEVEL", "MIRROR", "ARRAY",
                                                        "SOLIDIFY", "WIREFRAME", "DECIMATE")))
        if self.random.random() < 0.3:
            made.location.z += self.random.uniform(-1, 1)
            made.keyframe_insert("location", frame=0)
            made.location.x += self.random.uniform(-2, 2)
            made.keyframe_insert("location", frame=2)
        self.set_some(made, 2)
        self.set_some(made.cycles, 1)

    def light(self):
        made = self.b.light(self.random.choice(("POINT", "SUN", "SPOT", "AREA")),
                            [self.random.uniform(-4, 4), self.random.uniform(-5, 0),
                             self.random.uniform(2, 6)], energy=self.random.uniform(-20, 300))
        if made.data.type == "SUN":
            made.data.energy = self.random.uniform(0, 3)
        self.set_some(made.data, 3)
        made.data.energy = max(-50.0, min(made.data.energy, 500.0))
        if self.random.random() < 0.3:
            made.scale = mathutils.Vector([self.random.choice((0, 1, 2)) for _ in range(3)])

    # Settings.

    def settings(self):
        scene = self.b.scene
        layer = scene.view_layers[0]
        owners = [scene.render, scene.cycles, layer, layer.cycles, scene.camera.data,
                  scene.camera.data.dof, scene.world, scene.world.cycles,
                  scene.world.cycles_visibility]
        for _ in range(self.random.randint(0, SETTINGS_MAX)):
            self.set_some(self.random.choice(owners), 1)
        scene.render.use_motion_blur = self.random.random() < 0.3
        scene.camera.data.type = self.random.choice(("PERSP", "PERSP", "PERSP", "ORTHO", "PANO"))
        if self.random.random() < 0.2:
            layer.material_override = self.random.choice(list(bpy.data.materials))


class HandledScene(RandomScene):
    """A scene out of nodes that the add-on has in full: trees without circles, from constants."""

    def build(self):
        self.b.camera()
        self.b.background(self.random.uniform(0.2, 1.0), [self.random.random() for _ in range(3)])
        self.b.plane(20, self.material("Floor"))
        for i in range(self.random.randint(1, 4)):
            place = [self.random.uniform(-2.5, 2.5), self.random.uniform(-1, 3), 0.8]
            self.b.sphere(f"Ball {i}", place, self.random.uniform(0.3, 0.8),
                          self.material(f"Ball {i}"))
        self.b.light("SUN", (3, -4, 6), energy=self.random.uniform(0, 2), angle=0.0)

    def tree(self, tree):
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        for node in [node for node in tree.nodes if node != output]:
            tree.nodes.remove(node)
        self._tree = tree
        tree.links.new(self.shader(2), output.inputs["Surface"])

    def node(self, kind, links, **settings):
        made = self._tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(made, name, value)
        for socket, source in links:
            self._tree.links.new(source, made.inputs[socket])
        return made

    def shader(self, depth):
        """The output of a shader, at most white and with little light."""
        kind = self.random.random()
        if depth == 0 or kind < 0.4:
            return self.node("ShaderNodeBsdfDiffuse", [("Color", self.limited(2))]).outputs[0]
        if kind < 0.5:
            return self.node("ShaderNodeBsdfTransparent", []).outputs[0]
        if kind < 0.65:
            made = self.node("ShaderNodeEmission", [("Color", self.limited(2))])
            made.inputs["Strength"].default_value = self.random.uniform(0, 1)
            return made.outputs[0]
        if kind < 0.75:
            return self.node("ShaderNodeBsdfTranslucent", [("Color", self.limited(1))]).outputs[0]
        made = self.node("ShaderNodeMixShader", [(1, self.shader(depth - 1)),
                                                 (2, self.shader(depth - 1))])
        made.inputs[0].default_value = self.random.choice((0.0, 0.25, 0.5, 0.8, 1.0))
        return made.outputs[0]

    def limited(self, depth):
        """A color between 0.05 and 0.8: every channel by itself."""
        parts = self.node("ShaderNodeSeparateRGB", [(0, self.color(depth))])
        limits = [self.node("ShaderNodeClamp", [("Value", parts.outputs[i])]) for i in range(3)]
        for made in limits:
            made.inputs["Min"].default_value, made.inputs["Max"].default_value = 0.05, 0.8
        return self.node("ShaderNodeCombineRGB", [(i, made.outputs[0])
                                                  for i, made in enumerate(limits)]).outputs[0]

    def color(self, depth):
        if depth == 0:
            made = self.node("ShaderNodeRGB", [])
            made.outputs[0].default_value = (*(self.random.random() for _ in range(3)), 1)
            return made.outputs[0]
        first = self.color(depth - 1)
        number = lambda low, high: self.random.uniform(low, high)
        kind = self.random.choice(("mix", "gamma", "invert", "hue", "bright", "curves", "ramp",
                                   "math", "range", "blackbody"))
        if kind == "mix":
            made = self.node("ShaderNodeMixRGB", [(1, first), (2, self.color(depth - 1))],
                             use_clamp=self.random.random() < 0.5,
                             blend_type=self.random.choice((
                                 "MIX", "MULTIPLY", "ADD", "SUBTRACT", "DIFFERENCE", "DARKEN",
                                 "LIGHTEN", "SCREEN", "OVERLAY", "DIVIDE")))
            made.inputs[0].default_value = number(-0.5, 1.5)
            return made.outputs[0]
        if kind == "curves":
            made = self.node("ShaderNodeRGBCurve", [("Color", first)])
            for curve in made.mapping.curves:
                curve.points.new(number(0.2, 0.8), number(0, 1))
            made.mapping.update()
            made.inputs[0].default_value = number(0, 1)
            return made.outputs[0]
        if kind == "ramp":
            made = self.node("ShaderNodeValToRGB", [(0, first)])
            made.color_ramp.elements.new(number(0.2, 0.8)).color = (number(0, 1), 0.5, 0.2, 1)
            return made.outputs[0]
        if kind == "math":
            made = self.node("ShaderNodeMath", [(0, first)], operation=self.random.choice((
                "ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "POWER", "MINIMUM", "MAXIMUM", "SQRT",
                "ABSOLUTE", "LESS_THAN", "GREATER_THAN", "FRACT", "FLOOR", "CEIL", "ROUND",
                "EXPONENT", "SINE", "COSINE", "MODULO")), use_clamp=self.random.random() < 0.5)
            made.inputs[1].default_value = number(-1, 2)
            return made.outputs[0]
        if kind == "range":
            made = self.node("ShaderNodeMapRange", [("Value", first)],
                             clamp=self.random.random() < 0.5)
            for socket in made.inputs[1:5]:
                socket.default_value = number(-1, 2)
            return made.outputs[0]
        if kind == "blackbody":
            made = self.node("ShaderNodeBlackbody", [])
            made.inputs[0].default_value = number(500, 14000)
            return made.outputs[0]
        made = self.node({"gamma": "ShaderNodeGamma", "invert": "ShaderNodeInvert",
                          "hue": "ShaderNodeHueSaturation", "bright": "ShaderNodeBrightContrast"
                          }[kind], [("Color", first)])
        for socket in made.inputs:
            if socket.type == "VALUE":
                socket.default_value = number(0, 1) if kind != "gamma" else number(0.3, 3)
        return made.outputs[0]


def handled(seed):
    """A function that builds a HandledScene, for in_blender.py."""
    return lambda builder: HandledScene(builder, seed).build()
