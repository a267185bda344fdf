# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The properties of Blender that change Cycles' image, and the treatment of each. docs/blender.md
is generated from this table; tests/engines/blender/settings_in_blender.py compares it with
Blender. settings_without_effect.py lists the others.
"""
import dataclasses

HANDLED, REPORTED, OWN = "handled", "reported", "own"
ELSEWHERE = object()  # The code that reads the property also reports it.
EMPTY = object()      # An empty collection.


@dataclasses.dataclass(frozen=True)
class Setting:
    """A property, or several of one treatment. neutral: the value without effect; only REPORTED
    settings have one. text: of the report, and of the document.
    """
    names: str
    treatment: str
    text: str = ""
    neutral: object = ELSEWHERE


def handled(names, text=""):
    return Setting(names, HANDLED, text)


def own(names, text):
    return Setting(names, OWN, text)


def reported(names, neutral, text):
    return Setting(names, REPORTED, text, neutral)


LIGHT = (
    handled("type color energy node_tree use_nodes use_temperature temperature",
            "F12 takes the light of a negative energy away; frames of one job report it"),
    handled("shadow_soft_size", "the radius of a spot is 64 points; since Blender 4.0 it is "
            "reported: its shadows are sharp"),
    handled("spot_size spot_blend angle shape size size_y"),
    handled("spread", "a light that spreads less than a surface is 64 points"),
    reported("use_shadow", ELSEWHERE, "Cast Shadow: it casts shadows"),
    reported("use_soft_falloff", True, "Soft Falloff: its sphere is that of a lamp"),
)

TABLE = {
    "ViewLayer": (
        handled("material_override world_override", "in place of all materials, of the world"),
        handled("use_solid use_sky use_strand use_volumes use_motion_blur",
                "what is off is left out"),
        handled("samples", "in place of the scene's, if more than 0"),
        handled("layer_collection use", "by Blender's evaluation"),
        handled("use_pass_combined use_pass_z use_pass_mist use_pass_normal use_pass_position "
                "use_pass_uv use_pass_cryptomatte_object use_pass_cryptomatte_material "
                "use_pass_cryptomatte_asset", "see Passes"),
        reported("use_pass_vector use_pass_object_index use_pass_material_index use_pass_shadow "
                 "use_pass_ambient_occlusion use_pass_emit use_pass_environment "
                 "use_pass_diffuse_direct use_pass_diffuse_indirect use_pass_diffuse_color "
                 "use_pass_glossy_direct use_pass_glossy_indirect use_pass_glossy_color "
                 "use_pass_transmission_direct use_pass_transmission_indirect "
                 "use_pass_transmission_color use_pass_subsurface_direct "
                 "use_pass_subsurface_indirect use_pass_subsurface_color", ELSEWHERE,
                 "the pass is missing"),
        reported("aovs", EMPTY, "Shader AOVs: these passes are missing"),
        handled("lightgroups", "the passes Combined_NAME, but beside Kinds of Light"),
        reported("pass_cryptomatte_depth", 6, "Cryptomatte Levels: there are six"),
        reported("pass_alpha_threshold", 0.5, "Alpha Threshold: depth is that of all surfaces"),
    ),
    "CyclesRenderLayerSettings": (
        reported("pass_debug_sample_count", False, "the pass Debug Sample Count"),
        reported("use_pass_volume_direct", False, "the pass Volume Direct"),
        reported("use_pass_volume_indirect", False, "the pass Volume Indirect"),
        reported("use_pass_shadow_catcher", False, "the pass Shadow Catcher"),
        own("denoising_store_passes use_denoising", "Sheaf > Denoising Data"),
    ),
    "LayerCollection": (
        handled("exclude", "by Blender's evaluation"),
        handled("holdout", "F12 cuts its objects out of the image; frames of one job report it"),
        handled("indirect_only"),
    ),
    "Object": (
        handled("data type parent matrix_world material_slots modifiers particle_systems "
                "hide_render show_instancer_for_render instance_type instance_collection",
                "by Blender's evaluation"),
        handled("visible_camera visible_diffuse visible_glossy visible_transmission "
                "visible_volume_scatter visible_shadow"),
        handled("is_holdout", "F12 cuts it out of the image; frames of one job report it"),
        handled("is_shadow_catcher", "F12 divides images with and without the other objects; "
                "frames of one job and panoramas report it"),
        handled("lightgroup"),
        reported("light_linking", ELSEWHERE, "Light Linking: all lights light it"),
    ),
    "CyclesObjectSettings": (
        handled("use_motion_blur use_deform_motion"),
        own("motion_steps", "as many keys as the motion needs, up to 17"),
        reported("use_adaptive_subdivision", False, "Adaptive Subdivision: it has the render "
                 "levels of its modifier"),
        reported("shadow_terminator_offset", 0.0, "Shading Offset of the shadow terminator"),
        reported("shadow_terminator_geometry_offset", 0.1, "Geometry Offset of the shadow "
                 "terminator"),
        reported("use_camera_cull use_distance_cull", ELSEWHERE, "it is not culled"),
    ),
    "PointLight": LIGHT, "SpotLight": LIGHT, "SunLight": LIGHT, "AreaLight": LIGHT,
    "CyclesLightSettings": (
        reported("cast_shadow", ELSEWHERE, "Cast Shadow: it casts shadows"),
        reported("is_portal", ELSEWHERE, "a portal: the world is sampled without"),
        reported("max_bounces", 1024, "Max Bounces of a light: it lights all bounces"),
    ),
    "World": (
        handled("color node_tree use_nodes", "trees that are not a color or an environment are "
                "rendered to a map by Cycles"),
        handled("mist_settings", "the pass Mist"),
        handled("lightgroup"),
    ),
    "CyclesWorldSettings": (
        reported("max_bounces", 1024, "Max Bounces of the world: it lights all bounces"),
    ),
    "CyclesVisibilitySettings": (
        handled("camera", "F12 takes the world out of the image; frames of one job report it"),
        handled("diffuse glossy transmission scatter"),
    ),
    "Scene": (
        handled("camera world frame_current frame_subframe view_layers background_set render"),
        handled("use_nodes node_tree view_settings display_settings sequencer_colorspace_settings",
                "Blender applies them to the image"),
    ),
    "CyclesRenderSettings": (
        handled("film_exposure", "all light is scaled"),
        handled("motion_blur_position use_layer_samples"),
        own("samples seed use_animated_seed sample_offset time_limit use_adaptive_sampling "
            "adaptive_threshold adaptive_min_samples pixel_filter_type filter_width max_bounces "
            "diffuse_bounces glossy_bounces transmission_bounces transparent_max_bounces "
            "use_denoising denoiser denoising_prefilter denoising_input_passes denoising_quality "
            "use_guiding", "the panel Sheaf"),
        own("sample_clamp_direct sample_clamp_indirect blur_glossy light_sampling_threshold",
            "Sheaf clamps and blurs no light"),
        reported("volume_bounces", ELSEWHERE, "light scatters in volumes up to Sheaf's Bounces"),
        reported("caustics_reflective", True, "Reflective Caustics: they are rendered"),
        reported("caustics_refractive", True, "Refractive Caustics: they are rendered"),
        reported("film_transparent_glass", False, "Transparent Glass: glass is opaque in alpha"),
        reported("use_fast_gi", False, "Fast GI Approximation: light is traced"),
        reported("rolling_shutter_type", "NONE", "Rolling Shutter"),
        reported("texture_limit_render", "OFF", "Texture Limit: images have their full size"),
        reported("use_camera_cull", False, "Camera Culling: nothing is culled"),
        reported("use_distance_cull", False, "Distance Culling: nothing is culled"),
    ),
    "CyclesCurveRenderSettings": (
        own("shape subdivisions", "hair has round strands"),
    ),
    "Camera": (
        handled("type clip_start clip_end lens sensor_fit sensor_width sensor_height shift_x "
                "shift_y ortho_scale dof angle angle_x angle_y lens_unit stereo"),
        reported("panorama_type fisheye_fov fisheye_lens latitude_min latitude_max longitude_min "
                 "longitude_max fisheye_polynomial_k0 fisheye_polynomial_k1 "
                 "fisheye_polynomial_k2 fisheye_polynomial_k3 fisheye_polynomial_k4 "
                 "central_cylindrical_range_u_min central_cylindrical_range_u_max "
                 "central_cylindrical_range_v_min central_cylindrical_range_v_max "
                 "central_cylindrical_radius", ELSEWHERE,
                 "a panorama is a full equirectangular one"),
    ),
    "CyclesCameraSettings": (
        reported("panorama_type fisheye_fov fisheye_lens latitude_min latitude_max longitude_min "
                 "longitude_max fisheye_polynomial_k0 fisheye_polynomial_k1 "
                 "fisheye_polynomial_k2 fisheye_polynomial_k3 fisheye_polynomial_k4", ELSEWHERE,
                 "a panorama is a full equirectangular one"),
    ),
    "CameraDOFSettings": (
        handled("use_dof focus_object focus_distance aperture_fstop aperture_blades "
                "aperture_rotation"),
        reported("focus_subtarget", "", "Focus on Bone: the object's origin is in focus"),
        reported("aperture_ratio", ELSEWHERE, "Ratio of the aperture"),
    ),
    "CameraStereoData": (
        handled("convergence_mode pivot interocular_distance convergence_distance",
                "F12 renders each eye"),
        reported("use_spherical_stereo use_pole_merge pole_merge_angle_from pole_merge_angle_to",
                 ELSEWHERE, "Spherical Stereo: both eyes of a panorama are in one place"),
    ),
    "RenderSettings": (
        handled("resolution_x resolution_y resolution_percentage pixel_aspect_x pixel_aspect_y "
                "use_border border_min_x border_min_y border_max_x border_max_y "
                "use_crop_to_border", "Blender's own arithmetic, to the pixel"),
        handled("film_transparent", "F12 takes the world out of the image; frames of one job "
                "report it"),
        handled("use_motion_blur motion_blur_shutter motion_blur_position "
                "motion_blur_shutter_curve fps fps_base frame_map_old frame_map_new"),
        handled("use_multiview views stereo_views views_format use_single_layer"),
        handled("use_simplify simplify_subdivision_render simplify_child_particles_render "
                "use_simplify_normals hair_subdiv", "by Blender's evaluation"),
        reported("simplify_volumes", ELSEWHERE, "Simplify > Volume Resolution"),
        reported("use_freestyle", False, "Freestyle: no lines are drawn"),
        own("threads threads_mode", "of renders on this machine"),
    ),
    "Image": (
        handled("source filepath filepath_raw alpha_mode colorspace_settings packed_file "
                "packed_files tiles pixels is_dirty is_float depth channels size generated_type "
                "generated_width generated_height generated_color use_generated_float"),
        reported("type", ELSEWHERE, "the first layer of a file of layers"),
        reported("use_deinterlace", ELSEWHERE, "Deinterlace"),
        reported("use_multiview", ELSEWHERE, "views of an image: the first one"),
    ),
    "ImageUser": (
        handled("frame_current use_cyclic frame_duration frame_offset frame_start "
                "use_auto_refresh"),
        reported("multilayer_layer multilayer_pass multilayer_view tile", ELSEWHERE,
                 "the first layer of a file of layers"),
    ),
    "ColorManagedInputColorspaceSettings": (
        handled("name is_data", "8 bits in other spaces than sRGB and linear are reported"),
    ),
    "Material": (
        handled("node_tree use_nodes diffuse_color"),
        reported("displacement_method", ELSEWHERE, "displacement is rendered as bumps"),
        reported("use_transparent_shadow", True, "Transparent Shadows: they are transparent"),
    ),
    "CyclesMaterialSettings": (
        reported("use_transparent_shadow", True, "Transparent Shadows: they are transparent"),
        reported("displacement_method", ELSEWHERE, "displacement is rendered as bumps"),
        reported("use_bump_map_correction", True, "Bump Map Correction: Sheaf always corrects"),
    ),
    "Volume": (
        handled("filepath packed_file is_sequence frame_start frame_duration frame_offset "
                "sequence_mode grids materials render"),
        reported("velocity_grid velocity_unit velocity_scale velocity_x_grid velocity_y_grid "
                 "velocity_z_grid", ELSEWHERE, "velocities: a volume stands still"),
    ),
    "VolumeRender": (
        handled("space"),
        own("precision step_size clipping", "grids have 32 bits, and no steps"),
    ),
}


def names(owner):
    """All names of an owner in the table."""
    return {name for setting in TABLE[owner] for name in setting.names.split()}


def is_neutral(value, neutral):
    """Whether a value has no effect."""
    if neutral is EMPTY:
        return len(value) == 0
    if isinstance(neutral, float):
        return abs(value - neutral) <= 1e-5 * max(1.0, abs(neutral))
    return value == neutral


def note(owner, instance, item, report):
    """Reports the settings of an owner that have an effect in Cycles alone."""
    for setting in TABLE[owner]:
        if setting.treatment != REPORTED or setting.neutral is ELSEWHERE:
            continue
        for name in setting.names.split():
            value = getattr(instance, name, None)
            if value is not None and not is_neutral(value, setting.neutral):
                report.left_out(item, setting.text)
