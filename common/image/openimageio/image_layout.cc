// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/image_layout.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/image/channel_names.h"
#include "common/image/image_limits.h"

namespace sheaf {
namespace {

constexpr std::string_view kExr = "openexr";
// Formats that are read in bands of rows.
constexpr std::string_view kReadByRows[] = {kExr, "tiff", "png", "jpeg", "hdr", "pnm", "bmp"};

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

std::vector<int> PlacesInOrder(int count) {
  if (count < 3) return {0};
  return count == 3 ? std::vector<int>{0, 1, 2} : std::vector<int>{0, 1, 2, 3};
}

}  // namespace

absl::StatusOr<ImageLayout> LayoutOf(const std::string& path, std::string_view format,
                                     const OIIO::ImageSpec& spec, int64_t side_max) {
  if (absl::Status status = CheckSizes(path, format, spec, side_max); !status.ok()) return status;
  const bool is_exr = format == kExr;
  const std::vector<int> places =
      is_exr ? ColorChannelsOf(spec.channelnames) : PlacesInOrder(spec.nchannels);
  if (places.empty()) return NoColorChannels(path, spec.channelnames);
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
