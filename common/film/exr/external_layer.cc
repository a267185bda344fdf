// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/external_layer.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

std::string ExternalChannel(size_t i) {
  return absl::StrCat(kExternalLayer, ".", std::string(1, "RGB"[i]));
}

}  // namespace

void SetExternalLayer(std::array<std::vector<float>, 3> planes, FrameImage* image) {
  RemoveExternalLayer(image);
  for (size_t i = 0; i < planes.size(); ++i) {
    SHEAF_CHECK(planes[i].size() == image->planes.front().size());
    image->channel_names.push_back(ExternalChannel(i));
    image->planes.push_back(std::move(planes[i]));
  }
}

void RemoveExternalLayer(FrameImage* image) {
  for (size_t i = 0; i < 3; ++i) {
    const auto found = std::ranges::find(image->channel_names, ExternalChannel(i));
    if (found == image->channel_names.end()) continue;
    image->planes.erase(image->planes.begin() + (found - image->channel_names.begin()));
    image->channel_names.erase(found);
  }
}

}  // namespace sheaf
