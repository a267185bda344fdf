// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_limits.h"

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

bool IsWithin(int64_t value, int64_t limit) { return value >= 1 && value <= limit; }

}  // namespace

absl::Status CheckImageClaim(const std::string& path, const ImageClaim& claim, int64_t side_max) {
  const auto beyond = [&](int64_t limit, const char* of) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": its header claims ", claim.width, " x ", claim.height, " pixels of ",
                     claim.channels, " channels", claim.tile_pixels == 1 ? "" : " in tiles of ",
                     claim.tile_pixels == 1 ? "" : absl::StrCat(claim.tile_pixels, " pixels"),
                     ", but ", limit, " ", of, " are the most; make it smaller"));
  };
  if (!IsWithin(claim.width, side_max) || !IsWithin(claim.height, side_max)) {
    return beyond(side_max, "columns and rows");
  }
  // No product overflows: each factor is within its limit.
  if (!IsWithin(claim.channels, kImageChannelsMax)) return beyond(kImageChannelsMax, "channels");
  if (!IsWithin(claim.width * claim.height, kImagePixelsMax)) {
    return beyond(kImagePixelsMax, "pixels");
  }
  if (!IsWithin(claim.width * claim.channels, kImageRowValuesMax)) {
    return beyond(kImageRowValuesMax, "values of a row");
  }
  if (!IsWithin(claim.tile_pixels, kImageTileValuesMax) ||
      !IsWithin(claim.tile_pixels * claim.channels, kImageTileValuesMax)) {
    return beyond(kImageTileValuesMax, "values of a tile");
  }
  if (claim.is_read_whole &&
      !IsWithin(claim.width * claim.height * claim.channels, kWholeImageValuesMax)) {
    return beyond(kWholeImageValuesMax, "values of an image in its format");
  }
  return absl::OkStatus();
}

}  // namespace sheaf
