// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/lease_token.h"

#include "absl/strings/str_cat.h"
#include "common/base/secret.h"

namespace sheaf::coordinator {

std::string LeaseTokens::Make(const LeasedWork& work) const {
  const PixelRect& tile = work.tile;
  // The identity comes last and the digest is hexadecimal, so no two works have the same text.
  return HmacSha256(
      secret_, absl::StrCat("sheaf-lease 1\n", work.lease_id, " ", std::string(work.frame_digest),
                            " ", tile.x0, " ", tile.y0, " ", tile.x1, " ", tile.y1, " ",
                            work.block.first, " ", work.block.count, " ", work.cells.size_px, " ",
                            work.cells.mask, work.kind == TaskKind::kCamera ? "" : " ",
                            work.kind == TaskKind::kCamera ? "" : TaskKindName(work.kind), "\n",
                            std::string(work.identity)));
}

bool LeaseTokens::IsValid(const LeasedWork& work, std::string_view token) const {
  return EqualSecrets(Make(work), token);
}

}  // namespace sheaf::coordinator
