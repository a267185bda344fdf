// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "cli/study/study.h"
#include "coordinator/core/job/work_left.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

// JSON has no numbers for infinity and NaN.
Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json EstimateJson(const std::optional<Estimate>& estimate) {
  if (!estimate) return {};
  return {{"value", Number(estimate->value)}, {"error", Number(estimate->error)}};
}

Json CurveJson(const StudyCurve& curve) {
  Json points = Json::array();
  for (const StudyPoint& point : curve.points) {
    points.push_back({{"samples", point.samples},
                      {"cpu_seconds", point.cpu_seconds},
                      {"relative_mse", Number(point.relative_mse.value)},
                      {"relative_mse_error", Number(point.relative_mse.error)},
                      {"on_pareto_front", point.on_pareto_front}});
  }
  Json json = {{"name", curve.setting.name},
               {"how", curve.setting.how},
               {"flag", curve.setting.flag},
               {"is_base", curve.setting.is_base},
               {"is_unbiased", curve.setting.is_unbiased},
               {"keeps_error_bars", curve.setting.keeps_error_bars},
               {"points", std::move(points)},
               {"rate", curve.rate ? Number(curve.rate->value) : Json()},
               {"rate_error", curve.rate ? Number(curve.rate->error) : Json()},
               {"bias_floor", Json()},
               {"gain", EstimateJson(curve.gain)}};
  if (curve.bias_floor) {
    json["bias_floor"] = {{"relative_mse", Number(curve.bias_floor->value)},
                          {"error", Number(curve.bias_floor->error)},
                          {"is_significant", curve.HasBias()}};
  }
  return json;
}

Json EffectJson(const render::EffectMeasurement& effect) {
  if (!effect.problem.empty()) return {{"name", effect.name}, {"problem", effect.problem}};
  return {{"name", effect.name},
          {"ablation", effect.ablation},
          {"time_fraction", Number(effect.TimeFraction())},
          {"time_ratio", Number(effect.time_ratio.value)},
          {"time_ratio_error", Number(effect.time_ratio.error)},
          {"variance_ratio", Number(effect.variance_ratio)},
          {"mean_change", Number(effect.mean_change.value)},
          {"mean_change_error", Number(effect.mean_change.error)},
          {"relative_mse", Number(effect.relative_mse)},
          {"problem", Json()}};
}

Json PriceJson(const StudyPrice& price) {
  const std::optional<Estimate>& error = price.relative_mse;
  return {{"samples", price.samples},
          {"cpu_seconds", price.cpu_seconds},
          {"relative_mse", error ? Number(error->value) : Json()},
          {"relative_mse_error", error ? Number(error->error) : Json()}};
}

Json CropJson(const StudyCrop& crop) {
  const PixelRect& rect = crop.region.rect;
  const bool is_largest = crop.region.kind == CropKind::kLargestError;
  Json json = {{"kind", is_largest ? "largest error" : "representative"},
               {"x0", rect.x0},
               {"y0", rect.y0},
               {"x1", rect.x1},
               {"y1", rect.y1},
               {"images", Json::array()}};
  for (const CropImage& image : crop.images) {
    json["images"].push_back({{"relative_mse", Number(image.relative_mse)},
                              {"png_base64", absl::Base64Escape(image.png)}});
  }
  return json;
}

Json FarmJson(const std::optional<StudyFarm>& farm) {
  if (!farm) return {};
  return {{"address", farm->address},
          {"worker_count", farm->worker_count},
          {"thread_count", farm->thread_count},
          {"other_job_count", farm->other_job_count}};
}

Json LightJson(const StudyLight& light) {
  return {{"shrink", light.shrink},
          {"width_px", light.width_px},
          {"height_px", light.height_px},
          {"paths_shrink", light.paths_shrink},
          {"reference_passes", light.reference_passes},
          {"cpu_seconds_per_pass", Number(light.cpu_seconds_per_pass)}};
}

const char* NameOf(LightPathKind kind) { return kLightPathNames[static_cast<size_t>(kind)].name; }

}  // namespace

std::string StudyJson(const StudyResult& result) {
  Json json = {{"format", 2},
               {"scene", result.scene},
               {"width_px", result.width_px},
               {"height_px", result.height_px},
               {"pixels", result.pixels},
               {"seconds", result.seconds},
               {"threads", result.threads},
               {"reference",
                {{"samples", result.reference_samples},
                 {"relative_mse", Number(result.reference_relative_mse)},
                 {"cpu_seconds", result.reference_cpu_seconds}}},
               {"cpu_seconds_per_sample", Number(result.cpu_seconds_per_sample)},
               {"training_cpu_seconds", Number(result.training_cpu_seconds)},
               {"thread_use", coordinator::kUsualThreadUse},
               {"farm", FarmJson(result.farm)},
               {"prices", Json::array()},
               {"crops", Json::array()},
               {"entries", Json::array()},
               {"effects", Json::array()},
               {"paths", Json::array()},
               {"assessed_tile_count", result.assessed_tile_count},
               {"unreliable_tiles", Json::array()},
               {"recommendation", result.recommendation},
               {"not_studied", result.not_studied}};
  if (result.light) json["light"] = LightJson(*result.light);
  for (const StudyPrice& price : result.prices) json["prices"].push_back(PriceJson(price));
  for (const StudyCrop& crop : result.crops) json["crops"].push_back(CropJson(crop));
  for (const StudyCurve& curve : result.curves) json["entries"].push_back(CurveJson(curve));
  for (const render::EffectMeasurement& effect : result.effects.effects) {
    json["effects"].push_back(EffectJson(effect));
  }
  for (const StudyPath& path : result.paths) {
    json["paths"].push_back({{"name", NameOf(path.kind)},
                             {"meaning", kLightPathNames[static_cast<size_t>(path.kind)].meaning},
                             {"light_fraction", Number(path.fractions.light)},
                             {"noise_fraction", Number(path.fractions.variance)},
                             {"largest_replicate_fraction", Number(path.fractions.one_replicate)}});
  }
  for (const UnreliableTile& tile : result.unreliable_tiles) {
    json["unreliable_tiles"].push_back({{"x0", tile.rect.x0},
                                        {"y0", tile.rect.y0},
                                        {"x1", tile.rect.x1},
                                        {"y1", tile.rect.y1},
                                        {"path", NameOf(tile.kind)},
                                        {"fraction", Number(tile.variance_fraction)}});
  }
  // File names may contain any bytes.
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace sheaf::cli
