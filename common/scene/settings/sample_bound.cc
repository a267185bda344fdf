// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/sample_bound.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/film/image_color.h"
#include "common/scene/settings/path_shares.h"

namespace sheaf {
namespace {

std::string WhyNoBound(const FrameSettings& settings) {
  if (settings.max_component_value == 0) {
    return "no maximum of a sample is known; --clamp gives one, and biases the image";
  }
  if (settings.color != ColorTransport::kRgb) {
    return "samples of wavelengths can be negative; --color rgb has none";
  }
  if (!settings.sensor.empty()) return "the maximum is one of the sensor's responses";
  if (settings.primaries != Primaries::kSrgb || settings.white_balance_k != 0) {
    return "colors that are converted can be negative";
  }
  if (HasLightPaths(settings.techniques)) return "light paths reach several pixels";
  if (HasOneTile(settings)) return "paths count in several pixels";
  if (settings.one_sequence) return "--one-sequence has no independent replicates";
  if (!settings.lattice.All()) return "some pixels are not rendered";
  return "";
}

}  // namespace

SampleBound SampleBoundOf(const FrameSettings& settings) {
  SampleBound bound;
  bound.reason = WhyNoBound(settings);
  if (!bound.reason.empty()) return bound;
  const Matrix4 xyz_from_rgb = *XyzFromRgb(Chromaticities());
  bound.most.emplace();
  for (size_t c = 0; c < 3; ++c) {
    Vec3d unit;
    unit[c] = 1;
    const Vec3d xyz = TransformVector(xyz_from_rgb, unit);
    (*bound.most)[c] =
        static_cast<double>(settings.max_component_value) / std::max({xyz.x, xyz.y, xyz.z});
  }
  bound.reason = absl::StrCat("X, Y and Z of a sample are at most ", settings.max_component_value);
  return bound;
}

}  // namespace sheaf
