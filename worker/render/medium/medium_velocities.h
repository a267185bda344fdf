// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The velocities of media that move while the shutter is open, read before a scene is planned: what
// has velocities of 0 stands still, and the plan shall know.
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_grid.h"

namespace sheaf::render {

// By medium, as in SceneDescription::media; none for what stands still.
using MediumVelocities = std::vector<std::optional<VolumeGrid>>;

// Media whose velocities are all 0 are made to stand still, which is logged.
// Errors: those of the grids' files, and kInvalidArgument where a grid holds no vectors or there is
// none to choose, with the location of the medium.
absl::StatusOr<MediumVelocities> ReadMediumVelocities(FileSource& files, int thread_count,
                                                      SceneDescription* scene);

}  // namespace sheaf::render
