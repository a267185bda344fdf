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

  // The path goes from p along w (unit), which it sampled with density pdf, with the throughput;
  // `radiance` is what it found before.
  void Note(Vec3f p, Vec3f w, float pdf, const Color& throughput, const Color& radiance) {
    if (count_ == records_.size()) return;
    records_[count_++] = {p, w, pdf, throughput, radiance};
  }
  // The path sampled the light from p, which was visible or hidden.
  void NoteLight(Vec3f p, uint32_t light, bool is_visible) {
    if (light_count_ == lights_.size()) return;
    lights_[light_count_++] = {p, light, is_visible};
  }
  // The path has ended, and found `radiance` in all.
  void GiveTo(const Color& radiance, GuidingSink* sink) const {
    for (size_t i = 0; i < count_; ++i) {
      const Record& record = records_[i];
      double sum = 0, components = 0;
      for (size_t j = 0; j < kComponentCount<Color>; ++j) {
        const auto carried = static_cast<double>(record.throughput[j]);
        if (!(carried > 0)) continue;
        const auto gained =
            static_cast<double>(radiance[j]) - static_cast<double>(record.before[j]);
        sum += std::max(0.0, gained) / carried;
        components += 1;
      }
      if (components == 0) continue;
      sink->AddDirection(record.p, record.w, sum / components / static_cast<double>(record.pdf));
    }
    for (size_t i = 0; i < light_count_; ++i) {
      sink->AddLight(lights_[i].p, lights_[i].light, lights_[i].is_visible);
    }
  }

 private:
  struct Record {
    Vec3f p, w;
    float pdf = 0;
    Color throughput, before;
  };
  struct TriedLight {
    Vec3f p;
    uint32_t light = 0;
    bool is_visible = false;
  };
  std::array<Record, kTrainingVerticesMax> records_;
  std::array<TriedLight, kTrainingVerticesMax> lights_;
  size_t count_ = 0, light_count_ = 0;
};

}  // namespace sheaf::render
