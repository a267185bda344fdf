// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FindScene: finds the scene among the dropped files.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::cli {

inline constexpr size_t kScenesListedMax = 200;

struct SceneChoice {
  std::string path;                 // The scene's; empty: the user must choose.
  std::vector<std::string> scenes;  // The choices, as names for `wanted`; sorted.
};

// Looks in the folder or, if it holds only a single folder, in that one, and so on. wanted: a name
// within it; empty: the only scene at the top. If there is not exactly one, lists all: those at the
// top or, if there are none, all below. Errors: kInvalidArgument: no scene, no such file, or one of
// a program whose files Sheaf does not read.
absl::StatusOr<SceneChoice> FindScene(const std::string& folder, const std::string& wanted);

}  // namespace sheaf::cli
