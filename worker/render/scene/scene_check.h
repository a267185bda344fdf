// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CheckScene: mistakes of a scene that CompileScene finds and the reader does not, for a client
// that is about to submit it. It goes the way of CompileScene, but leaves out what takes long: the
// ray tracer, displacement, texels, volume files, and large images of lights.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// Larger images of lights are not read.
inline constexpr uint64_t kCheckedImageBytesMax = uint64_t{4} << 20;

// Logs nothing. Errors: those of CompileScene.
absl::Status CheckScene(SceneDescription scene, const FrameSettings& settings, FileSource& files);

}  // namespace sheaf::render
