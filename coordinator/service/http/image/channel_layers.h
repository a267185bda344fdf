// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layers of an image beside its color: albedo, normals, depth, AOVs, light groups, kinds of
// paths and ids, each of one or three channels, and how each is displayed.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_outputs.h"
#include "common/film/frame_image.h"
#include "coordinator/service/http/image/image_layer.h"

namespace sheaf::coordinator {

enum class ChannelKind {
  kColor,      // Linear light or a reflectance: as ImageLayer::kImage or kLight.
  kDirection,  // A unit vector: (x + 1) / 2 as the levels of red, green and blue.
  kVector,     // Positions: each component over its range.
  kScalar,     // In false color over its range.
  kId,         // A number or hash: a color of its own for each.
  kError,      // Errors of a color: relative to it, as ImageLayer::kError.
};
// "color", "direction", "vector", "scalar", "id" or "error".
const char* ChannelKindName(ChannelKind kind);

struct ChannelLayer {
  std::string name;  // "albedo", "depth", "key".
  ChannelKind kind = ChannelKind::kScalar;
  std::vector<std::string> channels;  // One, or three.
  friend bool operator==(const ChannelLayer&, const ChannelLayer&) = default;
};

// The layers of an image with these outputs, in the order of its channels; without its color,
// errors and sample counts, which are ImageLayers.
std::vector<ChannelLayer> ChannelLayersOf(const FilmOutputs& outputs);

// The channels that MakeChannelDisplay reads: those of the layer and, for errors, the color that
// they are relative to and the numbers of samples.
std::vector<std::string> SourceChannels(const ChannelLayer& layer);

// The display of a layer, shrunk as MakeDisplayImage does. as: kImage or kLight, for colors only.
// range: of scalars and errors; none: that of the values, for scalars without the outermost
// hundredths. Errors: kInternal if the image lacks a channel; those of MakeDisplayImage.
absl::StatusOr<DisplayImage> MakeChannelDisplay(const FrameImage& image, const ChannelLayer& layer,
                                                ImageLayer as,
                                                const ChosenRange& range = std::nullopt);

}  // namespace sheaf::coordinator
