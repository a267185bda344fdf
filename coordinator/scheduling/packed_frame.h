// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PackedFrame: a FrameSpec in a tenth of its memory, because a job may have a hundred thousand
// waiting frames. Digests are bytes, and frames share what most frames of a job have in common.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <deque>
#include <string>

#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// A SHA-256.
class PackedDigest {
 public:
  PackedDigest() = default;
  // Requires: IsSha256Hex.
  explicit PackedDigest(const std::string& hex);
  std::string Hex() const;
  // Well spread over all values.
  uint64_t Hash() const;
  friend auto operator<=>(const PackedDigest&, const PackedDigest&) = default;

 private:
  std::array<uint8_t, 32> bytes_{};
};

// The part that frames share.
struct FrameShape {
  FrameSettings settings;
  StopRule stop;
  BlobDigest resumed;
};
// The shapes of a job's frames. Their addresses stay.
using FrameShapes = std::deque<FrameShape>;

class PackedFrame {
 public:
  PackedFrame() = default;
  // Requires: the digests of scene and frame are SHA-256; `shapes`, to which the frame's may be
  // added, outlives this.
  PackedFrame(const FrameSpec& spec, FrameShapes* shapes);

  FrameSpec Unpack() const;
  int32_t frame_number() const { return frame_number_; }
  const FrameShape& shape() const { return *shape_; }
  const PackedDigest& scene() const { return scene_; }
  const PackedDigest& frame_digest() const { return frame_digest_; }

 private:
  PackedDigest scene_, frame_digest_;
  uint64_t scene_bytes_ = 0;
  const FrameShape* shape_ = nullptr;
  int32_t frame_number_ = 0;
};

}  // namespace sheaf::coordinator
