// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FindScene: which of the files that somebody dropped is the scene.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::cli {

inline constexpr size_t kScenesListedMax = 200;

struct SceneChoice {
  std::string path;                 // Of the scene; empty: it is to be chosen.
  std::vector<std::string> scenes;  // Then these are there, as names for `wanted`; sorted.
};

// Looks in the folder or, where it holds a single folder and nothing else, in that one, and so on.
// wanted: a name within it; empty: the only scene at the top. Where there is not just one, all are
// listed: those at the top or, if there are none, all below. Errors: kInvalidArgument: no scene, no
// such file, or one of a program whose files Sheaf does not read.
absl::StatusOr<SceneChoice> FindScene(const std::string& folder, const std::string& wanted);

}  // namespace sheaf::cli
