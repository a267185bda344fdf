// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/part_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/film/image_color.h"
#include "common/math/transform.h"

namespace sheaf::coordinator {
namespace {

// Sums of float32 in a tree are off by some 1e-6 of their addends. Spectral samples cancel each
// other, so a sum may be some hundred times smaller than its addends.
constexpr double kReplicateTolerance = 1e-2;
constexpr double kRounding = 1 + 1e-4;

constexpr std::array kHeads = {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi,
                               FilmChannel::kWeight};
constexpr std::array kTails = {FilmChannel::kRedLo, FilmChannel::kGreenLo, FilmChannel::kBlueLo,
                               FilmChannel::kWeightLo};

double SumOf(const FilmTile& part, size_t component, size_t p) {
  return double{part.channel(kHeads[component])[p]} + double{part.channel(kTails[component])[p]};
}

std::string WhyNoReplicates(const FilmTile& part) {
  const size_t size = part.plane_size();
  std::array<std::vector<float>, kReplicateChannelCount> sums;
  for (std::vector<float>& sum : sums) sum.resize(size);
  std::vector<float> color_magnitudes(size);
  for (uint32_t slot = 0; slot < part.replicate_count(); ++slot) {
    for (size_t component = 0; component < kReplicateChannelCount; ++component) {
      const float* values = part.replicate(slot, component);
      for (size_t p = 0; p < size; ++p) sums[component][p] += values[p];
      if (component == kReplicateChannelCount - 1) continue;
      for (size_t p = 0; p < size; ++p) color_magnitudes[p] += std::fabs(values[p]);
    }
  }
  const float* samples = part.channel(FilmChannel::kSampleCount);
  for (size_t component = 0; component < kReplicateChannelCount; ++component) {
    const bool is_weight = component == kReplicateChannelCount - 1;
    const float* magnitudes = is_weight ? samples : color_magnitudes.data();
    for (size_t p = 0; p < size; ++p) {
      const double difference = std::fabs(double{sums[component][p]} - SumOf(part, component, p));
      if (difference <= kReplicateTolerance * double{magnitudes[p]}) continue;
      return absl::StrCat("its replicates differ from its sums by ", difference,
                          is_weight ? " in weight" : " in light", ", more than rounding can");
    }
  }
  return "";
}

}  // namespace

std::string WhyNotOfSettings(const FilmTile& part, const FrameSettings& settings, TaskKind kind) {
  // A splat is not a sensor response: a pixel has many per pass.
  if (kind == TaskKind::kLight) return WhyNoReplicates(part);
  const float* samples = part.channel(FilmChannel::kSampleCount);
  const float* alpha = part.channel(FilmChannel::kAlpha);
  // A sensor's matrix takes longer to compute than the part takes to check.
  const bool clamps = settings.max_component_value != 0 && settings.sensor.empty();
  const Matrix4 response = *XyzFromRgb(Chromaticities());
  for (size_t p = 0; p < part.plane_size(); ++p) {
    const double count = double{samples[p]};
    if (SumOf(part, 3, p) != count) continue;  // A filter with negative weights.
    if (alpha[p] < 0 || double{alpha[p]} > count * kRounding) {
      return absl::StrCat("its alpha sums to ", alpha[p], " over ", count,
                          " samples, outside of [0, 1] each");
    }
    if (!clamps) continue;
    const Vec3d sum =
        TransformVector(response, {SumOf(part, 0, p), SumOf(part, 1, p), SumOf(part, 2, p)});
    const double most = count * double{settings.max_component_value} * kRounding;
    if (std::max({sum.x, sum.y, sum.z}) > most) {
      return absl::StrCat("a response sums to ", std::max({sum.x, sum.y, sum.z}), " over ", count,
                          " samples, above the scene's maxcomponentvalue of ",
                          settings.max_component_value, " each");
    }
  }
  return WhyNoReplicates(part);
}

}  // namespace sheaf::coordinator
