// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/row_columns.h"

#include <optional>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"

namespace sheaf::coordinator {

std::string FormatLayers(const std::vector<LayerCount>& counts) {
  return absl::StrJoin(counts, " ", [](std::string* text, const LayerCount& count) {
    absl::StrAppend(text, count.layer, " ", count.tile_count);
  });
}

std::vector<LayerCount> ParseLayers(const std::string& text) {
  const std::vector<std::string> words = absl::StrSplit(text, ' ', absl::SkipEmpty());
  std::vector<LayerCount> counts;
  for (size_t i = 0; i + 1 < words.size(); i += 2) {
    LayerCount& count = counts.emplace_back(LayerCount{words[i]});
    if (!absl::SimpleAtoi(words[i + 1], &count.tile_count)) count.tile_count = 0;
  }
  return counts;
}

absl::Status ReadValue(const Statement& row, int column, FilmOutputs* value) {
  absl::StatusOr<FilmOutputs> outputs = ParseOutputs(row.Text(column));
  if (!outputs.ok()) {
    return absl::DataLossError(absl::StrCat("a stored frame: ", outputs.status().message()));
  }
  *value = *std::move(outputs);
  return absl::OkStatus();
}

absl::Status ReadValue(const Statement& row, int column, TechniqueSet* value) {
  const int64_t number = row.Int64(column);
  const std::optional<TechniqueSet> set = TechniqueSet::FromNumber(number);
  if (!set) {
    return absl::DataLossError(
        absl::StrCat("a stored frame: techniques number ", number, " are unknown here"));
  }
  *value = *set;
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
