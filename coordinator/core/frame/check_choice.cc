// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/check_choice.h"

#include <cstdint>

#include "absl/strings/str_cat.h"
#include "common/base/secret.h"

namespace sheaf::coordinator {

double CheckChoice::DrawOf(std::string_view frame_digest, const PixelRect& tile, SampleBlock block,
                           const TileCells& cells, TaskKind kind) const {
  const std::string mac =
      HmacSha256(secret_, absl::StrCat("sheaf-check 1\n", std::string(frame_digest), " ", tile.x0,
                                       " ", tile.y0, " ", tile.x1, " ", tile.y1, " ", block.first,
                                       " ", block.count, " ", cells.size_px, " ", cells.mask,
                                       kind == TaskKind::kCamera ? "" : " ",
                                       kind == TaskKind::kCamera ? "" : TaskKindName(kind)));
  uint64_t bits = 0;
  for (size_t i = 0; i < sizeof bits; ++i) bits = bits << 8 | static_cast<uint8_t>(mac[i]);
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

}  // namespace sheaf::coordinator
