# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Blender's stereo cameras as `--stereo`, for scenes that are submitted: one frame has both eyes,
and the file has the camera between them, wherever their pivot is.
"""

# A frame with one of these options has one eye. docs/stereo.md.
WITHOUT_EYES = ("--aov", "--cryptomatte", "--light-groups", "--light-paths", "--light-samples",
                "--denoise", "--denoise-with", "--crop", "--resume-from")
EYE_TECHNIQUES = ("camera", "auto", "camera+sharing", "camera+sharing+views")


def stereo_options(scene, options):
    """`--stereo` of the scene's cameras; [] if there is one view, or if both are no such eyes.

    options: the others of the job.
    """
    render, camera = scene.render, scene.camera.data
    if not render.use_multiview or render.views_format != "STEREO_3D" or camera.type != "PERSP":
        return []
    eyes = [view.name for view in render.views if view.use]
    if not {"left", "right"} <= set(eyes) or render.use_border:
        return []
    stereo = camera.stereo
    if stereo.convergence_mode not in ("OFFAXIS", "PARALLEL"):
        return []
    if any(option.split("=")[0] in WITHOUT_EYES for option in options):
        return []
    if "--techniques" in options:
        if options[options.index("--techniques") + 1] not in EYE_TECHNIQUES:
            return []
    if not stereo.interocular_distance > 0:
        return []
    distances = [stereo.interocular_distance]
    if stereo.convergence_mode == "OFFAXIS":
        distances.append(stereo.convergence_distance)
    return ["--stereo", ",".join(f"{distance:.9g}" for distance in distances)]
