// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/image/channel_layers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/film/denoised_output.h"
#include "common/film/display/select_channels.h"
#include "common/film/shrink_image.h"
#include "coordinator/service/http/image/false_color.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {
namespace {

// The fraction of values beyond each end of a range.
constexpr double kChannelLeftOutFraction = 0.01;

// "albedo" of "albedo.R"; the name itself if it has no dot.
std::string LayerOfChannel(const std::string& channel) {
  return channel.substr(0, channel.rfind('.'));
}

// Layers that are shown as ImageLayers.
bool IsOfImage(const std::string& channel) {
  return channel == "R" || channel == "G" || channel == "B" || channel == "samples" ||
         absl::StartsWith(channel, "stderr.");
}

bool IsTriple(const std::vector<std::string>& names, size_t first, const char* suffixes) {
  if (first + 2 >= names.size()) return false;
  const std::string layer = LayerOfChannel(names[first]);
  for (size_t i = 0; i < 3; ++i) {
    if (names[first + i] != absl::StrCat(layer, ".", std::string(1, suffixes[i]))) return false;
  }
  return true;
}

// Cryptomattes hold ids in R and B, and their coverages in G and A; the first is the largest.
bool IsCryptomatte(const std::string& channel) { return absl::StartsWith(channel, "Crypto"); }

bool IsIdNumber(const std::string& channel) {
  for (size_t i = 0; i < kIdKindCount; ++i) {
    if (channel == IdNumberChannel(static_cast<IdKind>(i))) return true;
  }
  return false;
}

// The pixel of the image at the first corner of the square of a displayed pixel, for values whose
// mean is meaningless, and the number of pixels displayed.
struct ChannelGrid {
  int32_t factor = 1, width_px = 0, height_px = 0;
  size_t image_width_px = 0;
  size_t IndexOf(int32_t x, int32_t y) const {
    return static_cast<size_t>(y * factor) * image_width_px + static_cast<size_t>(x * factor);
  }
};

ChannelGrid ChannelGridOf(const FrameImage& image) {
  ChannelGrid grid;
  grid.factor = ShrinkFactor(image.window.Width(), image.window.Height(), kPreviewPixelCountMax);
  grid.width_px = image.window.Width() / grid.factor;
  grid.height_px = image.window.Height() / grid.factor;
  grid.image_width_px = static_cast<size_t>(image.window.Width());
  return grid;
}

// Calls shade(index) for each displayed pixel.
template <class Shade>
DisplayImage DisplayWith(const ChannelGrid& grid, const Shade& shade) {
  DisplayImage display;
  display.width_px = grid.width_px;
  display.height_px = grid.height_px;
  display.pixels.reserve(static_cast<size_t>(grid.width_px) * static_cast<size_t>(grid.height_px));
  for (int32_t y = 0; y < grid.height_px; ++y) {
    for (int32_t x = 0; x < grid.width_px; ++x) display.pixels.push_back(shade(grid.IndexOf(x, y)));
  }
  return display;
}

LayerRange ChannelRange(const std::vector<float>& plane) {
  std::vector<float> known;
  for (const float value : plane) {
    if (std::isfinite(value)) known.push_back(value);
  }
  if (known.empty()) return {};
  const auto left_out =
      static_cast<size_t>(kChannelLeftOutFraction * static_cast<double>(known.size() - 1));
  const auto at = [&known](size_t index) {
    const auto place = known.begin() + static_cast<std::ptrdiff_t>(index);
    std::nth_element(known.begin(), place, known.end());
    return double{*place};
  };
  const double low = at(left_out);
  return {low, at(known.size() - 1 - left_out)};
}

double ShareOfRange(const LayerRange& range, float value) {
  const double span = range.high - range.low;
  return span > 0 ? std::clamp((double{value} - range.low) / span, 0.0, 1.0) : 1;
}

uint8_t ShareLevel(double share) {
  // NaN becomes 0.
  return static_cast<uint8_t>(std::lround(255 * (share > 0 ? std::min(share, 1.0) : 0.0)));
}

// Neighbouring ids get different colors; 0, which is none, is gray.
// Source: the finalizer of MurmurHash3, A. Appleby, public domain.
Rgb8 ColorOfId(float id) {
  uint32_t bits = std::bit_cast<uint32_t>(id);
  if (bits == 0) return kUnknownColor;
  bits = (bits ^ bits >> 16) * 0x85ebca6bu;
  bits = (bits ^ bits >> 13) * 0xc2b2ae35u;
  bits ^= bits >> 16;
  const auto level = [bits](int shift) {
    return static_cast<uint8_t>(64 + (bits >> shift & 0xff) * 3 / 4);
  };
  return {level(0), level(8), level(16)};
}

using ThreePlanes = std::array<const std::vector<float>*, 3>;

DisplayImage DisplayDirection(const ChannelGrid& grid, const ThreePlanes& planes) {
  return DisplayWith(grid, [&](size_t i) {
    const auto level = [&](size_t c) { return ShareLevel(0.5 + 0.5 * double{(*planes[c])[i]}); };
    return Rgb8{level(0), level(1), level(2)};
  });
}

DisplayImage DisplayVector(const ChannelGrid& grid, const ThreePlanes& planes) {
  std::array<LayerRange, 3> ranges;
  for (size_t c = 0; c < 3; ++c) ranges[c] = ChannelRange(*planes[c]);
  return DisplayWith(grid, [&](size_t i) {
    const auto level = [&](size_t c) {
      return ShareLevel(ShareOfRange(ranges[c], (*planes[c])[i]));
    };
    return Rgb8{level(0), level(1), level(2)};
  });
}

DisplayImage DisplayScalar(const ChannelGrid& grid, const std::vector<float>& plane,
                           const ChosenRange& chosen) {
  const LayerRange range = chosen ? *chosen : ChannelRange(plane);
  DisplayImage display = DisplayWith(grid, [&](size_t i) {
    return std::isfinite(plane[i]) ? Viridis(ShareOfRange(range, plane[i])) : kUnknownColor;
  });
  display.range = range;
  return display;
}

}  // namespace

