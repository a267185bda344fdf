// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/packed_frame.h"

#include <cstring>

#include "absl/strings/escaping.h"
#include "absl/strings/string_view.h"
#include "common/base/check.h"
#include "common/base/digest.h"

namespace sheaf::coordinator {
namespace {

bool Same(const FrameShape& shape, const FrameSpec& spec) {
  return shape.settings == spec.settings && shape.stop == spec.stop &&
         shape.resumed == spec.resumed;
}

}  // namespace

PackedDigest::PackedDigest(const std::string& hex) {
  SHEAF_CHECK(IsSha256Hex(hex));
  const std::string bytes = BytesOfHex(hex);
  std::memcpy(bytes_.data(), bytes.data(), bytes_.size());
}

std::string PackedDigest::Hex() const {
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(bytes_.data()), bytes_.size()));
}

uint64_t PackedDigest::Hash() const {
  uint64_t hash = 0;
  std::memcpy(&hash, bytes_.data(), sizeof hash);
  return hash;
}

// Frames of one shape are adjacent.
PackedFrame::PackedFrame(const FrameSpec& spec, FrameShapes* shapes)
    : scene_(spec.scene.sha256_hex),
      frame_digest_(spec.frame_digest),
      scene_bytes_(spec.scene.size_bytes),
      frame_number_(spec.frame_number) {
  if (shapes->empty() || !Same(shapes->back(), spec)) {
    shapes->push_back({spec.settings, spec.stop, spec.resumed});
  }
  shape_ = &shapes->back();
}

FrameSpec PackedFrame::Unpack() const {
  return {.frame_number = frame_number_,
          .scene = {scene_.Hex(), scene_bytes_},
          .settings = shape_->settings,
          .stop = shape_->stop,
          .frame_digest = frame_digest_.Hex(),
          .resumed = shape_->resumed};
}

}  // namespace sheaf::coordinator
