# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The properties of Blender that do not change Cycles' image: names, the interface, other engines,
sampling without bias. With settings_table.py, each property of these types is in one list.
"""

COMMON = frozenset("""
animation_data asset_data cycles eevee id_type is_editable is_embedded_data is_evaluated
is_library_indirect is_missing is_runtime_data library library_weak_reference name name_full
original override_library preview rna_type session_uid sheaf tag use_extra_user use_fake_user
users
""".split())

NAMES = {owner: frozenset(names.split()) for owner, names in {
    "ViewLayer": """
        active_aov active_aov_index active_layer_collection active_lightgroup
        active_lightgroup_index depsgraph freestyle_settings has_export_collections objects use_ao
        use_freestyle use_pass_cryptomatte_accurate""",
    "LayerCollection": """
        children collection hide_viewport is_visible""",
    "Object": """
        active_material active_material_index active_selection_set active_shape_key
        active_shape_key_index add_rest_position_attribute animation_visualization bound_box
        collision color constraints delta_location delta_rotation_euler delta_rotation_quaternion
        delta_scale dimensions display display_bounds_type display_type empty_display_size
        empty_display_type empty_image_depth empty_image_offset empty_image_side face_maps field
        grease_pencil_modifiers hide_probe_plane hide_probe_sphere hide_probe_volume hide_select
        hide_viewport image_user instance_faces_scale is_from_instancer is_from_set is_instancer
        lineart location lock_location lock_rotation lock_rotation_w lock_rotations_4d lock_scale
        matrix_basis matrix_local matrix_parent_inverse mode motion_path parent_bone parent_type
        parent_vertices pass_index pose pose_library rigid_body rigid_body_constraint
        rotation_axis_angle rotation_euler rotation_mode rotation_quaternion scale selection_sets
        shader_effects show_all_edges show_axis show_bounds show_empty_image_only_axis_aligned
        show_empty_image_orthographic show_empty_image_perspective show_in_front
        show_instancer_for_viewport show_name show_only_shape_key show_texture_space
        show_transparent show_wire soft_body track_axis up_axis use_camera_lock_parent
        use_dynamic_topology_sculpting use_empty_image_alpha use_grease_pencil_lights
        use_instance_faces_scale use_instance_vertices_rotation use_mesh_mirror_x
        use_mesh_mirror_y use_mesh_mirror_z use_shape_key_edit_mode use_simulation_cache
        vertex_groups""",
    "CyclesObjectSettings": """
        ao_distance dicing_rate is_caustics_caster is_caustics_receiver""",
    "PointLight": """
        constant_coefficient contact_shadow_bias contact_shadow_distance contact_shadow_thickness
        cutoff_distance diffuse_factor distance falloff_curve falloff_type linear_attenuation
        linear_coefficient quadratic_attenuation quadratic_coefficient shadow_buffer_bias
        shadow_buffer_clip_start shadow_buffer_samples shadow_buffer_size shadow_color
        shadow_filter_radius shadow_jitter_overblur shadow_maximum_resolution specular_factor
        transmission_factor use_absolute_resolution use_contact_shadow use_custom_distance
        use_shadow_jitter volume_factor""",
    "SpotLight": """
        constant_coefficient contact_shadow_bias contact_shadow_distance contact_shadow_thickness
        cutoff_distance diffuse_factor distance falloff_curve falloff_type linear_attenuation
        linear_coefficient quadratic_attenuation quadratic_coefficient shadow_buffer_bias
        shadow_buffer_clip_start shadow_buffer_samples shadow_buffer_size shadow_color
        shadow_filter_radius shadow_jitter_overblur shadow_maximum_resolution show_cone
        specular_factor transmission_factor use_absolute_resolution use_contact_shadow
        use_custom_distance use_shadow_jitter use_square volume_factor""",
    "SunLight": """
        contact_shadow_bias contact_shadow_distance contact_shadow_thickness cutoff_distance
        diffuse_factor distance shadow_buffer_bias shadow_buffer_clip_start shadow_buffer_samples
        shadow_buffer_size shadow_cascade_count shadow_cascade_exponent shadow_cascade_fade
        shadow_cascade_max_distance shadow_color shadow_filter_radius shadow_jitter_overblur
        shadow_maximum_resolution specular_factor transmission_factor use_contact_shadow
        use_custom_distance use_shadow_jitter volume_factor""",
    "AreaLight": """
        constant_coefficient contact_shadow_bias contact_shadow_distance contact_shadow_thickness
        cutoff_distance diffuse_factor distance falloff_curve falloff_type linear_attenuation
        linear_coefficient quadratic_attenuation quadratic_coefficient shadow_buffer_bias
        shadow_buffer_clip_start shadow_buffer_samples shadow_buffer_size shadow_color
        shadow_filter_radius shadow_jitter_overblur shadow_maximum_resolution specular_factor
        transmission_factor use_absolute_resolution use_contact_shadow use_custom_distance
        use_shadow_jitter volume_factor""",
    "CyclesLightSettings": """
        is_caustics_light use_multiple_importance_sampling""",
    "World": """
        cycles_visibility light_settings probe_resolution sun_angle sun_shadow_filter_radius
        sun_shadow_jitter_overblur sun_shadow_maximum_resolution sun_threshold
        use_eevee_finite_volume use_sun_shadow use_sun_shadow_jitter""",
    "CyclesWorldSettings": """
        homogeneous_volume is_caustics_light sample_map_resolution sampling_method
        volume_interpolation volume_sampling volume_step_size""",
    "CyclesVisibilitySettings": """
        shadow""",
    "Scene": """
        active_clip audio_distance_model audio_doppler_factor audio_doppler_speed audio_volume
        collection cursor cycles_curves display frame_current_final frame_end frame_float
        frame_preview_end frame_preview_start frame_start frame_step gravity grease_pencil
        grease_pencil_settings hydra is_nla_tweakmode keying_sets keying_sets_all
        lock_frame_selection_to_range objects rigidbody_world safe_areas sequence_editor
        show_keys_from_selected_only show_subframe simulation_frame_end simulation_frame_start
        sync_mode timeline_markers tool_settings transform_orientation_slots unit_settings
        use_audio use_audio_scrub use_custom_simulation_range use_gravity use_preview_range
        use_stamp_note""",
    "CyclesRenderSettings": """
        ao_bounces ao_bounces_render auto_scrambling_distance bake_type camera_cull_margin
        debug_bvh_layout debug_bvh_time_steps debug_bvh_type debug_use_compact_bvh
        debug_use_cpu_avx debug_use_cpu_avx2 debug_use_cpu_sse2 debug_use_cpu_sse3
        debug_use_cpu_sse41 debug_use_cpu_sse42 debug_use_cuda_adaptive_compile debug_use_hair_bvh
        debug_use_optix_debug debug_use_spatial_splits denoising_use_gpu device dicing_camera
        dicing_rate direct_light_sampling_type distance_cull_margin fast_gi_method feature_set
        film_transparent_roughness guiding_directional_sampling_type guiding_distribution_type
        guiding_roughness_threshold guiding_training_samples max_subdivisions min_light_bounces
        min_transparent_bounces offscreen_dicing_scale preview_adaptive_min_samples
        preview_adaptive_threshold preview_denoiser preview_denoising_input_passes
        preview_denoising_prefilter preview_denoising_quality preview_denoising_start_sample
        preview_denoising_use_gpu preview_dicing_rate preview_pause preview_samples
        preview_scrambling_distance rolling_shutter_duration sampling_pattern scrambling_distance
        shading_system surface_guiding_probability texture_limit tile_size use_auto_tile
        use_deterministic_guiding use_guiding_direct_light use_guiding_mis_weights use_light_tree
        use_preview_adaptive_sampling use_preview_denoising use_surface_guiding use_volume_guiding
        volume_guiding_probability volume_max_steps volume_preview_step_rate volume_step_rate""",
    "Camera": """
        background_images display_size passepartout_alpha show_background_images
        show_composition_center show_composition_center_diagonal show_composition_golden
        show_composition_golden_tria_a show_composition_golden_tria_b
        show_composition_harmony_tri_a show_composition_harmony_tri_b show_composition_thirds
        show_limits show_mist show_name show_passepartout show_safe_areas show_safe_center
        show_sensor""",
    "RenderSettings": """
        bake bake_bias bake_margin bake_margin_type bake_samples bake_type bake_user_scale
        compositor_device compositor_precision dither_intensity engine ffmpeg file_extension
        filepath filter_size hair_type has_multiple_engines image_settings is_movie_format
        line_thickness line_thickness_mode metadata_input preview_pixel_size sequencer_gl_preview
        simplify_child_particles simplify_gpencil simplify_gpencil_antialiasing
        simplify_gpencil_modifier simplify_gpencil_onplay simplify_gpencil_shader_fx
        simplify_gpencil_tint simplify_gpencil_view_fill simplify_subdivision stamp_background
        stamp_font_size stamp_foreground stamp_note_text use_bake_clear use_bake_lores_mesh
        use_bake_multires use_bake_selected_to_active use_bake_user_scale use_compositing
        use_file_extension use_high_quality_normals use_lock_interface use_new_cpu_compositor
        use_overwrite use_persistent_data use_placeholder use_render_cache use_sequencer
        use_sequencer_override_scene_strip use_spherical_stereo use_stamp use_stamp_camera
        use_stamp_date use_stamp_filename use_stamp_frame use_stamp_frame_range use_stamp_hostname
        use_stamp_labels use_stamp_lens use_stamp_marker use_stamp_memory use_stamp_note
        use_stamp_render_time use_stamp_scene use_stamp_sequencer_strip use_stamp_time""",
    "Image": """
        bindcode display_aspect file_format frame_duration has_data is_multiview is_stereo_3d
        render_slots resolution seam_margin stereo_3d_format use_half_precision use_view_as_render
        views_format""",
    "Material": """
        alpha_threshold blend_method grease_pencil is_grease_pencil line_color line_priority
        lineart max_vertex_displacement metallic paint_active_slot paint_clone_slot pass_index
        preview_render_type refraction_depth roughness shadow_method show_transparent_back
        specular_color specular_intensity surface_render_method texture_paint_images
        texture_paint_slots thickness_mode use_backface_culling
        use_backface_culling_lightprobe_volume use_backface_culling_shadow use_preview_world
        use_raytrace_refraction use_screen_refraction use_sss_translucency
        use_thickness_from_shadow use_transparency_overlap volume_intersection_method""",
    "CyclesMaterialSettings": """
        emission_sampling homogeneous_volume sample_as_light volume_interpolation volume_sampling
        volume_step_rate""",
    "Volume": """
        display""",
}.items()}