const char* ChannelKindName(ChannelKind kind) {
  switch (kind) {
    case ChannelKind::kColor:
      return "color";
    case ChannelKind::kDirection:
      return "direction";
    case ChannelKind::kVector:
      return "vector";
    case ChannelKind::kScalar:
      return "scalar";
    case ChannelKind::kId:
      return "id";
    case ChannelKind::kError:
      return "error";
  }
  return "";
}

std::vector<ChannelLayer> ChannelLayersOf(const FilmOutputs& outputs) {
  const std::vector<std::string> names = MakeFrameImage({0, 0, 1, 1}, 1, 1, outputs).channel_names;
  std::vector<ChannelLayer> layers;
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    if (IsOfImage(name)) continue;
    if (IsCryptomatte(name)) {
      // The others of the layer are further ids and coverages.
      if (absl::EndsWith(name, "00.R")) {
        layers.push_back({LayerOfChannel(name), ChannelKind::kId, {name}});
      }
      continue;
    }
    const bool is_color = IsTriple(names, i, "RGB");
    if (is_color || IsTriple(names, i, "XYZ")) {
      const std::string layer = LayerOfChannel(name);
      const ChannelKind vector = layer == "P" ? ChannelKind::kVector : ChannelKind::kDirection;
      const ChannelKind color =
          layer == kDenoisedErrorLayer ? ChannelKind::kError : ChannelKind::kColor;
      layers.push_back({layer, is_color ? color : vector, {name, names[i + 1], names[i + 2]}});
      i += 2;
      continue;
    }
    const std::string shown = name == "depth.Z" ? "depth" : name;
    layers.push_back({shown, IsIdNumber(name) ? ChannelKind::kId : ChannelKind::kScalar, {name}});
  }
  return layers;
}

std::vector<std::string> SourceChannels(const ChannelLayer& layer) {
  if (layer.kind != ChannelKind::kError) return layer.channels;
  std::vector<std::string> sources;
  for (const char* component : {".R", ".G", ".B"}) {
    sources.push_back(absl::StrCat(kDenoisedLayer, component));
  }
  sources.insert(sources.end(), layer.channels.begin(), layer.channels.end());
  sources.emplace_back("samples");
  return sources;
}

absl::StatusOr<DisplayImage> MakeChannelDisplay(const FrameImage& image, const ChannelLayer& layer,
                                                ImageLayer as, const ChosenRange& range) {
  const bool is_error = layer.kind == ChannelKind::kError;
  if (layer.kind == ChannelKind::kColor || is_error) {
    const ImageLayer shown = is_error ? ImageLayer::kError : as;
    const absl::StatusOr<FrameImage> sources =
        SelectChannels(image, SourceChannels(layer), ChannelsOf(shown));
    if (!sources.ok()) return sources.status();
    return MakeDisplayImage(*sources, shown, /*full_size=*/false, range);
  }
  std::vector<const std::vector<float>*> planes;
  for (const std::string& channel : layer.channels) {
    planes.push_back(image.Find(channel));
    if (planes.back() == nullptr) {
      return absl::InternalError(absl::StrCat("the image has no channel ", channel));
    }
  }
  const ChannelGrid grid = ChannelGridOf(image);
  switch (layer.kind) {
    case ChannelKind::kDirection:
      return DisplayDirection(grid, {planes[0], planes[1], planes[2]});
    case ChannelKind::kVector:
      return DisplayVector(grid, {planes[0], planes[1], planes[2]});
    case ChannelKind::kId:
      return DisplayWith(grid, [&](size_t i) { return ColorOfId((*planes[0])[i]); });
    default:
      return DisplayScalar(grid, *planes[0], range);
  }
}

}  // namespace sheaf::coordinator
