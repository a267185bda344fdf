// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/settings_codec.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/scene/spectrum/primaries.h"
#include "common/scene/spectrum/sensor.h"

namespace sheaf {
namespace {

// The wire and stored jobs use the same numbers.
static_assert(static_cast<int>(Primaries::kAcesCg) == v1::PRIMARIES_ACESCG &&
              v1::Primaries_ARRAYSIZE == kPrimariesCount);

v1::ColorTransport ToWire(ColorTransport color) {
  switch (color) {
    case ColorTransport::kAuto:
      return v1::COLOR_TRANSPORT_AUTO;
    case ColorTransport::kRgb:
      return v1::COLOR_TRANSPORT_RGB;
    case ColorTransport::kSpectral:
      return v1::COLOR_TRANSPORT_SPECTRAL;
  }
  return v1::COLOR_TRANSPORT_AUTO;
}

ColorTransport FromWire(v1::ColorTransport color) {
  if (color == v1::COLOR_TRANSPORT_RGB) return ColorTransport::kRgb;
  if (color == v1::COLOR_TRANSPORT_SPECTRAL) return ColorTransport::kSpectral;
  return ColorTransport::kAuto;
}

}  // namespace

v1::PixelRect ToWire(const PixelRect& rect) {
  v1::PixelRect wire;
  wire.set_x0_px(rect.x0);
  wire.set_y0_px(rect.y0);
  wire.set_x1_px(rect.x1);
  wire.set_y1_px(rect.y1);
  return wire;
}

PixelRect FromWire(const v1::PixelRect& rect) {
  return {rect.x0_px(), rect.y0_px(), rect.x1_px(), rect.y1_px()};
}

v1::FrameSettings ToWire(const FrameSettings& settings) {
  v1::FrameSettings wire;
  wire.set_width_px(settings.width_px);
  wire.set_height_px(settings.height_px);
  *wire.mutable_window() = ToWire(settings.window);
  wire.set_sample_count(settings.samples);
  wire.set_depth_max(settings.max_depth);
  wire.set_seed(settings.seed);
  wire.set_force_generic_variant(settings.force_generic_variant);
  wire.set_color(ToWire(settings.color));
  wire.set_single_scattering(settings.single_scattering);
  wire.set_one_sequence(settings.one_sequence);
  wire.set_similarity_after_count(settings.similarity_after);
  wire.set_pixel_stride_px(settings.lattice.All() ? 0 : settings.lattice.stride_px);
  wire.set_outputs(FormatOutputs(settings.outputs));
  wire.set_primaries(static_cast<v1::Primaries>(settings.primaries));
  wire.set_white_balance_k(settings.white_balance_k);
  wire.set_sensor(settings.sensor);
  wire.set_max_component_value(settings.max_component_value);
  return wire;
}

absl::StatusOr<FrameSettings> FromWire(const v1::FrameSettings& wire) {
  FrameSettings settings;
  settings.width_px = wire.width_px();
  settings.height_px = wire.height_px();
  settings.window = FromWire(wire.window());
  settings.samples = wire.sample_count();
  settings.max_depth = wire.depth_max();
  settings.seed = wire.seed();
  settings.force_generic_variant = wire.force_generic_variant();
  settings.color = FromWire(wire.color());
  settings.single_scattering = wire.single_scattering();
  settings.one_sequence = wire.one_sequence();
  settings.similarity_after = wire.similarity_after_count();
  if (settings.similarity_after < 0 || settings.similarity_after > kSimilarityAfterMax) {
    return absl::InvalidArgumentError(absl::StrCat("similarity after ", settings.similarity_after,
                                                   " scatterings is out of range"));
  }
  if (const int32_t stride_px = wire.pixel_stride_px(); stride_px != 0) {
    if (stride_px < kPixelStrideMin || stride_px > kPixelStrideMax) {
      return absl::InvalidArgumentError(absl::StrCat("a pixel stride of ", stride_px,
                                                     " is outside [", kPixelStrideMin, ", ",
                                                     kPixelStrideMax, "]"));
    }
    settings.lattice = {stride_px, settings.seed};
  }
  absl::StatusOr<FilmOutputs> outputs = ParseOutputs(wire.outputs());
  if (!outputs.ok()) return outputs.status();
  settings.outputs = *std::move(outputs);
  if (!v1::Primaries_IsValid(wire.primaries())) {
    return absl::InvalidArgumentError(
        absl::StrCat("primaries number ", wire.primaries(), " are unknown here"));
  }
  settings.primaries = static_cast<Primaries>(wire.primaries());
  settings.white_balance_k = wire.white_balance_k();
  if (settings.white_balance_k != 0 && !(settings.white_balance_k >= kWhiteBalanceMinK &&
                                         settings.white_balance_k <= kWhiteBalanceMaxK)) {
    return absl::InvalidArgumentError(
        absl::StrCat("a white balance of ", settings.white_balance_k, " K is out of range"));
  }
  settings.sensor = wire.sensor();
  if (!settings.sensor.empty() && !IsSensor(settings.sensor)) {
    return absl::InvalidArgumentError("the camera's sensor is unknown here");
  }
  settings.max_component_value = wire.max_component_value();
  if (!(settings.max_component_value >= 0 && std::isfinite(settings.max_component_value))) {
    return absl::InvalidArgumentError(
        absl::StrCat("samples cannot be clamped to ", settings.max_component_value));
  }
  return settings;
}

}  // namespace sheaf
