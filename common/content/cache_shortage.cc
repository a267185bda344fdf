// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/cache_shortage.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/cord.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf {
namespace {

constexpr char kPayload[] = "sheaf.cache_shortage";  // "NEEDED ROOM".

}  // namespace

absl::Status WithShortage(absl::Status status, const CacheShortage& shortage) {
  status.SetPayload(kPayload,
                    absl::Cord(absl::StrCat(shortage.needed_bytes, " ", shortage.room_bytes)));
  return status;
}

std::optional<CacheShortage> ShortageOf(const absl::Status& status) {
  const auto payload = status.GetPayload(kPayload);
  if (!payload) return std::nullopt;
  const std::vector<std::string> numbers = absl::StrSplit(std::string(*payload), ' ');
  CacheShortage shortage;
  if (numbers.size() != 2 || !absl::SimpleAtoi(numbers[0], &shortage.needed_bytes) ||
      !absl::SimpleAtoi(numbers[1], &shortage.room_bytes)) {
    return std::nullopt;
  }
  return shortage;
}

}  // namespace sheaf
