// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TechniqueJudge: small images of one size by several techniques > their errors and costs.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "common/scene/settings/render_settings.h"
#include "worker/render/ablation/technique_measurement.h"
#include "worker/render/ablation/technique_pilot.h"

namespace sheaf::render {

// By techniques, in the order of rendering.
class TechniquePilots {
 public:
  void Add(TechniqueSet techniques, Pilot pilot) {
    pilots_.emplace_back(techniques, std::move(pilot));
  }
  // Null where there is none.
  const Pilot* Find(TechniqueSet techniques) const {
    for (const auto& [of, pilot] : pilots_) {
      if (of == techniques) return &pilot;
    }
    return nullptr;
  }
  const std::vector<std::pair<TechniqueSet, Pilot>>& all() const { return pilots_; }

 private:
  std::vector<std::pair<TechniqueSet, Pilot>> pilots_;
};

class TechniqueJudge {
 public:
  // All outlive the judge. settings: those of the images. Requires: one by kCamera, and one by
  // kCameraAndLight. plain: what TechniqueMeasurement::plain becomes.
  TechniqueJudge(const TechniquePilots& pilots, const FrameSettings& settings,
                 const FrameSettings& frame, std::optional<TechniqueSet> plain);

  TechniqueMeasurement Measure() const;

 private:
  double VarianceOf(const Pilot& pilot, size_t pixel) const;
  std::optional<TechniqueCost> CostOf(TechniqueSet techniques) const;

  const TechniquePilots& pilots_;
  const FrameSettings& settings_;
  const FrameSettings& frame_;
  const std::optional<TechniqueSet> plain_;
  const std::vector<double> squares_;
  // Has light that camera paths miss; and such that only merging finds, or null.
  const Pilot* finder_ = nullptr;
  const Pilot* merger_ = nullptr;
};

}  // namespace sheaf::render
