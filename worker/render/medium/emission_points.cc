// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/emission_points.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

// Whether the density may be positive in each cell, at any time.
std::vector<bool> CellsWithDensity(const HeterogeneousMedium& medium, const VolumeCells& cells) {
  const IndexBox& box = medium.majorants().box();
  const Vec3d size = box.hi - box.lo;
  std::vector<bool> may_emit;
  may_emit.reserve(cells.size());
  std::array<int32_t, 3> cell{};
  for (cell[0] = 0; cell[0] < cells.counts[0]; ++cell[0]) {
    for (cell[1] = 0; cell[1] < cells.counts[1]; ++cell[1]) {
      for (cell[2] = 0; cell[2] < cells.counts[2]; ++cell[2]) {
        IndexBox region;
        for (size_t a = 0; a < 3; ++a) {
          region.lo[a] = box.lo[a] + size[a] * cell[a] / cells.counts[a];
          region.hi[a] = box.lo[a] + size[a] * (cell[a] + 1) / cells.counts[a];
        }
        may_emit.push_back(medium.majorants().BoundsOver(region).upper > 0);
      }
    }
  }
  return may_emit;
}

VolumeCells OneCell(Vec3d lower, Vec3d upper) {
  const Vec3d size = upper - lower;
  VolumeCells cells;
  cells.render_from_cell = {{size.x, 0, 0}, {0, size.y, 0}, {0, 0, size.z}, lower};
  cells.cell_from_render = Inverse(cells.render_from_cell);
  return cells;
}

bool HasVolume(double volume) { return volume > 0 && std::isfinite(1 / volume); }

// The power that leaves the box: no more than its surface emits where it is opaque.
double PowerOf(const EmissionPoints::Body& body) {
  const Vec3d size = body.upper - body.lower;
  const double thin = 4 * kPi * size.x * size.y * size.z * body.emission;
  const double area = 2 * (size.x * size.y + size.y * size.z + size.z * size.x);
  const double thick = kPi * area * body.emission / body.extinction;
  return body.extinction > 0 ? std::min(thin, thick) : thin;
}

// A source before it is known what share of the points it gets.
struct Draft {
  VolumeCells cells;
  double extinction = 0;
  std::vector<double> power;   // By cell.
  std::vector<bool> may_emit;  // Which cells have points.
};

std::vector<Draft> DraftsOf(const std::vector<EmissiveDensity>& densities,
                            const std::vector<EmissionPoints::Body>& bodies) {
  std::vector<Draft> drafts;
  for (const EmissiveDensity& source : densities) {
    Draft draft{CutIntoCells(*source.density, EmissionPoints::kCellsAcross), 0, {}, {}};
    if (!HasVolume(draft.cells.VolumeOfCell())) continue;
    draft.power = EmissionOfCells(source, draft.cells);
    for (double& power : draft.power) power *= 4 * kPi;
    draft.may_emit = CellsWithDensity(*source.density, draft.cells);
    drafts.push_back(std::move(draft));
  }
  for (const EmissionPoints::Body& body : bodies) {
    Draft draft{OneCell(body.lower, body.upper), body.extinction, {PowerOf(body)}, {true}};
    if (HasVolume(draft.cells.VolumeOfCell())) drafts.push_back(std::move(draft));
  }
  return drafts;
}

double SumOf(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

EmissionPoints::EmissionPoints(const std::vector<EmissiveDensity>& densities,
                               const std::vector<Body>& bodies) {
  const std::vector<Draft> drafts = DraftsOf(densities, bodies);
  double power = 0;
  for (const Draft& draft : drafts) power += SumOf(draft.power);
  if (!(power > 0) || !std::isfinite(power)) return;
  power_ = power;
  std::vector<double> weights;
  for (const Draft& draft : drafts) {
    const auto cells = std::count(draft.may_emit.begin(), draft.may_emit.end(), true);
    if (cells == 0) continue;
    const double even = kEvenPoints * std::max(SumOf(draft.power), kLeastPower * power_) /
                        static_cast<double>(cells);
    sources_.push_back({draft.cells, weights.size(), draft.extinction, {}});
    for (size_t i = 0; i < draft.power.size(); ++i) {
      weights.push_back(draft.may_emit[i] ? draft.power[i] + even : 0);
    }
  }
  choice_ = DiscreteDistribution(weights);
  for (Source& source : sources_) {
    const double volume = source.cells.VolumeOfCell();
    for (size_t i = 0; i < source.cells.size(); ++i) {
      source.density.push_back(choice_.Probability(source.first + i) / volume);
    }
  }
}

uint64_t EmissionPoints::memory_bytes() const {
  uint64_t bytes = VectorBytes(sources_) + choice_.size_bytes();
  for (const Source& source : sources_) bytes += VectorBytes(source.density);
  return bytes;
}

EmissionPoints::Point EmissionPoints::Sample(double choice, const std::array<float, 3>& u) const {
  const size_t chosen = choice_.Sample(choice);
  const auto after = std::upper_bound(sources_.begin(), sources_.end(), chosen,
                                      [](size_t i, const Source& s) { return i < s.first; });
  const Source& source = *std::prev(after);
  Point point;
  point.p = ToFloat(
      source.cells.PointIn(chosen - source.first, {double{u[0]}, double{u[1]}, double{u[2]}}));
  point.pdf = Pdf(point.p);
  return point;
}

double EmissionPoints::Pdf(Vec3f p) const {
  double sum = 0;
  for (const Source& source : sources_) {
    if (const auto cell = source.cells.CellAt(ToDouble(p))) sum += source.density[*cell];
  }
  return sum;
}

double EmissionPoints::LineDensity(Vec3f p, Vec3f w) const {
  double sum = 0;
  for (const Source& source : sources_) {
    source.cells.Walk(ToDouble(p), ToDouble(w), [&](size_t cell, double t0, double t1) {
      const double sigma = source.extinction, length = t1 - t0;
      sum += source.density[cell] * (sigma > 0 ? -Expm1(-sigma * length) / sigma : length);
    });
  }
  return std::isfinite(sum) ? sum : 0;
}

}  // namespace sheaf::render
