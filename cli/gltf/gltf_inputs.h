// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GltfInputs: the inputs of a glTF scene in addition to its file: the view (GltfView) that flags
// describe, and the environment as an equal-area map.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/usd/usd_scene.h"
#include "common/base/mutex.h"
#include "common/scene/derived_files.h"
#include "common/scene/file_source.h"
#include "common/scene/film_size.h"
#include "common/scene/gltf/gltf_view.h"

namespace sheaf::cli {

// The flags for glTF scenes; pbrt-v4 scenes contain all of this.
struct GltfArguments {
  std::string camera, animation;  // Names; empty: the file's first.
  std::string right_camera;       // The right eye's; `camera` is the left one's. Empty: one eye.
  // Path of an equirectangular image, or GltfView::kNoEnvironment. Empty: that of
  // common/scene/gltf/surrounding/surrounding.h if the file has no lights.
  std::string environment;
  double fps = 24;       // Frame N is at (N - 1) / fps seconds.
  double shutter = 0.5;  // How long it is open, in frames.

  static constexpr double kFpsMax = 10000;
  bool AreDefault() const { return *this == GltfArguments(); }
  friend bool operator==(const GltfArguments&, const GltfArguments&) = default;
};

// size: by the camera if it is not in pixels.
GltfView ViewOf(const GltfArguments& arguments, const FilmSize& size, int32_t frame_number);

// The bytes of a PFM image that is the equal-area map (common of pbrt-v4) of an equirectangular one
// whose center is the direction +x, its right +z and its top +y, as in three.js and Blender's glTF
// exporter. turned: its rotation and scale; the rest is unused. Errors: those of ReadImage;
// kInvalidArgument if it is not twice as wide as high.
absl::StatusOr<std::string> EqualAreaEnvironment(const std::string& path,
                                                 const UsdEnvironment& turned = {});

// Thread safety: members may be called concurrently.
class GltfInputs {
 public:
  GltfInputs(GltfArguments arguments, const FilmSize& size)
      : arguments_(std::move(arguments)), size_(size), derived_(std::make_shared<DerivedFiles>()) {}

  const FilmSize& size() const { return size_; }
  // The folder of the files; removed with the last owner.
  const std::shared_ptr<DerivedFiles>& derived() const { return derived_; }
  // Adds view and environment to the files of a glTF scene; a no-op for other scenes.
  // Errors: kInvalidArgument for flags that another scene cannot have; EqualAreaEnvironment's.
  absl::Status Add(const std::string& main_file, int32_t frame_number, FileSource* files);
  // Converts a USD scene, once for all frames, and adds it as the file `main_file`; call before
  // Add. Its environment is used unless the arguments have one. Returns the converter's notes.
  // Errors: ConvertUsd's; EqualAreaEnvironment's.
  absl::StatusOr<std::vector<std::string>> AddUsd(const std::string& path,
                                                  const std::string& main_file, FileSource* files);

 private:
  const GltfArguments arguments_;
  const FilmSize size_;
  const std::shared_ptr<DerivedFiles> derived_;
  Mutex mutex_;
  std::optional<absl::StatusOr<std::string>> environment_ ABSL_GUARDED_BY(mutex_);
  // By path.
  std::map<std::string, absl::StatusOr<UsdScene>> usd_scenes_ ABSL_GUARDED_BY(mutex_);
  // Those of USD scenes, by their main_file.
  std::map<std::string, absl::StatusOr<std::string>> usd_environments_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::cli
