# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The rest of the scenes: world, volumes, instances, hair, motion, depth of field, passes."""
import math
import os

import bpy
import mathutils
import numpy

Matrix = mathutils.Matrix


def world(b):
    """An environment map with a small sun and a Mapping node that turns it."""
    b.camera()
    b.plane(material=b.diffuse("Floor", (0.6, 0.6, 0.6)))
    b.sphere("Ball", (-1, 0, 1), 0.9, b.diffuse("White", (0.8, 0.8, 0.8)))
    b.sphere("Mirror", (1.2, 0, 1), 0.9, b.material("Mirror", "ShaderNodeBsdfGlossy",
                                                    Color=(0.9, 0.9, 0.9, 1), Roughness=0.05))
    v, u = numpy.mgrid[0:64, 0:128]
    u, v = (u + 0.5) / 128, (v + 0.5) / 64
    sky = numpy.stack([0.2 + 0.3 * u, 0.3 + 0.2 * v, 0.4 + 0.4 * (1 - u)], axis=-1)
    sky[(numpy.abs(u - 0.3) < 0.03) & (numpy.abs(v - 0.8) < 0.05)] = (40, 30, 20)
    image = b.image("sky", sky, is_float=True)
    tree = b.scene.world.node_tree
    texture, mapping, coordinates = (tree.nodes.new("ShaderNodeTexEnvironment"),
                                     tree.nodes.new("ShaderNodeMapping"),
                                     tree.nodes.new("ShaderNodeTexCoord"))
    texture.image = image
    mapping.inputs["Rotation"].default_value = (0.1, -0.2, 0.8)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 0.9


def volumes(b):
    """A homogeneous box of fog, and a cloud of OpenVDB."""
    b.camera()
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    fog, nodes, links, output = b.empty_material("Fog")
    shader = nodes.new("ShaderNodeVolumeScatter")
    b.fill(shader, {"Color": (0.8, 0.9, 1, 1), "Density": 0.6, "Anisotropy": 0.3})
    links.new(shader.outputs[0], output.inputs["Volume"])
    b.cube("Fog", Matrix.Translation((-1.5, 0, 1)) @ Matrix.Scale(0.9, 4), fog)

    cloud, nodes, links, output = b.empty_material("Cloud")
    shader = nodes.new("ShaderNodeVolumePrincipled")
    b.fill(shader, {"Color": (0.8, 0.6, 0.5, 1), "Density": 2.0, "Anisotropy": 0.2})
    links.new(shader.outputs[0], output.inputs["Volume"])
    path = os.path.join(b.folder, "cloud.vdb")
    data = bpy.data.volumes.new("Cloud")
    data.filepath = path
    b.add("Cloud", data, Matrix.Translation((1.5, 0, 1)), cloud)
    b.light("AREA", (0, -3, 6), (0, 0, 0), energy=500, size=2.0)
    b.background(0.3)


