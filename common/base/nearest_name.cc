// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/nearest_name.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

constexpr size_t kPrefixBytesMin = 3;  // Without dashes.
constexpr size_t kNameBytesMax = 64;   // Longer names are not worth the quadratic comparison.

// The number of single-byte edits, or swaps of neighbors, from a to b.
// Requires: neither is longer than kNameBytesMax.
// Source: Damerau 1964, "A technique for computer detection and correction of spelling errors";
// no byte is edited twice.
size_t EditDistance(std::string_view a, std::string_view b) {
  // rows[i % 3][j]: the distance between the first i bytes of a and the first j of b.
  std::array<std::array<size_t, kNameBytesMax + 1>, 3> rows;
  std::iota(rows[0].begin(), rows[0].end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    auto& row = rows[i % 3];
    const auto &last = rows[(i + 2) % 3], &before_last = rows[(i + 1) % 3];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({replaced, last[j] + 1, row[j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before_last[j - 2] + 1);
      }
    }
  }
  return rows[a.size() % 3][b.size()];
}

size_t CountLetters(std::string_view name) {
  return name.size() - std::min(name.find_first_not_of('-'), name.size());
}

// The shortest of the candidates that the name begins; null if there is none.
const std::string* ShortestWithPrefix(std::string_view name,
                                      const std::vector<std::string>& candidates) {
  if (CountLetters(name) < kPrefixBytesMin) return nullptr;
  const std::string* best = nullptr;
  for (const std::string& candidate : candidates) {
    if (!std::string_view(candidate).starts_with(name)) continue;
    if (best == nullptr || candidate.size() < best->size()) best = &candidate;
  }
  return best;
}

}  // namespace

std::string NearestNameHint(std::string_view name, const std::vector<std::string>& candidates) {
  if (name.size() > kNameBytesMax) return "";
  if (const std::string* whole = ShortestWithPrefix(name, candidates)) {
    return absl::StrCat("; did you mean \"", *whole, "\"?");
  }
  const std::string* best = nullptr;
  // A name of which most letters differ is another name.
  size_t best_distance =
      std::min(std::max<size_t>(2, name.size() / 3), CountLetters(name) / 2) + 1;
  for (const std::string& candidate : candidates) {
    if (candidate.size() > kNameBytesMax) continue;
    const size_t distance = EditDistance(name, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = &candidate;
    }
  }
  return best == nullptr ? "" : absl::StrCat("; did you mean \"", *best, "\"?");
}

}  // namespace sheaf
