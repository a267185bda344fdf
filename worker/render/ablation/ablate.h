// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ablate: makes the ablated scene, the same scene without one of its effects, as one would write
// it by hand. The cost and the benefit of the effect can then be measured.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/plan/render_plan.h"

namespace sheaf::render {

struct AblatedScene {
  SceneDescription scene;
  FrameSettings settings;
  std::string how;  // "all as it is when the shutter opens"
};

// The plan of the result never has the trait. Errors: kUnimplemented if this scene uses the effect
// in a way that has no simpler replacement; those of reading the scene's textures.
absl::StatusOr<AblatedScene> Ablate(Trait trait, const SceneDescription& scene,
                                    const FrameSettings& settings, FileSource& files);

}  // namespace sheaf::render
