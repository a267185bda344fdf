// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GltfView: which image of a glTF file is made: camera, time, size and surroundings, which the
// format leaves to the viewer. Where a scene is submitted it becomes a small file beside the scene
// (GltfViewFile), so that workers see the same.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace sheaf {

struct GltfView {
  std::string camera;  // Name of a camera or of its node; empty: the first, or one of our own.
  // Likewise, for the right eye of a stereo frame; `camera` is the left one's. Empty: one eye.
  std::string right_camera = {};
  std::string animation;  // Name of an animation; empty: the first, with those that go with it.
  double time_s = 0;      // Time of the animation at which the shutter opens.
  double shutter_s = 0;   // For how long it is open.
  // Canonical name of an equal-area map of what surrounds the scene, or kNoEnvironment. Empty: that
  // of surrounding.h if the file has no lights.
  std::string environment;
  int32_t width_px = 0, height_px = 0;  // 0: by the camera's aspect ratio.

  static constexpr char kNoEnvironment[] = "none";
  static constexpr double kTimeMax = 1e6;
  static constexpr int32_t kSizePxMax = 65536;
  friend bool operator==(const GltfView&, const GltfView&) = default;
};

// Endings of the names of glTF files, in lower case.
inline constexpr const char* kGltfEndings[] = {".gltf", ".glb"};
// Whether the name has one of these endings, in letters of either case.
bool IsGltfName(const std::string& name);
// Name of the file that holds the view of a scene file.
std::string GltfViewFile(const std::string& main_file);

// Text, a line for each value that is not the default. Requires: no name holds a line break.
std::string EncodeGltfView(const GltfView& view);
// The text is untrusted. Errors: kInvalidArgument.
absl::StatusOr<GltfView> DecodeGltfView(const std::string& text);

}  // namespace sheaf
