// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/policy/retention.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace sheaf::coordinator {
namespace {

bool IsOfBlobs(const KeptItem& item) {
  return item.kind == KeptKind::kBlob || item.kind == KeptKind::kUpload;
}

absl::Duration AgeMax(const KeptItem& item, const RetentionLimits& limits) {
  switch (item.kind) {
    case KeptKind::kParts:
      return std::min(limits.parts_age_max, limits.jobs_age_max);
    case KeptKind::kUpload:
      return limits.unnamed_age_max;
    case KeptKind::kBlob:
      return item.is_named ? absl::InfiniteDuration() : limits.unnamed_age_max;
    case KeptKind::kPreviews:
    case KeptKind::kJob:
      break;
  }
  return limits.jobs_age_max;
}

// Whether it may be removed for lack of space.
bool MayMakeRoom(const KeptItem& item, const RetentionLimits& limits, absl::Time now) {
  if (item.in_use || item.size_bytes == 0) return false;
  return item.kind != KeptKind::kBlob || now - item.unused_since >= limits.blob_age_min;
}

void Subtract(uint64_t bytes, uint64_t* left) { *left -= std::min(bytes, *left); }

}  // namespace

const char* KeptKindName(KeptKind kind) {
  switch (kind) {
    case KeptKind::kParts:
      return "parts";
    case KeptKind::kUpload:
      return "upload";
    case KeptKind::kBlob:
      return "blob";
    case KeptKind::kPreviews:
      return "previews";
    case KeptKind::kJob:
      return "job";
  }
  return "unknown";
}

const char* RemovalReasonText(RemovalReason reason) {
  switch (reason) {
    case RemovalReason::kAge:
      return "it is older than the limit";
    case RemovalReason::kUnnamed:
      return "no job names it";
    case RemovalReason::kLimit:
      return "the state directory is above its limit";
    case RemovalReason::kFreeSpace:
      return "the file system has too little free space";
  }
  return "unknown";
}

BytesOver BytesOverOf(const DiskUse& use, const RetentionLimits& limits) {
  BytesOver over;
  if (use.bytes > limits.bytes_max) {
    over.limit = use.bytes - (limits.bytes_max - limits.bytes_max / kRoomFraction);
  }
  const uint64_t free_min = std::min(limits.free_bytes_min, use.capacity_bytes / kFreeFractionMax);
  const uint64_t needed = free_min + use.claimed_bytes;
  if (use.free_bytes < needed) over.free_space = needed - use.free_bytes;
  return over;
}

std::vector<Removal> DecideRemovals(std::vector<KeptItem> items, const DiskUse& use,
                                    const RetentionLimits& limits, absl::Time now) {
  const auto order = [](const KeptItem& item) {
    return std::tie(item.kind, item.unused_since, item.job_id, item.blob.sha256_hex);
  };
  std::sort(items.begin(), items.end(),
            [&order](const KeptItem& a, const KeptItem& b) { return order(a) < order(b); });
  BytesOver over = BytesOverOf(use, limits);
  std::vector<Removal> removals;
  const auto remove = [&](const KeptItem& item, RemovalReason reason) {
    Subtract(item.size_bytes, &over.limit);
    Subtract(item.size_bytes, &over.free_space);
    removals.push_back({item, reason});
  };
  std::vector<KeptItem> young;
  for (KeptItem& item : items) {
    if (!item.in_use && now - item.unused_since > AgeMax(item, limits)) {
      remove(item, IsOfBlobs(item) ? RemovalReason::kUnnamed : RemovalReason::kAge);
    } else {
      young.push_back(std::move(item));
    }
  }
  for (const KeptItem& item : young) {
    if (!MayMakeRoom(item, limits, now)) continue;
    if (over.limit > 0) {
      remove(item, RemovalReason::kLimit);
    } else if (over.free_space > 0 && item.kind != KeptKind::kJob) {
      remove(item, RemovalReason::kFreeSpace);
    }
  }
  return removals;
}

}  // namespace sheaf::coordinator
