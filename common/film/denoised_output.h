// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The denoised output: an image with less noise beside the image, `denoised.{R,G,B}`, and its
// expected error, `denoisedError.{R,G,B}` (common/film/denoise). Its film also sums the guides of
// the samples of even replicates, so that the two halves of the replicates have guides of their
// own. These sums are channels of parts, but not of the image.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/film/film_outputs.h"
#include "common/film/film_tile.h"

namespace sheaf {

// The bit of FilmOutputs::aovs, beside those of Aov.
inline constexpr uint32_t kDenoisedBit = 1U << 31;
static_assert(kAovCount <= 31);

inline bool HasDenoised(const FilmOutputs& outputs) { return (outputs.aovs & kDenoisedBit) != 0; }
inline void AddDenoised(FilmOutputs* outputs) { outputs->aovs |= kDenoisedBit; }

// The guides: albedo, normal, alpha and depth.
inline constexpr std::array<const char*, 8> kGuideChannels{
    "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "A", "depth.Z"};
inline constexpr size_t kGuideCount = kGuideChannels.size();
// The same, as sums of a tile.
inline constexpr std::array<FilmChannel, kGuideCount> kGuideSums{
    FilmChannel::kAlbedoR, FilmChannel::kAlbedoG, FilmChannel::kAlbedoB, FilmChannel::kNormalX,
    FilmChannel::kNormalY, FilmChannel::kNormalZ, FilmChannel::kAlpha,   FilmChannel::kDepth};
inline std::array<float, kGuideCount> GuidesOf(const FilmSample& sample) {
  return {sample.albedo[0], sample.albedo[1], sample.albedo[2], sample.normal.x,
          sample.normal.y,  sample.normal.z,  sample.alpha,     sample.depth};
}

// The index of the first of the kGuideCount mean channels that sum guides; SIZE_MAX without.
size_t FirstGuideMean(const FilmOutputs& outputs);

// The layers of the image, each with R, G and B.
inline constexpr char kDenoisedLayer[] = "denoised";
inline constexpr char kDenoisedErrorLayer[] = "denoisedError";

}  // namespace sheaf
