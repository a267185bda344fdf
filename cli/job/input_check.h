// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// InputChecks: finds damaged image and volume files of a scene on this machine, before they are
// uploaded. Files that the scene reader reads itself (meshes, spectra, IES tables, lenses, measured
// materials) are already checked.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <tuple>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_file.h"

namespace sheaf::cli {

// Images with more pixels are checked by their headers only, and so are those of lights, of which
// CheckScene reads the small ones; others are read whole.
inline constexpr uint64_t kWholePixelsMax = uint64_t{1} << 20;
// Likewise, larger files of volumes.
inline constexpr uint64_t kWholeVolumeBytesMax = uint64_t{16} << 20;

// Thread safety: without a VolumeReader, Check may be called concurrently; each file is read once.
class InputChecks {
 public:
  // volumes: reads the files of volumes, and outlives the object; null: they are closed afterwards.
  explicit InputChecks(VolumeReader* volumes = nullptr) : volumes_(volumes) {}
  // Errors: kInvalidArgument for all files that cannot be read, one per line, each with the place
  // in the scene that names it and its use.
  absl::Status Check(const SceneDescription& scene, FileSource& files);

 private:
  // A path, the grid that is read of a volume file, and whether a light reads the file.
  using Use = std::tuple<std::string, std::string, bool>;
  absl::Status Once(const Use& use, const std::function<absl::Status()>& read);

  VolumeReader* const volumes_;
  Mutex mutex_;
  std::map<Use, absl::Status> known_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::cli
