// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of DiskKeeper that gives disk space to uploads, before their first byte.
#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/surroundings/disk_space.h"
#include "coordinator/service/farm/upkeep/disk_keeper.h"

namespace sheaf::coordinator {

uint64_t DiskKeeper::UploadRoom() const {
  const std::optional<DiskSpace> space = DiskSpaceOf(state_directory_);
  if (!space) return UINT64_MAX;  // Unknown; a write will tell.
  const uint64_t kept =
      AtMostFractionOf(*space, kFreeFractionMax, limits_.free_bytes_min) + reserve_.OwedBytes();
  return space->available_bytes - std::min(space->available_bytes, kept);
}

void DiskKeeper::MakeUploadRoom(uint64_t bytes, absl::Time now) {
  const MutexLock lock(&mutex_);
  absl::StatusOr<Stored> stored = List(now);
  if (!stored.ok()) return LogWarning(std::string(stored.status().message()));
  stored->use.claimed_bytes = bytes + claims_.Bytes() + reserve_.OwedBytes();
  const uint64_t lacking = BytesOverOf(stored->use, limits_).free_space;
  const std::vector<Removal> removals =
      DecideRemovals(std::move(stored->items), stored->use, limits_, now);
  uint64_t freed = 0;
  for (const Removal& removal : removals) freed += removal.item.size_bytes;
  if (freed < lacking) return;  // It would not fit then, either.
  RemoveAll(removals, stored->reopen_count, now);
}

absl::StatusOr<UploadClaim> DiskKeeper::ClaimUpload(const std::string& blob, uint64_t bytes,
                                                    absl::Time now) {
  const auto room = [this] { return UploadRoom(); };
  std::optional<UploadClaim> claim = claims_.Claim(blob, bytes, room);
  if (claim) return *std::move(claim);
  MakeUploadRoom(bytes, now);
  std::optional<UploadClaim> second = claims_.Claim(blob, bytes, room);
  if (second) return *std::move(second);
  const uint64_t left = UploadRoom(), claimed = claims_.Bytes();
  return absl::ResourceExhaustedError(absl::StrCat(
      "the file system of ", state_directory_, " has ", FormatBytes(left - std::min(left, claimed)),
      " free for uploads, and ", FormatBytes(bytes), " are needed; ", space_advice_));
}

}  // namespace sheaf::coordinator
