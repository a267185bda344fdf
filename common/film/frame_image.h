// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameImage: a developed image in memory, and its identity.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/film/film_outputs.h"
#include "common/film/image_color.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// A developed image: float32 planes, row-major over `window`.
struct FrameImage {
  PixelRect window;  // The rendered pixels (crop) in the full frame.
  int32_t frame_width_px = 0, frame_height_px = 0;
  FilmOutputs outputs;  // Not set in images read from files.
  ImageColor color;
  // Means: R G B A albedo.{R,G,B} normal.{X,Y,Z} depth.Z, then samples, stderr.{R,G,B}, nonfinite;
  // then those of MeanChannelsOf(outputs), numbers of ids and cryptomattes.
  std::vector<std::string> channel_names;
  std::vector<std::vector<float>> planes;
  std::map<std::string, std::string> metadata;    // Written as "sheaf:KEY" attributes.
  std::map<std::string, std::string> attributes;  // Written as they are: "cryptomatte/...".
  // Per IdKind: names of the ids in the image, recorded by NoteNames.
  std::array<std::set<std::string>, kIdKindCount> id_names;
  // Null if there is no such channel.
  const std::vector<float>* Find(const std::string& channel) const;
  std::vector<float>* Find(const std::string& channel);
};

// Channels of every image, and of one with outputs.
inline constexpr size_t kImageChannelCountMin = 16;
size_t ImageChannelCount(const FilmOutputs& outputs);

// An empty image with all channels for the window.
FrameImage MakeFrameImage(PixelRect window, int32_t frame_width_px, int32_t frame_height_px,
                          const FilmOutputs& outputs = {}, const ImageColor& color = {});
// The layer of a stereo image (common/film/exr/stereo_views.h) with the standard error of the
// difference of its eyes: of the left eye's value less the right eye's in the same place of its
// film. Eyes share paths, so their errors are correlated, and it does not follow from those of the
// eyes. Both halves of the image have the same values.
inline constexpr char kEyeDifferenceLayer[] = "difference.stderr";
// Adds its channels, for R, G and B, to an image of both eyes.
void AddEyeDifference(FrameImage* image);
bool HasEyeDifference(const FrameImage& image);

// Converts only the channels R, G, B to other primaries; the standard errors then no longer match
// them.
// Errors: kInvalidArgument if R, G or B is missing, or if primaries are degenerate.
absl::Status ConvertColor(const Chromaticities& to, FrameImage* image);
// SHA-256 (hex) over window, chromaticities other than sRGB's, channel names and the bits of all
// planes, channels in the order of their names: the image's identity. Metadata and storage format
// are excluded; an image in memory and the same image read back from a file, which sorts channels
// by name, have the same digest.
std::string ImageDigest(const FrameImage& image);

}  // namespace sheaf
