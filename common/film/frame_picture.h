// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FramePicture: a developed picture in memory, and its identity.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/film/film_outputs.h"
#include "common/film/picture_color.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// A developed picture: float32 planes, row-major over `window`.
struct FramePicture {
  PixelRect window;  // The rendered pixels (crop) in the full frame.
  int32_t frame_width_px = 0, frame_height_px = 0;
  FilmOutputs outputs;  // Not of pictures that were read.
  PictureColor color;
  // Means: R G B A albedo.{R,G,B} normal.{X,Y,Z} depth.Z, then samples, stderr.{R,G,B}, nonfinite;
  // then those of MeanChannelsOf(outputs), numbers of ids and cryptomattes.
  std::vector<std::string> channel_names;
  std::vector<std::vector<float>> planes;
  std::map<std::string, std::string> metadata;    // Written as "sheaf:KEY" attributes.
  std::map<std::string, std::string> attributes;  // Written as they are: "cryptomatte/...".
  // By IdKind: of what the picture shows, as NoteNames noted.
  std::array<std::set<std::string>, kIdKindCount> id_names;
  // Null where there is no such channel.
  const std::vector<float>* Find(const std::string& channel) const;
  std::vector<float>* Find(const std::string& channel);
};

// Channels of every picture, and of one with outputs.
inline constexpr size_t kPictureChannelCountMin = 16;
size_t PictureChannelCount(const FilmOutputs& outputs);

// An empty picture of all channels for the window.
FramePicture MakeFramePicture(PixelRect window, int32_t frame_width_px, int32_t frame_height_px,
                              const FilmOutputs& outputs = {}, const PictureColor& color = {});
// Converts the channels R, G, B to other primaries; nothing else, so standard errors no longer
// belong to them then. Errors: kInvalidArgument where R, G or B is missing, or where primaries are
// degenerate.
absl::Status ConvertColor(const Chromaticities& to, FramePicture* picture);
// SHA-256 (hex) over window, chromaticities other than sRGB's, channel names and the bits of all
// planes, channels in the order of their names: the picture's identity. Metadata and the way it is
// stored do not enter; a picture in memory and the same one read back from a file, which keeps
// channels by name, have the same digest.
std::string PictureDigest(const FramePicture& picture);

}  // namespace sheaf
