// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_tracer.h"

#include "worker/render/gather/gather_map.h"

namespace sheaf::render {

LightTracer::LightTracer(const CompiledScene& scene, const PixelRect& window)
    : scene_(scene),
      window_(window),
      variant_(ChooseLightPathVariant(scene.plan.traits, scene.settings.force_generic_variant)) {
  if (scene.gather_step == 0) return;
  map_ = std::make_unique<GatherMap>();
  const uint64_t points = GatherPointsMax(window, scene.gather_step);
  if (Has(scene.plan.traits, Trait::kSpectral)) {
    map_->arena.Reserve<Spectral>(points);
  } else {
    map_->arena.Reserve<Rgb>(points);
  }
}

LightTracer::~LightTracer() = default;

bool LightTracer::Gather(uint64_t pass, const std::function<bool()>& goes_on, RayCounts* counts) {
  const FrameSettings& settings = scene_.settings;
  map_->sample = MakePassSample(settings.seed, pass, settings.one_sequence);
  map_->radius_scale = MergeRadiusScale(pass);
  map_->arena.Clear();
  const GatherRowFunction gather_row = GatherRowFunctionOf(variant_);
  for (int32_t y = window_.y0; y < window_.y1; ++y) {
    if (!goes_on()) return false;
    gather_row(scene_, window_.x0, window_.x1, y, pass, map_.get(), counts);
  }
  map_->grid.Build(map_->arena.balls());
  return true;
}

size_t LightTracer::CountGathered(uint64_t pass, RayCounts* counts) {
  if (map_ == nullptr) return 0;
  Gather(
      pass, [] { return true; }, counts);
  return map_->arena.balls().size();
}

bool LightTracer::TracePass(uint64_t pass, const std::function<bool()>& goes_on, SplatSink* splats,
                            RayCounts* counts) {
  if (map_ != nullptr && !Gather(pass, goes_on, counts)) return false;
  const LightRowFunction trace_row = LightRowFunctionOf(variant_);
  for (int32_t y = 0; y < scene_.settings.height_px; ++y) {
    if (!goes_on()) return false;
    trace_row(scene_, 0, scene_.settings.width_px, y, pass, map_.get(), splats, counts);
  }
  return true;
}

}  // namespace sheaf::render