def instances(b):
    """Linked duplicates, a collection instance, particles, mirrored and scaled instances."""
    b.camera((0, -9, 5), (0, 0, 0), 40)
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    red = b.diffuse("Red", (0.8, 0.2, 0.2))
    ball = b.sphere("Ball", (-3, -1, 0.5), 0.5, red, 24)
    for i in range(1, 4):
        made = b.add(f"Ball copy {i}", ball.data)
        made.matrix_world = (Matrix.Translation((-3 + 1.5 * i, -1, 0.5))
                             @ Matrix.Diagonal((0.6 + 0.2 * i, 1, -1, 1)))
    group = bpy.data.collections.new("Group")
    for i in range(2):
        made = b.sphere(f"Part {i}", (0, 0, 0.4 + 0.7 * i), 0.4,
                        b.diffuse(f"Blue {i}", (0.2, 0.3 + 0.3 * i, 0.8)), 24)
        b.scene.collection.objects.unlink(made)
        group.objects.link(made)
    for i in range(5):
        made = b.add(f"Group {i}", None, Matrix.Translation((-3 + 1.4 * i, 1.5, 0))
                     @ Matrix.Rotation(0.3 * i, 4, "X"))
        made.instance_type = "COLLECTION"
        made.instance_collection = group
    emitter = b.plane(6, b.diffuse("Soil", (0.3, 0.2, 0.1)), 0.01)
    emitter.modifiers.new("Stones", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    stone = b.cube("Stone", Matrix.Translation((0, 0, -50)), b.diffuse("Stone", (0.6, 0.6, 0.3)))
    settings.count, settings.frame_start, settings.frame_end = 60, 0, 0
    settings.lifetime, settings.physics_type = 1000, "NO"
    settings.render_type, settings.instance_object = "OBJECT", stone
    settings.particle_size = 0.1
    b.light("AREA", (-3, -4, 7), (0, 0, 0), energy=700, size=2.0)
    b.background(0.3)


def hair(b):
    """Particle hair with the hair shader, and with a diffuse one."""
    b.camera((0, -6, 2), (0, 0, 0.9))
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    for i, material in enumerate((
            b.material("Hair", "ShaderNodeBsdfHairPrincipled"),
            b.diffuse("Grass", (0.3, 0.6, 0.2)))):
        head = b.sphere(f"Head {i}", (-1.2 + 2.4 * i, 0, 0.9), 0.6,
                        b.diffuse(f"Skin {i}", (0.6, 0.4, 0.3)), 24)
        head.data.materials.append(material)
        head.modifiers.new("Hair", "PARTICLE_SYSTEM")
        settings = head.particle_systems[0].settings
        settings.type, settings.count, settings.hair_length = "HAIR", 300, 0.4
        settings.material = 2
        settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.5, 0.04
        settings.use_close_tip = False
        settings.render_step = 3
    b.scene.cycles_curves.shape = "THICK"
    b.light("AREA", (-3, -4, 5), (0, 0, 0), energy=400, size=2.0)
    b.background(0.4)


def motion(b):
    """Objects and a camera that move, a mesh that deforms."""
    b.scene.render.use_motion_blur = True
    b.scene.render.motion_blur_shutter = 1.0
    camera = b.camera()
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))

    def animate(made, change, path):
        for frame in (0, 4):
            if frame:
                change(made)
            made.keyframe_insert(path, frame=frame)
        for curve in made.animation_data.action.fcurves:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"

    def shift(made):
        made.location.x += 4.0
    ball = b.sphere("Moving", (-3, 0, 0.7), 0.7, b.diffuse("Red", (0.8, 0.2, 0.1)))
    animate(ball, shift, "location")
    copy = b.add("Moving copy", ball.data, Matrix.Translation((-1, 2, 0.7)))
    animate(copy, shift, "location")

    def lengthen(made):
        made.value = 1.0
    soft = b.sphere("Soft", (2.2, 0, 0.7), 0.7, b.diffuse("Green", (0.2, 0.7, 0.2)))
    soft.shape_key_add(name="Basis")
    key = soft.shape_key_add(name="Long")
    for point in key.data:
        point.co.z *= 2.2
    key.value = 0.0
    keys = soft.data.shape_keys
    key.keyframe_insert("value", frame=0)
    lengthen(key)
    key.keyframe_insert("value", frame=4)
    for curve in keys.animation_data.action.fcurves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"

    def lift(made):
        made.location.z += 0.6
    animate(camera, lift, "location")
    b.light("AREA", (-3, -4, 6), (0, 0, 0), energy=600, size=2.0)
    b.background(0.3)
    b.scene.frame_set(2)


