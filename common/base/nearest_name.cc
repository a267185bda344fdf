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

// Levenshtein distance, the number of single-byte edits from a to b; at most `limit`.
// Requires: neither is longer than kNameBytesMax.
size_t EditDistance(std::string_view a, std::string_view b, size_t limit) {
  const size_t difference = std::max(a.size(), b.size()) - std::min(a.size(), b.size());
  if (difference >= limit) return limit;
  std::array<size_t, kNameBytesMax + 1> columns;
  size_t* const row = columns.data();
  std::iota(row, row + b.size() + 1, size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    size_t least = row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
      least = std::min(least, row[j + 1]);
    }
    if (least >= limit) return limit;  // Rows never decrease.
  }
  return std::min(row[b.size()], limit);
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
    const size_t distance = EditDistance(name, candidate, best_distance);
    if (distance < best_distance) {
      best_distance = distance;
      best = &candidate;
    }
  }
  return best == nullptr ? "" : absl::StrCat("; did you mean \"", *best, "\"?");
}

}  // namespace sheaf
