# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: exports the scenes of scenes_findings.py, and checks their text and the
report. Renders nothing. Prints FINDINGS_OK.

blender -b --factory-startup --python findings_in_blender.py -- FOLDER [CASE ...]
"""
import importlib
import os
import re
import sys

import bpy
import numpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender
import scenes
import scenes_catchers
import scenes_colors
import scenes_findings
import scenes_layers
import scenes_meaning
import scenes_patterns
import scenes_rays
from sheaf_blender import engine, operators
from sheaf_blender.export.eyes import stereo_options
from sheaf_blender.export import node_values, shaders, world_bake

FOLDER, *CHOSEN = sys.argv[sys.argv.index("--") + 1:]


class Case:
    """One exported scene: its text, and the lines of its report."""

    def __init__(self, make, frames=None, both_eyes=False):
        builder = scenes.Builder(FOLDER)
        bpy.ops.preferences.addon_enable(module="sheaf_blender")
        make(builder)
        in_blender.use_sheaf(builder.scene, 16)
        self.scene = builder.scene
        pattern = os.path.join(FOLDER, make.__name__ + ".####.pbrt")
        frames = frames or [self.scene.frame_current]
        exported = operators.export_frames(self.scene, pattern, frames, both_eyes)
        check(len(exported) == len(frames), f"{len(exported)} of {len(frames)} frames are exported")
        self.texts = [open(one.path, encoding="utf-8").read() for one in exported]
        self.text = self.texts[0]
        self.lines = exported[0].report.lines()
        self.exported = exported[0]

    def says(self, pattern):
        check(any(re.search(pattern, line) for line in self.lines),
              f"the report says /{pattern}/: {self.lines}")

    def is_silent(self):
        check(not self.lines, f"nothing is reported: {self.lines}")

    def is_silent_on(self, word):
        check(not any(word in line for line in self.lines), f"{word} is not reported: {self.lines}")

    def has(self, pattern, count=None):
        found = re.findall(pattern, self.text, re.M)
        check(found if count is None else len(found) == count,
              f"/{pattern}/ stands {len(found)} times in the scene, not {count}")


def check(condition, message):
    if not condition:
        raise AssertionError(message)


def test_camera_is_in_its_medium():
    for make, name in ((scenes_findings.fog_around_camera, "Fog"),
                       (scenes_findings.camera_under_water, "Water")):
        case = Case(make)
        case.has(f'^MediumInterface "" "{name}"\nCamera .*\nMediumInterface "" ""\nWorldBegin')
        case.is_silent()


def test_camera_outside_has_no_medium():
    check("MediumInterface" not in Case(scenes_findings.volumes_of_one_name).text.split(
        "WorldBegin")[0], "a camera outside of all volumes has no medium")


def test_media_of_one_name_are_two():
    def rename(b):
        scenes_findings.volumes_of_one_name(b)
        shared = list(bpy.data.materials)
        library = "Fluid"
        for material in shared:
            if material.name.startswith("Fluid"):
                material.name = library + material.name[5:6]
    case = Case(rename)
    case.has("^MakeNamedMedium", 2)
    media = re.findall(r'"rgb sigma_s" (\[.*?\])', case.text)
    check(len(set(media)) == 2, f"two media have two colors: {media}")


def test_gas_domains_have_their_grid():
    if bpy.app.version >= (4, 0, 0):
        print("  skipped: Debian's Blender 4.3 aborts in bpy.ops.object.quick_smoke()")
        return
    case = Case(scenes_findings.smoke)
    case.is_silent()
    size = [int(n) for n in re.search(
        r'"uniformgrid".*"integer nx" (\d+) "integer ny" (\d+) "integer nz" (\d+)',
        case.text).groups()]
    densities = re.search(r'"float density" \[(.*?)\]', case.text)[1].split()
    check(len(densities) == size[0] * size[1] * size[2] > 1000, f"{len(densities)} cells: {size}")
    check(max(map(float, densities)) > 0.5, "there is smoke")
    case.has('"homogeneous"', 0)


def test_what_is_scaled_to_nothing_is_invisible():
    case = Case(scenes_findings.scaled_to_nothing)
    case.is_silent()
    for name in ("Ball", "Flat"):
        case.has(f'^Shape "plymesh" .*"string name" "{name}"', 1)
    for name in ("Zero", "Lamp"):
        check(f'"string name" "{name}"' not in case.text, f"{name} is not written")


def test_transforms_are_affine():
    case = Case(scenes_findings.rounded_parents)
    found = [list(map(float, text.split())) for text in re.findall(
        r"(?:Transform|ConcatTransform) \[(.*?)\]", case.text)]
    check(found and all(one[3::4] == [0, 0, 0, 1] for one in found), f"the last rows are: {found}")


def test_mirrored_parents_mirror_the_camera():
    case = Case(scenes_findings.mirrored_camera)
    matrix = [float(x) for x in re.search(r"^Transform \[(.*)\]", case.text, re.M)[1].split()]
    check(matrix[0] == -1 and matrix[10] < 0, f"x alone is turned around: {matrix}")


def test_uneven_motion_has_as_many_keys_as_it_needs():
    for make, least in ((scenes_findings.spin, 9), (scenes_findings.acceleration, 3)):
        case = Case(make)
        files = re.findall(r'"string filename\d*" ', next(
            line for line in case.text.splitlines()
            if line.startswith("Shape") and ('"Blade"' in line or '"Fast"' in line)))
        check(least <= len(files) <= 17, f"{make.__name__} has {len(files)} keys")
        case.is_silent()


def test_objects_without_blur_stand_still():
    case = Case(scenes_findings.blur_off)
    check("ActiveTransform" not in case.text and "filename1" not in case.text, "nothing moves")


def test_zoom_is_a_motion_of_the_camera():
    case = Case(scenes_findings.zoom)
    case.has(r"^ActiveTransform EndTime\nTransform", 1)
    case.is_silent()


def test_lights_that_move_stand_still():
    case = Case(scenes_findings.shining_mover)
    case.says('object "Lamp": its motion while the shutter is open: it shines')
    check("ActiveTransform" not in case.text, "nothing moves")


def test_keyed_values_are_those_of_the_frame():
    case = Case(scenes_findings.keyed, [1, 2, 3])
    for pattern, expected in ((r'"rgb I" \[([\d.]+)', [7.96, 39.8, 71.6]),
                              (r'"infinite" "rgb L" \[([\d.]+)', [0.1, 0.55, 1.0]),
                              (r'"rgb reflectance" \[([\d.]+) 0.2', [0.7, 0.4, 0.1]),
                              (r'screenwindow" \[-([\d.]+)', [0.6, 0.4, 0.3]),
                              (r'pixelsamples" (\d+)', [4, 4, 12])):
        found = [float(re.search(pattern, text)[1]) for text in case.texts]
        check(all(abs(a - b) < 0.01 * b for a, b in zip(found, expected)), f"{pattern}: {found}")


def test_rendered_animations_have_the_values_of_the_frame():
    """`-a` does not write keyed values back to what users edit."""
    builder = scenes.Builder(FOLDER)
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    scenes_findings.keyed(builder)
    in_blender.use_sheaf(builder.scene, 16)
    submitted = Case(scenes_findings.keyed, [1, 2, 3]).texts
    builder.scene = bpy.context.scene
    pattern = os.path.join(FOLDER, "animation.####.pbrt")
    only = engine.ExportOnly.present = engine.ExportOnly(pattern)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        engine.ExportOnly.present = None
    texts = [open(one.path, encoding="utf-8").read() for one in only.exported]
    check(texts == submitted, "an animation's scenes are those of Submit Frames")


def test_other_layers_and_eyes_are_reported_where_one_is_written():
    Case(scenes_findings.two_layers).says('view layers: "Second"')
    Case(scenes_findings.two_eyes).says('stereoscopy: the views besides "left"')


def test_submitted_scenes_have_both_eyes():
    def eyes(pivot, multiview):
        def make(b):
            scenes_findings.two_eyes(b)
            b.scene.render.use_multiview = multiview
            b.scene.camera.data.stereo.pivot = pivot
        return make

    def camera_of(case):
        return [line for line in case.text.splitlines()
                if re.match(r"\s*(Transform|LookAt|Camera)", line)][:2]

    alone = camera_of(Case(eyes("CENTER", False)))
    beside = camera_of(Case(eyes("LEFT", True), both_eyes=True))
    both = Case(eyes("CENTER", True), both_eyes=True)
    both.is_silent()
    check(alone and alone == camera_of(both), f"{alone} is between the eyes: {camera_of(both)}")
    check(beside != alone, "the pivot counts")
    stereo = both.scene.camera.data.stereo
    options = ["--samples", "16"]
    check(stereo_options(both.scene, options) == ["--stereo", "0.600000024,3"], "off-axis eyes")
    for refused in (["--aov", "uv"], ["--techniques", "camera+light"]):
        check(stereo_options(both.scene, refused) == [], f"one eye with {refused}")
    stereo.convergence_mode = "PARALLEL"
    check(stereo_options(both.scene, options) == ["--stereo", "0.600000024"], "parallel eyes")
    stereo.convergence_mode = "TOE"
    check(stereo_options(both.scene, options) == [], "turned eyes")


# (module of the export, function, the item that its failure names, or "" if the frame fails by it).
PLANTED = (
    ("meshes", "read_parts", 'object "Ball"'), ("meshes", "read_at_corners", "motion"),
    ("shaders", "read_material", 'material "Red"'),
    ("shaders.ShaderReader", "diffuse", 'material "Red"'),
    ("principled_node", "read_inputs", 'material "Clay"'), ("node_links", "source", "material"),
    ("node_values.NodeValues", "image", 'material "Painted"'),
    ("images.Images", "value", 'material "Painted"'), 
    ("images", "write_pixels", 'material "Painted"'),
    ("lights", "write_light", 'light "Point"'), ("lights", "color_of", 'light "Point"'),
    ("world", "write_world", 'world "World"'), ("world_bake", "bake", 'world "World"'),
    ("settings", "note_light", 'light "Point"'), ("settings", "_note_object", "settings"),
    ("curves", "read_particle_hair", 'object "Ball"'), ("inside_of", "is_singular", "object"),
    ("motion", "baked_files", 'object "Clay"'), ("motion", "read", "motion"),
    ("camera", "lens_parameters", "camera"), ("camera", "state", ""),
    ("scene_writer.SceneWriter", "_write_shapes", "object"),
    ("scene_writer.SceneWriter", "_written", "material"), ("collector", "motion_key", "object"),
    ("scene_export", "sphere_of", "scene"))


def everything(b):
    """A scene that uses all modules of the export."""
    ball = scenes_findings.room(b)
    scenes_meaning.painted(b, scenes_meaning.picture(b, "picture.png"))
    clay = b.sphere("Clay", (2, 0, 1), 0.5, b.material("Clay", "ShaderNodeBsdfPrincipled"))
    scenes_findings.key(clay, "location", {0: (2, 0, 1), 1: (2, 0, 1), 2: (3, 0, 1)})
    b.light("POINT", (-2, -1, 4), energy=100.0)
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings.type = "HAIR"
    ball.particle_systems[0].settings.count = 3
    scenes_findings.key(ball, "location", {0: (-1, 0, 1), 2: (1, 0, 1)})
    scenes_findings.blur(b)
    tree = b.scene.world.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexVoronoi").outputs["Color"],
                   tree.nodes["Background"].inputs["Color"])


def test_exceptions_are_lines_of_the_report_and_end_no_process():
    def fails(*_, **__):
        raise ArithmeticError("planted")
    for module, name, item in PLANTED:
        owner = importlib.import_module("sheaf_blender.export." + module.split(".")[0])
        for part in module.split(".")[1:]:
            owner = getattr(owner, part)
        before = getattr(owner, name)
        table = node_values._READERS if owner is node_values.NodeValues else shaders._SURFACES
        saved = dict(table)
        setattr(owner, name, fails)
        table.update({key: fails for key, value in saved.items() if value is before})
        try:
            case = Case(everything)
        except RuntimeError as error:  # The operator's own message; Blender runs on.
            check("planted" in str(error) and not item, f"{module}.{name}: {error}")
            continue
        finally:
            setattr(owner, name, before)
            table.update(saved)
        if item:
            case.says(f"{item}.*planted .ArithmeticError at|{item}.*planted")
            case.has("^WorldBegin", 1)


def test_add_on_without_preferences():
    """`blender --addons sheaf_blender` makes none."""
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    entry = bpy.context.preferences.addons["sheaf_blender"]
    bpy.context.preferences.addons.remove(entry)
    try:
        check(engine.preferences().http_port == 0, "they have their defaults")
    finally:
        bpy.ops.preferences.addon_enable(module="sheaf_blender")


def is_copied(name, depth, space, alpha, is_used):
    """Whether the file itself has the colors that Cycles sees."""
    if depth == "uint16" and space is None:
        return False  # Blender alone makes these linear.
    if space or alpha:
        return True
    return is_used != name.endswith(".exr")  # Alpha scales bytes late and floats early.


def test_images_of_each_kind_are_written():
    for kind in scenes_meaning.IMAGES:
        name, _, _, alpha, is_used = kind
        case = Case(scenes_meaning.image_scene(kind))
        case.is_silent()
        case.has('"texture reflectance"', 1)
        cuts = '"texture alpha"' in case.text
        check(cuts == (is_used and alpha != "NONE"), f"{kind}: alpha cuts it: {cuts}")
        case.has('"string encoding" "sRGB"', int(is_copied(*kind) and kind[2] is None
                                                 and not name.endswith(".exr")))


def test_missing_images_are_pink_and_named():
    for make, line in ((scenes_meaning.image_missing, "gone.png: the file is missing"),
                       (scenes_meaning.image_none, "Image Texture., which has no image")):
        case = Case(make)
        case.says(line)
        case.has(r'"rgb reflectance" \[1 0 1\]', 1)


def test_tiles_are_one_image():
    case = Case(scenes_meaning.image_tiles)
    case.is_silent()
    case.has('"float uscale" 0.5', 1)


def test_images_without_uv_have_one_texel():
    case = Case(scenes_meaning.image_without_uv)
    path = re.search(r'filename" "([^"]*ply)"', case.text)[1]
    with open(path, "rb") as file:
        check(b"property float u" in file.read(400), "uv are written")


def test_named_uv_maps_are_used():
    case = Case(scenes_meaning.image_of_second_uv)
    case.is_silent()
    path = re.search(r'filename" "([^"]*ply)"', case.text)[1]
    with open(path, "rb") as file:
        body = file.read().split(b"end_header\n")[1]
    uvs = numpy.frombuffer(body[:80], "<f4").reshape(4, 5)[:, 3:]
    check(sorted(map(tuple, uvs.tolist())) == [(0, 0), (0, 1), (1, 0), (1, 1)], f"uv: {uvs}")


def test_worlds_are_read_or_rendered():
    for make in (scenes_meaning.world_moved, scenes_meaning.world_of_object,
                 scenes_meaning.world_ball, scenes_meaning.world_colors,
                 scenes_meaning.world_gradient):
        case = Case(make)
        case.is_silent()
        case.has('"infinite" "string filename"', 1)


def test_worlds_light_as_other_rays_see_them():
    case = Case(scenes_meaning.world_by_camera_ray)
    case.has('"infinite" "string filename"', 1)
    case.says("Is Camera Ray: the camera sees the world that lights")
    case = Case(scenes_meaning.world_by_camera_ray_rendered)
    case.has('"infinite" "string filename"', 1)


def test_worlds_have_a_volume():
    case = Case(scenes_meaning.world_volume)
    check(not any("olume" in line for line in case.lines), f"it is not reported: {case.lines}")
    case.has('^MediumInterface "" "World"\nCamera', 1)
    case.has('^MediumInterface "World" "World"', 1)


def test_settings_of_layers_and_films():
    case = Case(scenes_meaning.layer_override)
    case.has("^MakeNamedMaterial", 1)
    check("infinite" not in Case(scenes_meaning.layer_without_sky).text, "there is no sky")
    case = Case(scenes_meaning.film_exposure)
    case.has('"float scale" 2', 1)
    case.has(r'"rgb L" \[4 4 4\]', 1)
    Case(scenes_meaning.world_hidden).says("the color includes the world")
    Case(scenes_meaning.shutter_curve).has('"float shuttershape"', 1)


def test_lamps_that_the_camera_does_not_see_are_shapes_that_block_nothing():
    for make, count in ((scenes_meaning.lamps_in_view, 3), (scenes_meaning.sun_in_view, 1)):
        case = Case(make)
        case.is_silent()
        case.has("^AreaLightSource", count)
        case.has('^Material "interface"\\nAttribute "shape" "string invisible" ."camera".', count)


def test_some_lamps_with_a_size_are_points():
    spot = ("goniometric", 64) if bpy.app.version < (4, 0) else ("spot", 1)  # Which is reported.
    for make, kind, count in ((scenes_meaning.area_spread, "goniometric", 128),
                              (scenes_meaning.spot_soft, *spot),
                              (scenes_meaning.lamp_around_all, "point", 64)):
        case = Case(make)
        case.has(f'LightSource "{kind}"', count)
        check("AreaLightSource" not in case.text, f"{make.__name__}: nothing is seen")


def test_ray_visibility_is_written():
    for make, written in (
            (scenes_rays.rays_camera, '"camera"'), (scenes_rays.rays_shadow, '"shadow"'),
            (scenes_rays.rays_diffuse, '"diffuse" "shadow"'),
            (scenes_rays.rays_glossy, '"glossy"'),
            (scenes_rays.rays_transmission, '"transmission"'),
            (scenes_rays.rays_volume, '"diffuse" "volume" "shadow"'),
            (scenes_rays.rays_indirect_only, '"camera"'),
            (scenes_layers.hidden_by_maker, '"glossy"')):
        case = Case(make)
        case.has(f'^Shape "plymesh".*"string invisible" .{written}.$', 1)
    Case(scenes_rays.rays_camera).is_silent()
    Case(scenes_rays.rays_shadow).says('object "Cube": Ray Visibility: lights and sky behind it')
    case = Case(scenes_rays.rays_world)
    case.has('^LightSource "infinite".*"string invisible" ."glossy" "transmission".', 1)
    case.is_silent_on("isibility")
    case = Case(scenes_rays.lamps_by_rays)
    case.has('^LightSource "point".*"string invisible" ."diffuse".', 1)
    case.has('^Attribute "shape" "string invisible"', 2)
    case.is_silent_on("isibility")
    check("invisible" not in Case(scenes_findings.rounded_parents).text, "nothing is hidden")


def settings_of_others(b):
    """A scene whose settings all have an effect that Sheaf does not have."""
    ball = scenes_findings.room(b)
    b.light("POINT", (4, -5, 7), energy=-300.0)
    lamp = b.light("AREA", (-4, -5, 7), energy=300.0, size=1.0, spread=1.0)
    lamp.data.cycles.max_bounces = 2
    ball.is_holdout = True
    ball.cycles.shadow_terminator_offset = 0.2
    b.scene.camera.data.dof.use_dof = True
    b.scene.camera.data.dof.aperture_ratio = 2.0
    b.scene.cycles.use_fast_gi = True
    b.scene.cycles.caustics_refractive = False
    b.scene.cycles.film_transparent_glass = True
    b.scene.view_layers[0].use_pass_diffuse_color = True
    b.scene.view_layers[0].aovs.add()
    hidden = bpy.data.collections.new("Hidden")
    b.scene.collection.children.link(hidden)
    layer = b.scene.view_layers[0].layer_collection.children["Hidden"]
    layer.holdout = True


def test_settings_without_counterpart_are_reported():
    case = Case(settings_of_others)
    for line in ("its negative power", "64 points", "Max Bounces of a light",
                 "Holdout: it is visible; F12 cuts",
                 "Shading Offset", "Ratio of the aperture", "Fast GI",
                 "Refractive Caustics", "Transparent Glass",
                 "the pass Diffuse Color", "Shader AOVs"):
        case.says(line)


def test_groups_of_lights():
    case = Case(scenes_layers.negative_in_group)
    case.has('"string lightgroup" "group1"', 2)
    case.has('"infinite".*"string lightgroup" "group2"', 1)
    case.has("lightgroup", 3)
    case.says("negative power.*F12")
    Case(scenes_layers.dark_shine).says("its negative Emission")


def test_objects_that_no_ray_sees_are_not_written():
    case = Case(scenes_layers.invisible_ones)
    case.is_silent()
    check('"Ghost"' not in case.text and '"point"' not in case.text, "they are not written")


def test_mapping_nodes_turn_the_uv():
    for make in (scenes_layers.image_turned, scenes_layers.image_turned_back):
        case = Case(make)
        case.is_silent()
        check("uscale" not in case.text, "the turn and the scale are in the mesh")
    Case(scenes_layers.images_of_two_turns).says("Rotation of a Mapping node: other textures")


def test_volumes_within_fog_are_added():
    case = Case(scenes_layers.volumes_in_fog)
    case.is_silent()
    found = {name: tuple(float(x) for x in re.search(
        f'"{name}".*"rgb sigma_s" .([0-9. e-]+)', case.text)[1].split())
        for name in ("World", "ShaderNodeVolumeAbsorption", "ShaderNodeVolumeScatter")}
    numpy.testing.assert_allclose(found["ShaderNodeVolumeAbsorption"], found["World"], rtol=1e-5)
    numpy.testing.assert_allclose(found["ShaderNodeVolumeScatter"], numpy.add(
        found["World"], (0.24, 0.09, 0.06)), rtol=1e-5)


def test_volumes_that_meet_are_reported_where_one_of_them_counts():
    Case(scenes_layers.volumes_that_meet).is_silent()
    Case(scenes_layers.volumes_that_meet_in_fog).says(
        '"Fog 0.5": its volume and that of "Fog 0.9" meet in the world')


def test_clip_planes_are_written_where_they_cut():
    case = Case(scenes_layers.clipped)
    case.is_silent_on("Clip")
    case.has('^Camera .*"float farclip" 8', 1)
    check(case.exported.has_ray_kinds, "paths begin at the camera alone")
    case = Case(scenes_layers.clipped_near)
    case.has('^Camera .*"float nearclip" 4', 1)
    for make in (scenes_layers.unclipped, scenes_layers.floor_under_camera):
        case = Case(make)
        case.is_silent()
        check("clip" not in case.text, "nothing is cut")
    Case(scenes_layers.clipped_fog).says("Clip End: volumes end there, too")


def test_limits_and_normals_that_darken_cycles_are_reported():
    Case(scenes_layers.shells).says("Cycles lets light pass 8 transparent surfaces")
    Case(scenes_layers.closed_room).is_silent()
    Case(scenes_layers.bent_normals).says("smooth normals are tilted by 5. degrees")


def test_attributes_are_colors_of_vertices():
    case = Case(scenes_colors.colors_of_vertices)
    case.is_silent()
    case.has('"bool vertexcolors" true', 9)
    case.has('"string node" "attribute"', 8)
    case = Case(scenes_colors.colors_by_nodes)
    case.is_silent()
    case.has('"string channel" "green"', 1)
    Case(scenes_colors.colors_turned).says("computed at the vertices")
    Case(scenes_colors.colors_of_two).says('all attributes but "Bytes"')
    check("vertexcolors" not in Case(scenes_findings.rounded_parents).text, "others have none")


def test_noise_of_one_and_four_dimensions():
    case = Case(scenes_patterns.patterns_line)
    case.is_silent()
    lines = scenes_patterns.known(scenes_patterns.LINES)
    case.has('"float dimensions" 1', sum("1D" in node[1].values() for node in lines))
    case.has('"string w_from" "x"', sum(node[4] in ("X", "Y") for node in lines))


def test_shadow_catchers():
    case = Case(scenes_catchers.catcher_with_hidden)
    for name in ("Plane", "Stand"):
        case.says(f'object "{name}": Shadow Catcher: it is visible')
    check(case.exported.catchers == {"Plane", "Stand"}, f"catchers: {case.exported.catchers}")


def by_angle(output):
    """A ball whose color goes by a Layer Weight with the blend 0.5."""
    def make(b):
        scenes_findings.room(b)
        tree = bpy.data.materials["Red"].node_tree
        weight, joint = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("LayerWeight", "Math"))
        joint.operation = "MULTIPLY"
        joint.inputs[1].default_value = 0.5
        tree.links.new(weight.outputs[output], joint.inputs[0])
        tree.links.new(joint.outputs[0], tree.nodes["Diffuse BSDF"].inputs["Color"])
    return make


def test_what_goes_by_the_angle_of_view_has_its_mean():
    for output, mean in (("Facing", 1 / 3), ("Fresnel", 0.16)):
        case = Case(by_angle(output))
        case.says("Layer Weight. has its mean")
        found = re.search(r'"Red".*"rgb reflectance" .([0-9.]+)', case.text)
        check(abs(float(found[1]) - mean / 2) < 0.02, f"{output}: {found[1]}")


def test_types_of_noise():
    if bpy.app.version < (4, 1, 0):
        print("  skipped: Noise has types since Blender 4.1")
        return
    case = Case(scenes_patterns.patterns_fractals)
    case.is_silent()
    for kind in ("multifractal", "hybrid", "ridged", "hetero"):
        case.has(f'"string type" "{kind}".*"float offset"')


def test_submit_frames_asks_the_farm_before_it_exports():
    from sheaf_blender import operators
    scenes_layers.unclipped(scenes.Builder(FOLDER))
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    sheaf = os.path.join(FOLDER, "sheaf")
    with open(sheaf, "w", encoding="utf-8") as file:
        file.write('#!/bin/sh\necho "$1" >> "$0.calls"\n'
                   'echo \'{"severity": "error", "message": "no coordinator answers"}\' >&2\n'
                   'exit 1\n')
    os.chmod(sheaf, 0o755)
    exported, export = [], operators.export_frames
    operators.export_frames = lambda *arguments: exported.append(arguments)
    try:
        bpy.ops.sheaf.submit_frames()
    except RuntimeError as error:
        check("no coordinator answers" in str(error), f"it says why: {error}")
    finally:
        operators.export_frames = export
        os.unlink(sheaf)
    with open(sheaf + ".calls", encoding="utf-8") as file:
        check(file.read() == "list\n" and not exported, "nothing is exported")


def test_techniques_have_names_and_descriptions():
    items = bpy.context.scene.sheaf.bl_rna.properties["techniques"].enum_items
    check(len(items) == len({item.name for item in items}), "names differ")
    for item in items:
        check("+" not in item.name and len(item.description) > 20, item.identifier)


def main():
    tests = {name[5:]: test for name, test in globals().items() if name.startswith("test_")}
    failed = 0
    world_bake.WIDTH_PX, world_bake.HEIGHT_PX, world_bake.EDGE_TEXELS = 64, 32, 16
    for name, test in tests.items():
        if CHOSEN and name not in CHOSEN:
            continue
        try:
            test()
            print(f"  ok: {name.replace('_', ' ')}", flush=True)
        except AssertionError as failure:
            failed += 1
            print(f"  FAILED: {name.replace('_', ' ')}: {failure}", flush=True)
    if failed:
        sys.exit(1)
    print("FINDINGS_OK")


if __name__ == "__main__":
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    main()
