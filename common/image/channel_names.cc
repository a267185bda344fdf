// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/channel_names.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sheaf {
namespace {

constexpr size_t kNamesShown = 8;

// The names by which EXR files call a channel.
int PlaceOf(const std::vector<std::string>& names, const std::string& layer, const char* letter,
            const char* word) {
  for (size_t i = 0; i < names.size(); ++i) {
    for (const char* name : {letter, word}) {
      if (absl::EqualsIgnoreCase(names[i], layer + name)) return static_cast<int>(i);
    }
  }
  return -1;
}

// None if the layer, or the file as a whole where it is empty, has no red, green or blue.
std::optional<std::vector<int>> ColorsOf(const std::vector<std::string>& names,
                                         const std::string& layer) {
  std::vector<int> places{PlaceOf(names, layer, "R", "red"), PlaceOf(names, layer, "G", "green"),
                          PlaceOf(names, layer, "B", "blue")};
  if (*std::ranges::min_element(places) < 0) return std::nullopt;
  if (const int alpha = PlaceOf(names, layer, "A", "alpha"); alpha >= 0) places.push_back(alpha);
  return places;
}

}  // namespace

std::vector<int> ColorChannelsOf(const std::vector<std::string>& names) {
  if (auto colors = ColorsOf(names, "")) return *std::move(colors);
  std::set<std::string> layers;
  for (const std::string& name : names) {
    const size_t dot = name.rfind('.');
    if (dot != std::string::npos && ColorsOf(names, name.substr(0, dot + 1))) {
      layers.insert(name.substr(0, dot + 1));
    }
  }
  if (layers.size() == 1) return *ColorsOf(names, *layers.begin());
  if (names.size() == 1) return {0};
  const int gray = PlaceOf(names, "", "Y", "luminance");
  const bool has_chroma = PlaceOf(names, "", "RY", "BY") >= 0;
  return gray >= 0 && !has_chroma && layers.empty() ? std::vector<int>{gray} : std::vector<int>{};
}

absl::Status NoColorChannels(const std::string& path, std::vector<std::string> names) {
  const size_t more = names.size() - std::min(names.size(), kNamesShown);
  names.resize(names.size() - more);
  return absl::InvalidArgumentError(absl::StrCat(
      path, ": its channels are ", absl::StrJoin(names, ", "),
      more > 0 ? absl::StrCat(" and ", more, " others") : "",
      ", but an image has R, G and B, or Y; write those that are meant to a file of their own"));
}

}  // namespace sheaf
