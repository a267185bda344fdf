// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/exr_channels.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/film/exr/stereo_views.h"

namespace sheaf {
namespace {

// Channels of one number per pixel that is no color.
constexpr std::string_view kScalars[] = {"samples",
                                         "nonfinite",
                                         "objectId",
                                         "materialId",
                                         "assetId",
                                         "rest.CryptoObject",
                                         "rest.CryptoMaterial",
                                         "rest.CryptoAsset",
                                         "light.samples",
                                         "light.nonfinite"};
constexpr std::string_view kComponent = ".X";
constexpr std::string_view kMatteLayers = "Crypto";
constexpr std::string_view kErrorLayers[] = {"stderr", "denoisedError", "light.stderr",
                                             "difference.stderr"};

bool IsScalar(std::string_view name) {
  return std::ranges::find(kScalars, name) != std::end(kScalars);
}

}  // namespace

std::string FileChannelName(const std::string& name) {
  return IsScalar(name) ? absl::StrCat(name, std::string(kComponent)) : name;
}

std::string ImageChannelName(const std::string& file_name) {
  if (!file_name.ends_with(kComponent)) return file_name;
  std::string name = file_name.substr(0, file_name.size() - kComponent.size());
  return IsScalar(name) ? name : file_name;
}

std::string LayerOfChannel(std::string_view name) {
  if (IsScalar(name)) return std::string(name);
  if (const size_t dot = name.rfind('.'); dot != std::string_view::npos) {
    return std::string(name.substr(0, dot));
  }
  if (name == "R" || name == "G" || name == "B" || name == "A") return "rgba";
  return name == "u" || name == "v" ? "uv" : std::string(name);
}

bool IsColorChannel(std::string_view name) {
  const std::string_view component = name.substr(name.rfind('.') + 1);
  const bool is_color =
      component == "R" || component == "G" || component == "B" || component == "A";
  const std::string layer{WithoutView(LayerOfChannel(name))};
  return is_color && !layer.starts_with(kMatteLayers) &&
         std::ranges::find(kErrorLayers, layer) == std::end(kErrorLayers);
}

}  // namespace sheaf
