// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReadMediumVelocities: reads the velocities of media that move while the shutter is open. Runs
// before a scene is planned, because media with zero velocities are static for the plan.
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_grid.h"

namespace sheaf::render {

// By medium, as in SceneDescription::media; none for static media.
using MediumVelocities = std::vector<std::optional<VolumeGrid>>;

// Makes media whose velocities are all 0 static, and logs that. Errors: those of the grids' files;
// kInvalidArgument, with the location of the medium, where a grid does not hold vectors or "auto"
// finds none.
absl::StatusOr<MediumVelocities> ReadMediumVelocities(FileSource& files, int thread_count,
                                                      SceneDescription* scene);

}  // namespace sheaf::render
