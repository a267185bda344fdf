// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeasureCosts: the costs from which PlanStudy sizes a study, measured on a few tiles and light
// passes.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "cli/study/study_ladder.h"
#include "cli/study/study_plan.h"
#include "cli/study/study_scenes.h"

namespace sheaf::cli {

// base: the settings as given; its smaller frame is replaced. Errors: as RenderTilePass,
// RenderLightPass and CompileScene.
absl::StatusOr<StudyCosts> MeasureCosts(double minutes, int threads,
                                        const std::vector<StudySetting>& ladder,
                                        StudyScenes* scenes, StudyScene* base);

}  // namespace sheaf::cli
