// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/picture_identity.h"

#include <algorithm>

#include "common/film/film.h"

namespace sheaf::cli {

std::string PictureIdentity(const FramePicture& picture) {
  FramePicture ordered = MakeFramePicture({0, 0, 1, 1}, 1, 1);
  const std::vector<std::string> film_order = ordered.channel_names;
  ordered = picture;
  ordered.channel_names.clear();
  ordered.planes.clear();
  for (const std::string& name : film_order) {
    const std::vector<float>* plane = picture.Find(name);
    if (plane == nullptr) continue;
    ordered.channel_names.push_back(name);
    ordered.planes.push_back(*plane);
  }
  for (size_t i = 0; i < picture.channel_names.size(); ++i) {
    const std::string& name = picture.channel_names[i];
    if (std::find(film_order.begin(), film_order.end(), name) != film_order.end()) continue;
    ordered.channel_names.push_back(name);
    ordered.planes.push_back(picture.planes[i]);
  }
  return PictureDigest(ordered);
}

}  // namespace sheaf::cli
