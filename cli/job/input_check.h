// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// InputChecks: damage in the pictures and volumes that a scene names, found here and before they
// are uploaded. What the scene's reader reads itself (meshes, spectra, IES tables, lenses, measured
// materials) it has checked.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::cli {

// Pictures of more pixels are read as far as their header, others whole.
inline constexpr uint64_t kWholePixelsMax = uint64_t{1} << 20;

// Thread safety: Check may be called concurrently; each file is read once.
class InputChecks {
 public:
  // Errors: kInvalidArgument for all files that cannot be read, one a line, each with where the
  // scene names it and what for.
  absl::Status Check(const SceneDescription& scene, FileSource& files);

 private:
  absl::Status Once(const std::string& path, const std::function<absl::Status()>& read);

  std::mutex mutex_;
  std::map<std::string, absl::Status> known_;  // By path.
};

}  // namespace sheaf::cli
