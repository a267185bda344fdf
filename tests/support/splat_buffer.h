// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SplatBuffer: the splats of light paths as plain sums of square pixels, by replicate.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <vector>

#include "common/film/film_tile.h"
#include "worker/render/integrator/splat_sink.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

class SplatBuffer : public SplatSink {
 public:
  SplatBuffer(int32_t width_px, int32_t height_px) : width_px_(width_px), height_px_(height_px) {
    for (std::vector<Rgb>& sums : sums_) sums.resize(static_cast<size_t>(width_px) * height_px);
  }
  bool Covers(Vec2d raster) const override {
    return raster.x >= 0 && raster.x < width_px_ && raster.y >= 0 && raster.y < height_px_;
  }
  void Add(Vec2d raster, Rgb radiance, LightPathKind kind, uint32_t group) override {
    if (!Covers(raster)) return;
    if (!IsFinite(radiance)) ++non_finite;
    const auto pixel = static_cast<size_t>(raster.y) * width_px_ + static_cast<size_t>(raster.x);
    sums_[replicate_][pixel] += radiance;
    by_kind[kind] += radiance;
    by_group[group] += radiance;
  }
  // Traces passes [0, passes) of the frame.
  void Trace(const CompiledScene& scene, uint64_t passes, RayCounts* counts) {
    const LightRowFunction row = LightRowFunctionOf(
        ChooseLightPathVariant(scene.plan.traits, scene.settings.force_generic_variant));
    passes_ = passes;
    for (uint64_t pass = 0; pass < passes; ++pass) {
      replicate_ = ReplicateOf(pass);
      for (int32_t y = 0; y < height_px_; ++y) row(scene, 0, width_px_, y, pass, this, counts);
    }
  }
  // R + G + B of a pixel's mean over the passes of a replicate.
  double Mean(uint32_t replicate, size_t pixel) const {
    const Rgb sum = sums_[replicate][pixel];
    return static_cast<double>(sum.r + sum.g + sum.b) * kReplicateCount /
           static_cast<double>(passes_);
  }

  uint64_t non_finite = 0;
  std::map<LightPathKind, Rgb> by_kind;
  std::map<uint32_t, Rgb> by_group;

 private:
  int32_t width_px_, height_px_;
  uint32_t replicate_ = 0;
  uint64_t passes_ = 0;
  std::array<std::vector<Rgb>, kReplicateCount> sums_;
};

}  // namespace sheaf::render
