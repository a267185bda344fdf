// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResumedPicture: a delivered picture as the parts that it is the sum of, so that a frame goes on
// from it where its parts are gone (docs/adr/0039).
//
//     EXR > FramePicture > ResumedPicture > FilmTile of each tile and block of [0, n)
//
// A picture has means, counts and standard errors. Means times counts are the sums, but for the
// last bits of a float. Replicates are gone: the parts have sixteen whose spread is the picture's
// standard error, half of them above the mean and half below, which half being drawn for each
// pixel. What is estimated from replicates then has the expectation that it had.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/film/frame_picture.h"

namespace sheaf {

// Keys of the metadata that a delivered picture is known again by.
inline constexpr char kFrameDigestKey[] = "frameDigest";
inline constexpr char kPictureDigestKey[] = "pictureDigest";
// "signed" where filters weigh samples otherwise than by 1: the sums cannot be told then.
inline constexpr char kSampleWeightKey[] = "sampleWeight";

// Thread safety: const members may be called concurrently.
class ResumedPicture {
 public:
  // The picture, as ReadPicture has it, of a frame that asks for these outputs in this color.
  // Errors: kInvalidArgument, which say why no frame can go on from it: it was not delivered by
  // Sheaf, its pixels were changed since, a channel is missing, a pixel has less than
  // kReplicateCount samples, sums cannot be told from what it has (signed filter weights, ids,
  // directions of unit length).
  static absl::StatusOr<ResumedPicture> Make(FramePicture picture, const FilmOutputs& outputs,
                                             const PictureColor& color);

  const FramePicture& picture() const { return picture_; }
  // Samples of each pixel of a tile, those that were not finite included. Errors: kInvalidArgument
  // where its pixels differ: the picture was rendered in tiles of another size.
  absl::StatusOr<uint64_t> SamplesOf(const PixelRect& tile) const;
  // The tile's sums over [0, SamplesOf(tile)), in aligned blocks, ascending. Always the same bits.
  // Requires: SamplesOf is OK.
  std::vector<FilmTile> PartsOf(const PixelRect& tile) const;

 private:
  struct Pixel;
  ResumedPicture(FramePicture picture, const FilmOutputs& outputs, const PictureColor& color);
  float At(size_t channel, size_t p) const;
  float CountAt(size_t p) const;
  Pixel PixelAt(int32_t x, int32_t y) const;
  void AddPixel(const Pixel& pixel, size_t to, double share_samples, FilmTile* part) const;

  FramePicture picture_;
  FilmOutputs outputs_;
  std::vector<MeanChannel> mean_channels_;
  bool color_is_srgb_ = true;
  std::vector<size_t> planes_;  // Of the picture, by channel as they are read.
  Matrix4 srgb_from_light_, srgb_from_albedo_;
};

// Aligned power-of-two blocks that cut [0, samples), ascending.
std::vector<SampleBlock> PrefixBlocks(uint64_t samples);

}  // namespace sheaf