def lens(b):
    """Depth of field with blades, shift, a sensor that fits by height, and a cropped border."""
    camera = b.camera()
    camera.data.dof.use_dof = True
    camera.data.dof.focus_distance = 6.0
    camera.data.dof.aperture_fstop = 0.08
    camera.data.dof.aperture_blades = 5
    camera.data.dof.aperture_rotation = 0.4
    camera.data.shift_x, camera.data.shift_y = 0.1, -0.05
    camera.data.sensor_fit = "VERTICAL"
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    for i in range(5):
        b.sphere(f"Ball {i}", (-2 + i, 2.0 * i - 3, 0.5), 0.5,
                 b.diffuse(f"Color {i}", (0.2 + 0.15 * i, 0.8 - 0.15 * i, 0.4)))
    b.sphere("Spark", (1, 5, 2), 0.1, b.material("Spark", "ShaderNodeEmission", Strength=60.0))
    b.light("AREA", (-3, -4, 6), (0, 0, 0), energy=600, size=2.0)
    b.background(0.3)
    render = b.scene.render
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x = 0.125, 0.875
    render.border_min_y, render.border_max_y = 0.0, 0.875


def mattes(b):
    """An orthographic camera, text and a curve as meshes, subsurface scattering, all passes."""
    camera = b.camera()
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = 6.0
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    font = bpy.data.curves.new("Text", "FONT")
    font.body, font.extrude, font.size = "Sheaf", 0.1, 1.2
    b.add("Text", font, Matrix.Translation((-2.6, 0, 0.1)) @ Matrix.Rotation(1.3, 4, "X"),
          b.diffuse("Ink", (0.1, 0.2, 0.6)))
    b.sphere("Wax", (1.6, 0, 0.8), 0.8, b.material(
        "Wax", "ShaderNodeSubsurfaceScattering", Color=(0.8, 0.6, 0.4, 1), Scale=0.05,
        Radius=(1, 1, 1)))
    all_passes(b.scene.view_layers[0])
    b.light("AREA", (-3, -4, 6), (0, 0, 0), energy=500, size=2.0)
    b.background(0.4)


def coats(b):
    """Layers and tints of the Principled BSDF: a clear coat, sheen, brushed metal, a tinted
    reflection, half transmission; and colored glass of its own shader.
    """
    b.camera(lens=36)
    b.background(0.4, (0.8, 0.9, 1))
    b.plane(material=b.diffuse("Floor", (0.4, 0.4, 0.4)))
    is_layered = bpy.app.version >= (4, 0, 0)
    tint = (0.4, 0.6, 1.0, 1) if is_layered else 1.0
    kinds = (
        ((0.6, 0.1, 0.1), {"Coat_Weight|Clearcoat": 1.0, "Roughness": 0.6}),
        ((0.2, 0.1, 0.3), {"Sheen_Weight|Sheen": 1.0, "Specular_IOR_Level|Specular": 0.0}),
        ((0.9, 0.7, 0.4), {"Metallic": 1.0, "Roughness": 0.35, "Anisotropic": 0.8,
                           "Anisotropic_Rotation": 0.1}),
        ((0.1, 0.2, 0.6), {"Specular_Tint": tint, "Specular_IOR_Level|Specular": 0.8,
                           "Roughness": 0.3}),
        ((0.9, 0.6, 0.3), {"Transmission_Weight|Transmission": 0.5, "Roughness": 0.1}))
    for i, (color, inputs) in enumerate(kinds):
        material = b.material(f"Layers {i}", "ShaderNodeBsdfPrincipled", Base_Color=(*color, 1),
                              **inputs)
        b.sphere(f"Ball {i}", (-3.0 + 1.2 * i, 0, 0.55), 0.55, material)
    b.sphere("Glass", (3.0, 0, 0.55), 0.55, b.material(
        "Glass", "ShaderNodeBsdfGlass", Color=(0.9, 0.5, 0.5, 1), IOR=1.4, Roughness=0.0))
    b.light("AREA", (-3, -5, 6), (0, 0, 0), energy=500, size=3.0)


