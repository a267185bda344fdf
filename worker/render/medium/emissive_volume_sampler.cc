// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/emissive_volume_sampler.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "common/base/vector_bytes.h"

namespace sheaf::render {

EmissiveVolumeSampler::EmissiveVolumeSampler(const std::vector<Source>& sources) {
  std::vector<double> powers;
  for (const Source& source : sources) {
    Cells cells{CutIntoCells(*source.density, kCellsAcross), powers.size(), {}};
    const double volume = cells.places.VolumeOfCell();
    if (!(volume > 0) || !std::isfinite(1 / volume)) continue;
    const std::vector<double> emitted = EmissionOfCells(source, cells.places);
    powers.insert(powers.end(), emitted.begin(), emitted.end());
    cells_.push_back(std::move(cells));
  }
  choice_ = DiscreteDistribution(powers);
  if (choice_.empty()) cells_.clear();
  for (Cells& cells : cells_) {
    const double volume = cells.places.VolumeOfCell();
    for (size_t i = 0; i < cells.places.size(); ++i) {
      cells.density.push_back(choice_.Probability(cells.first + i) / volume);
    }
  }
}

uint64_t EmissiveVolumeSampler::memory_bytes() const {
  uint64_t bytes = VectorBytes(cells_) + choice_.size_bytes();
  for (const Cells& cells : cells_) bytes += VectorBytes(cells.density);
  return bytes;
}

Vec3d EmissiveVolumeSampler::PointAt(const std::array<float, 4>& u) const {
  const size_t chosen = choice_.Sample(ExtendBits(u[2], SaltOf({u[0], u[1]})));
  const auto after = std::upper_bound(cells_.begin(), cells_.end(), chosen,
                                      [](size_t i, const Cells& c) { return i < c.first; });
  const Cells& cells = *std::prev(after);
  return cells.places.PointIn(chosen - cells.first, {double{u[0]}, double{u[1]}, double{u[3]}});
}

EmissiveVolumeSampler::Sample EmissiveVolumeSampler::SampleFrom(
    Vec3f p, const std::array<float, 4>& u) const {
  const Vec3d to_point = PointAt(u) - ToDouble(p);
  const double distance = Length(to_point);
  if (!(distance > 0) || !std::isfinite(distance)) return {};
  const Vec3f w = ToFloat(to_point / distance);
  return {w, Pdf(p, w)};
}

float EmissiveVolumeSampler::Pdf(Vec3f p, Vec3f w) const {
  double sum = 0;
  for (const Cells& cells : cells_) sum += PdfOf(cells, ToDouble(p), ToDouble(w));
  const auto pdf = static_cast<float>(sum);
  return std::isfinite(pdf) ? pdf : 0;
}

// The integral along the ray of the sampling density times t^2, which converts volume to solid
// angle.
double EmissiveVolumeSampler::PdfOf(const Cells& cells, Vec3d p, Vec3d w) {
  double sum = 0;
  cells.places.Walk(p, w, [&](size_t cell, double t0, double t1) {
    sum += cells.density[cell] * (t1 - t0) * (t1 * t1 + t1 * t0 + t0 * t0);
  });
  return sum / 3;
}

}  // namespace sheaf::render
