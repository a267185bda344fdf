// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The same scene without one of its effects, as plain as one would write it by hand: what that
// costs and what it gives can then be measured.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/plan/render_plan.h"

namespace sheaf::render {

struct SceneWithout {
  SceneDescription scene;
  FrameSettings settings;
  std::string how;  // "all as it is when the shutter opens"
};

// The plan of the result never has the trait.
// Errors: kUnimplemented where this scene calls for the effect in a way that nothing plainer stands
// for; of reading the scene's textures.
absl::StatusOr<SceneWithout> LeaveOut(Trait trait, const SceneDescription& scene,
                                      const FrameSettings& settings, FileSource& files);

}  // namespace sheaf::render
