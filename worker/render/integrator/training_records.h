// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TrainingRecords: the directions that one path took, and the light that it found behind each. The
// light of a direction is the radiance that the path gained after it, over the throughput that it
// had then: as weighted by multiple importance sampling, so that the field learns what scattering
// must find, and not what light samples find anyway.
//
// Where paths are split, all paths of the sample fill one set of records, and what a direction
// found is what the path and all that split off from it later did. As the paths wait on a stack,
// these are traced before any that waited when the direction was taken.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/guiding/guiding_sink.h"

namespace sheaf::render {

// Directions of longer paths are not learned from their further vertices.
inline constexpr size_t kTrainingVerticesMax = 32;
// The same for all paths of a sample that is split.
inline constexpr size_t kSplitTrainingVerticesMax = 512;

// The mean over the components of color.
template <typename Color>
double MeanRadiance(const Color& radiance) {
  double sum = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) sum += static_cast<double>(radiance[i]);
  return sum / kComponentCount<Color>;
}

template <typename C>
class TrainingRecords {
 public:
  using Color = typename C::Color;

  // No record.
  static constexpr size_t kNotRecorded = ~size_t{0};

  explicit TrainingRecords(bool splits)
      : directions_max_(splits ? kSplitTrainingVerticesMax : kTrainingVerticesMax) {
    records_.reserve(kTrainingVerticesMax);
  }

  // A direction that the path took.
  struct Direction {
    GuidingPoint from;
    Vec3f w;                              // Unit.
    float pdf = 0, scattering_part = -1;  // As in FoundLight.
    bool is_specular = false;
    Color throughput_before, throughput;  // Before and after the vertex scattered the path.
    Color radiance;                       // Found by the path before.
    uint64_t rays = 0;                    // That had been traced before.
  };
  void Note(const Direction& direction) {
    if (records_.size() == directions_max_) return;
    records_.push_back({direction, direction.radiance, direction.rays, waiting_, true});
  }
  // The path sampled the light from there, which was visible or hidden.
  void NoteLight(const TriedLight& tried) {
    if (light_count_ == lights_.size()) return;
    lights_[light_count_++] = tried;
  }

  // --- Of paths that are split.
  size_t size() const { return records_.size(); }
  // Paths that wait now.
  void set_waiting(size_t waiting) { waiting_ = waiting; }
  // The path that took the last direction, if any since size() was `size`, waits until Resume.
  // Returns that record.
  size_t Suspend(size_t size) {
    if (records_.size() == size) return kNotRecorded;
    records_.back().is_open = false;
    return records_.size() - 1;
  }
  // The path that took the direction continues. radiance and rays: of the sample so far; waiting:
  // how many others still wait.
  void Resume(size_t record, const Color& radiance, uint64_t rays, size_t waiting) {
    waiting_ = waiting;
    if (record == kNotRecorded) return;
    Record& resumed = records_[record];
    resumed.direction.radiance = resumed.radiance_after = radiance;
    resumed.direction.rays = resumed.rays_after = rays;
    resumed.waiting = waiting;
    resumed.is_open = true;
  }

  // A path has ended, and the sample has found `radiance` and taken `rays` so far: all is known of
  // directions that were taken while no fewer paths waited.
  void Close(const Color& radiance, uint64_t rays, size_t waiting) {
    for (Record& record : records_) {
      if (!record.is_open || record.waiting < waiting) continue;
      record.radiance_after = radiance;
      record.rays_after = rays;
      record.is_open = false;
    }
  }
  // All paths of the sample have ended.
  void GiveTo(GuidingSink* sink) const {
    for (const Record& record : records_) {
      const Direction& direction = record.direction;
      double scattered = 0, arriving = 0, components = 0;
      for (size_t j = 0; j < kComponentCount<Color>; ++j) {
        const auto before = static_cast<double>(direction.throughput_before[j]),
                   carried = static_cast<double>(direction.throughput[j]);
        if (!(before > 0)) continue;
        const double gained = std::max(0.0, static_cast<double>(record.radiance_after[j]) -
                                                static_cast<double>(direction.radiance[j]));
        scattered += gained / before;
        if (carried > 0) arriving += gained / carried;
        components += 1;
      }
      if (components == 0) continue;
      sink->AddDirection({direction.from, direction.w, scattered / components,
                          arriving / components, static_cast<double>(direction.pdf),
                          static_cast<double>(direction.scattering_part), direction.is_specular,
                          record.rays_after - direction.rays});
    }
    for (size_t i = 0; i < light_count_; ++i) sink->AddLight(lights_[i]);
  }

 private:
  struct Record {
    Direction direction;
    Color radiance_after;     // Found by the sample when all was known.
    uint64_t rays_after = 0;  // The same of rays.
    size_t waiting = 0;       // Paths that waited when the direction was taken.
    bool is_open = false;     // More may be found.
  };
  std::vector<Record> records_;
  std::array<TriedLight, kTrainingVerticesMax> lights_;
  size_t directions_max_, light_count_ = 0, waiting_ = 0;
};

}  // namespace sheaf::render