def layers(b):
    """A plane and two balls from straight above, one of which moves; for passes and mattes."""
    camera = b.camera((0, 0, 5), (0, 0, 0))
    camera.rotation_euler = (0, 0, 0)
    camera.data.sensor_width, camera.data.lens = 32, 40  # Four units wide at a distance of five.
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    b.sphere("Left ball", (-1, 0, 0), 0.4, b.diffuse("Red", (0.8, 0.2, 0.1)))
    moving = b.sphere("Right ball", (1, 0, 0), 0.4, b.diffuse("Blue", (0.1, 0.2, 0.8)))
    for frame, x in ((0, 0.0), (4, 2.0)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    for curve in moving.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    b.scene.frame_set(2)
    mist = b.scene.world.mist_settings
    mist.start, mist.depth, mist.falloff = 2.0, 6.0, "QUADRATIC"
    b.background(0.8)


def all_passes(layer):
    """Those that Sheaf has."""
    for name in ("z", "mist", "normal", "position", "uv", "vector", "cryptomatte_object",
                 "cryptomatte_material"):
        setattr(layer, f"use_pass_{name}", True)


def big(b):
    """10^6 triangles and 10^5 instances: for the time that an export takes."""
    b.camera((0, -60, 40), (0, 0, 0))
    edge = 708  # 708^2 quads are 1,002,528 triangles.
    y, x = numpy.mgrid[0:edge + 1, 0:edge + 1].astype(numpy.float32)
    points = numpy.stack([x / 10 - 35, y / 10 - 35, numpy.sin(x / 9) * numpy.cos(y / 7)], axis=-1)
    corner = numpy.arange(edge * (edge + 1)).reshape(edge, edge + 1)[:, :-1].reshape(-1)
    faces = numpy.stack([corner, corner + 1, corner + edge + 2, corner + edge + 1], axis=-1)
    mesh = bpy.data.meshes.new("Land")
    mesh.vertices.add((edge + 1) ** 2)
    mesh.vertices.foreach_set("co", points.reshape(-1))
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.reshape(-1).astype(numpy.int32))
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", numpy.arange(len(faces), dtype=numpy.int32) * 4)
    if bpy.app.version < (4, 0, 0):  # Later versions derive it.
        mesh.polygons.foreach_set("loop_total", numpy.full(len(faces), 4, numpy.int32))
    mesh.polygons.foreach_set("use_smooth", numpy.ones(len(faces), bool))
    mesh.update(calc_edges=True)
    layer = mesh.uv_layers.new()
    layer.data.foreach_set("uv", (points[..., :2].reshape(-1, 2)[faces.reshape(-1)] / 70)
                           .reshape(-1).astype(numpy.float32))
    b.add("Land", mesh, material=b.diffuse("Land", (0.4, 0.5, 0.3)))
    tree = b.sphere("Tree", (0, 0, -99), 0.1, b.diffuse("Tree", (0.2, 0.5, 0.2)), 8)
    places = bpy.data.meshes.new("Places")
    places.vertices.add(100_000)
    random = numpy.random.default_rng(1).uniform(-35, 35, (100_000, 3)).astype(numpy.float32)
    random[:, 2] = 1.5
    places.vertices.foreach_set("co", random.reshape(-1))
    holder = b.add("Places", places)
    holder.instance_type = "VERTS"
    tree.parent = holder
    b.light("SUN", (5, -3, 8), energy=3.0, angle=0.0)
    b.background(0.5)


def animation(b):
    """A ball that moves over four frames, for jobs of several frames."""
    b.camera()
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    ball = b.sphere("Ball", (-2, 0, 0.7), 0.7, b.diffuse("Red", (0.8, 0.2, 0.1)), 24)
    ball.keyframe_insert("location", frame=1)
    ball.location.x = math.pi / 2
    ball.keyframe_insert("location", frame=4)
    b.light("SUN", (5, -3, 8), energy=3.0, angle=0.0)
    b.background(0.5)
    b.scene.frame_start, b.scene.frame_end = 1, 4
