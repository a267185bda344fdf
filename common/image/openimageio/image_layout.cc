// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/image_layout.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/image/image_limits.h"

namespace sheaf {
namespace {

constexpr std::string_view kExr = "openexr";
// Formats that are read in bands of rows.
constexpr std::string_view kReadByRows[] = {kExr, "tiff", "png", "jpeg", "hdr", "pnm", "bmp"};
constexpr size_t kNamesShown = 8;

absl::Status CheckSizes(const std::string& path, std::string_view format,
                        const OIIO::ImageSpec& spec, int64_t side_max) {
  if (spec.depth > 1 || spec.deep) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not a flat image (", spec.width, " x ",
                                                   spec.height, " x ", spec.depth,
                                                   spec.deep ? ", deep)" : ")"));
  }
  ImageClaim claim;
  claim.width = spec.width;
  claim.height = spec.height;
  claim.channels = spec.nchannels;
  if (spec.tile_width > 0) {
    claim.tile_pixels = int64_t{spec.tile_width} * std::max(spec.tile_height, 1);
  }
  claim.is_read_whole = std::ranges::find(kReadByRows, format) == std::end(kReadByRows);
  if (absl::Status status = CheckImageClaim(path, claim, side_max); !status.ok()) return status;
  if (format != kExr) return absl::OkStatus();
  claim.width = spec.full_width;
  claim.height = spec.full_height;
  return CheckImageClaim(path, claim, side_max);
}

// The names by which EXR files call a channel.
int PlaceOf(const std::vector<std::string>& names, const std::string& layer, const char* letter,
            const char* word) {
  for (size_t i = 0; i < names.size(); ++i) {
    for (const char* name : {letter, word}) {
      if (absl::EqualsIgnoreCase(names[i], layer + name)) return static_cast<int>(i);
    }
  }
  return -1;
}

// None if the layer, or the file as a whole where it is empty, has no red, green or blue.
std::optional<std::vector<int>> ColorsOf(const std::vector<std::string>& names,
                                         const std::string& layer) {
  std::vector<int> places{PlaceOf(names, layer, "R", "red"), PlaceOf(names, layer, "G", "green"),
                          PlaceOf(names, layer, "B", "blue")};
  if (*std::ranges::min_element(places) < 0) return std::nullopt;
  if (const int alpha = PlaceOf(names, layer, "A", "alpha"); alpha >= 0) places.push_back(alpha);
  return places;
}

// The channels of gray, or of red, green, blue and alpha; empty if none have this meaning.
std::vector<int> PlacesByName(const std::vector<std::string>& names) {
  if (auto colors = ColorsOf(names, "")) return *std::move(colors);
  std::set<std::string> layers;
  for (const std::string& name : names) {
    const size_t dot = name.rfind('.');
    if (dot != std::string::npos && ColorsOf(names, name.substr(0, dot + 1))) {
      layers.insert(name.substr(0, dot + 1));
    }
  }
  if (layers.size() == 1) return *ColorsOf(names, *layers.begin());
  if (names.size() == 1) return {0};
  const int gray = PlaceOf(names, "", "Y", "luminance");
  const bool has_chroma = PlaceOf(names, "", "RY", "BY") >= 0;
  return gray >= 0 && !has_chroma && layers.empty() ? std::vector<int>{gray} : std::vector<int>{};
}

std::vector<int> PlacesInOrder(int count) {
  if (count < 3) return {0};
  return count == 3 ? std::vector<int>{0, 1, 2} : std::vector<int>{0, 1, 2, 3};
}

absl::Status NoColors(const std::string& path, std::vector<std::string> names) {
  const size_t more = names.size() - std::min(names.size(), kNamesShown);
  names.resize(names.size() - more);
  return absl::InvalidArgumentError(absl::StrCat(
      path, ": its channels are ", absl::StrJoin(names, ", "),
      more > 0 ? absl::StrCat(" and ", more, " others") : "",
      ", but an image has R, G and B, or Y; write those that are meant to a file of their own"));
}

}  // namespace

absl::StatusOr<ImageLayout> LayoutOf(const std::string& path, std::string_view format,
                                     const OIIO::ImageSpec& spec, int64_t side_max) {
  if (absl::Status status = CheckSizes(path, format, spec, side_max); !status.ok()) return status;
  const bool is_exr = format == kExr;
  const std::vector<int> places =
      is_exr ? PlacesByName(spec.channelnames) : PlacesInOrder(spec.nchannels);
  if (places.empty()) return NoColors(path, spec.channelnames);
  ImageLayout layout;
  layout.channels = static_cast<int>(places.size());
  std::ranges::copy(places, layout.place.begin());
  layout.is_integer = !spec.format.is_floating_point();
  std::array<float, 8> xy{};
  if (layout.channels >= 3 &&
      spec.getattribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), xy.data())) {
    layout.chromaticities = xy;
  }
  layout.width = is_exr ? spec.full_width : spec.width;
  layout.height = is_exr ? spec.full_height : spec.height;
  layout.origin_x = is_exr ? spec.full_x : spec.x;
  layout.origin_y = is_exr ? spec.full_y : spec.y;
  const auto within = [](int64_t stored, int origin, int size) {
    return static_cast<int>(std::clamp<int64_t>(stored - origin, 0, size));
  };
  layout.x0 = within(spec.x, layout.origin_x, layout.width);
  layout.y0 = within(spec.y, layout.origin_y, layout.height);
  layout.x1 = within(int64_t{spec.x} + spec.width, layout.origin_x, layout.width);
  layout.y1 = within(int64_t{spec.y} + spec.height, layout.origin_y, layout.height);
  if (layout.x0 >= layout.x1 || layout.y0 >= layout.y1) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": stores no pixel of its display window; write it with its data window within"));
  }
  return layout;
}

}  // namespace sheaf
