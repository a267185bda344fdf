// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResumedImage: converts a delivered image back to parts with the same sum, so that a frame can
// continue from it after its parts are gone (docs/adr/0039).
//
//     EXR > FrameImage > ResumedImage > FilmTile of each tile and block of [0, n)
//
// An image has means, counts and standard errors. Means times counts are the sums, except for the
// last bits of a float. Replicates are lost: the parts have sixteen whose spread is the image's
// standard error, a random half of them, drawn per pixel, above the mean and the others below.
// Estimates from replicates then keep their expectation.
//
// The image of a frame with light passes is the sum of two images, each over its own count. Its
// light layer (light_image.h) is that of the light paths, and what it leaves of the image is the
// camera's (docs/adr/0094).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/film/frame_image.h"
#include "common/film/task_kind.h"

namespace sheaf {

// Metadata keys that identify a delivered image.
inline constexpr char kFrameDigestKey[] = "frameDigest";
inline constexpr char kImageDigestKey[] = "imageDigest";
// "signed" if filters weight samples other than by 1: the sums then cannot be recovered.
inline constexpr char kSampleWeightKey[] = "sampleWeight";
// The rounding of pixels when the file was written (exr_format.h): "half", "dwaa".
inline constexpr char kRoundingKey[] = "rounding";
// "plane" if depth.Z is that from the plane of the camera; otherwise it is along the ray.
inline constexpr char kDepthKey[] = "depth";

// Thread safety: const members may be called concurrently.
class ResumedImage {
 public:
  // The image, as ReadFrameImage returns it, of a frame with these outputs in this color.
  // has_light: whether the frame has light passes. Errors: kInvalidArgument with the reason why no
  // frame can continue from it: it was not delivered by Sheaf, its pixels were changed since, a
  // channel is missing, a pixel has fewer than kReplicateCount samples, the light layer is missing
  // or contradicts the image, or sums cannot be recovered (signed filter weights, ids, directions
  // of unit length).
  static absl::StatusOr<ResumedImage> Make(FrameImage image, const FilmOutputs& outputs,
                                           const ImageColor& color, bool has_light = false);

  const FrameImage& image() const { return image_; }
  // Camera samples of each pixel of a tile, including those that were not finite.
  // Errors: kInvalidArgument if its pixels differ: the image was rendered in tiles of another size.
  absl::StatusOr<uint64_t> SamplesOf(const PixelRect& tile) const;
  // The tile's sums of camera samples over [0, SamplesOf(tile)), in aligned blocks, ascending.
  // Deterministic to the bit.
  // Requires: SamplesOf is OK.
  std::vector<FilmTile> PartsOf(const PixelRect& tile) const;
  // The number of light passes: as many as the pixel with the most camera samples has; 0 for frames
  // without them.
  uint64_t light_pass_count() const { return light_pass_count_; }
  // The light tile's sums over a block of PrefixBlocks(light_pass_count()): of the whole window.
  // Deterministic to the bit.
  FilmTile LightPartOf(const SampleBlock& block) const;

 private:
  struct Pixel;
  absl::Status FindChannels(bool has_light);
  absl::Status CheckCounts();
  ResumedImage(FrameImage image, const FilmOutputs& outputs, const ImageColor& color);
  float At(size_t channel, size_t p) const;
  // 0 without a light layer. channel: as LightLayerChannels orders them.
  float LightAt(size_t channel, size_t p) const;
  float CountAt(size_t p) const;
  // The light and its error of one kind of path, in the image's primaries.
  void SetColor(TaskKind kind, size_t p, Pixel* pixel) const;
  void SetMeans(TaskKind kind, size_t p, Pixel* pixel) const;
  Pixel PixelAt(TaskKind kind, int32_t x, int32_t y) const;
  void AddPixel(const Pixel& pixel, size_t to, double sample_count, FilmTile* part) const;

  FrameImage image_;
  FilmOutputs outputs_;
  std::vector<MeanChannel> mean_channels_;
  bool color_is_srgb_ = true;
  // Indices in the image's planes, by channel as they are read; and those of the light layer.
  std::vector<size_t> planes_, light_planes_;
  uint64_t light_pass_count_ = 0;
  Matrix4 srgb_from_light_, srgb_from_albedo_;
};

// The aligned power-of-two blocks that partition [0, samples), ascending.
std::vector<SampleBlock> PrefixBlocks(uint64_t samples);

}  // namespace sheaf
