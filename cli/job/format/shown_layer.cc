// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/format/shown_layer.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/film/denoised_output.h"
#include "common/film/exr/external_layer.h"

namespace sheaf::cli {

std::string LeastNoisyLayer(const FrameImage& image) {
  for (const char* layer : {kExternalLayer, kDenoisedLayer}) {
    if (image.Find(absl::StrCat(layer, ".R")) != nullptr) return layer;
  }
  return "image";
}

absl::StatusOr<FrameImage> ImageOfLayer(const FrameImage& image, const std::string& name) {
  const std::string layer = name.empty() ? LeastNoisyLayer(image) : name;
  FrameImage shown = image;
  if (layer == "image") return shown;
  for (const char* component : {"R", "G", "B"}) {
    const std::vector<float>* const plane = image.Find(absl::StrCat(layer, ".", component));
    if (plane == nullptr) {
      return absl::FailedPreconditionError(
          absl::StrCat("the image has no layer ", layer, "; ",
                       layer == kExternalLayer ? "--denoise-with" : "--denoise", " adds it"));
    }
    *shown.Find(component) = *plane;
  }
  return shown;
}

}  // namespace sheaf::cli
