// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TrainingRecords: the directions that one path took, and the light that it found behind each. The
// light of a direction is the radiance that the path gained after it, over the throughput that it
// had then: as weighted by multiple importance sampling, so that the field learns what scattering
// must find, and not what light samples find anyway.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "common/math/vec.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/guiding/guiding_sink.h"

namespace sheaf::render {

// Directions of longer paths are not learned from their further vertices.
inline constexpr size_t kTrainingVerticesMax = 32;

template <typename C>
class TrainingRecords {
 public:
  using Color = typename C::Color;

  // A direction that the path took.
  struct Direction {
    GuidingPoint from;
    Vec3f w;                              // Unit.
    float pdf = 0, scattering_part = -1;  // As in FoundLight.
    bool is_specular = false;
    Color throughput_before, throughput;  // Before and after the vertex scattered the path.
    Color radiance;                       // What the path had found before.
  };
  void Note(const Direction& direction) {
    if (count_ == records_.size()) return;
    records_[count_++] = direction;
  }
  // The path sampled the light from there, which was visible or hidden.
  void NoteLight(const GuidingPoint& from, uint32_t light, bool is_visible) {
    if (light_count_ == lights_.size()) return;
    lights_[light_count_++] = {from, light, is_visible};
  }
  // The path has ended, and found `radiance` in all.
  void GiveTo(const Color& radiance, GuidingSink* sink) const {
    for (size_t i = 0; i < count_; ++i) {
      const Direction& record = records_[i];
      double scattered = 0, arriving = 0, components = 0;
      for (size_t j = 0; j < kComponentCount<Color>; ++j) {
        const auto before = static_cast<double>(record.throughput_before[j]),
                   carried = static_cast<double>(record.throughput[j]);
        if (!(before > 0)) continue;
        const double gained = std::max(
            0.0, static_cast<double>(radiance[j]) - static_cast<double>(record.radiance[j]));
        scattered += gained / before;
        if (carried > 0) arriving += gained / carried;
        components += 1;
      }
      if (components == 0) continue;
      sink->AddDirection({record.from, record.w, scattered / components, arriving / components,
                          static_cast<double>(record.pdf),
                          static_cast<double>(record.scattering_part), record.is_specular});
    }
    for (size_t i = 0; i < light_count_; ++i) {
      sink->AddLight(lights_[i].from, lights_[i].light, lights_[i].is_visible);
    }
  }

 private:
  struct TriedLight {
    GuidingPoint from;
    uint32_t light = 0;
    bool is_visible = false;
  };
  std::array<Direction, kTrainingVerticesMax> records_;
  std::array<TriedLight, kTrainingVerticesMax> lights_;
  size_t count_ = 0, light_count_ = 0;
};

}  // namespace sheaf::render
