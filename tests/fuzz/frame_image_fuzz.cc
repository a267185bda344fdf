// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of images that a frame resumes. Accepted ones give parts
// whose numbers are finite.
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/film/exr/exr_codec.h"
#include "common/film/exr/resumed_image.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {
namespace {

constexpr int32_t kTilePx = 8;
constexpr int64_t kImageBytesMaxHere = 1 << 24;
constexpr uint64_t kSamplesMax = 1 << 20;

void CheckTile(const ResumedImage& image, const PixelRect& tile) {
  const absl::StatusOr<uint64_t> samples = image.SamplesOf(tile);
  if (!samples.ok() || *samples > kSamplesMax) return;
  uint64_t sum = 0;
  for (const FilmTile& part : image.PartsOf(tile)) {
    sum += part.block().count;
    const float* reds = part.channel(FilmChannel::kRedHi);
    SHEAF_CHECK(
        std::all_of(reds, reds + part.plane_size(), [](float v) { return !std::isnan(v); }));
  }
  SHEAF_CHECK(sum == *samples);
}

}  // namespace

SHEAF_FUZZ_TARGET(frame_image) {
  absl::StatusOr<FrameImage> image = DecodeFrameImage(bytes, kImageBytesMaxHere);
  if (!image.ok()) return;
  for (const std::vector<float>& plane : image->planes) {
    SHEAF_CHECK(static_cast<int64_t>(plane.size()) == image->window.PixelCount());
  }
  // A fuzzer finds no SHA-256: the image says the digest of what it holds.
  image->metadata[kImageDigestKey] = ImageDigest(*image);
  const PixelRect window = image->window;
  const absl::StatusOr<ResumedImage> resumed = ResumedImage::Make(*std::move(image), {}, {});
  if (!resumed.ok()) return;
  for (const PixelRect& tile : CutTiles(window, kTilePx)) CheckTile(*resumed, tile);
}

}  // namespace sheaf
