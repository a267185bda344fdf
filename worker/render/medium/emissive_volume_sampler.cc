// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/emissive_volume_sampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

size_t IndexOf(const std::array<int32_t, 3>& counts, const std::array<int32_t, 3>& cell) {
  return (static_cast<size_t>(cell[0]) * static_cast<size_t>(counts[1]) +
          static_cast<size_t>(cell[1])) *
             static_cast<size_t>(counts[2]) +
         static_cast<size_t>(cell[2]);
}
size_t CountOf(const std::array<int32_t, 3>& counts) {
  return static_cast<size_t>(counts[0]) * static_cast<size_t>(counts[1]) *
         static_cast<size_t>(counts[2]);
}

}  // namespace

// Cuts the box into cells that are close to cubes.
EmissiveVolumeSampler::Cells EmissiveVolumeSampler::CutUp(const HeterogeneousMedium& medium) {
  Cells cells;
  const IndexBox& box = medium.majorants().box();
  const Affine& render_from_index = medium.render_from_index();
  const Vec3d size = box.hi - box.lo;
  const Vec3d sides[3] = {size.x * render_from_index.x, size.y * render_from_index.y,
                          size.z * render_from_index.z};
  const double longest = std::max({Length(sides[0]), Length(sides[1]), Length(sides[2])});
  for (size_t a = 0; a < 3; ++a) {
    const double fraction = longest > 0 ? Length(sides[a]) / longest : 1;
    cells.counts[a] = std::max(1, static_cast<int32_t>(std::lround(fraction * kCellsAcross)));
  }
  cells.render_from_cell = {sides[0] / cells.counts[0], sides[1] / cells.counts[1],
                            sides[2] / cells.counts[2], render_from_index.Point(box.lo)};
  cells.cell_from_render = Inverse(cells.render_from_cell);
  return cells;
}

// Weights cells by their emission at the centers of equal parts of each cell and of the shutter
// interval.
void EmissiveVolumeSampler::Weigh(const Source& source, const Cells& cells,
                                  std::vector<double>* powers) {
  const auto count = static_cast<double>(CountOf(cells.counts));
  const int parts = std::max(1, static_cast<int>(std::cbrt(kPlacesMax / count)));
  const double volume = std::fabs(cells.render_from_cell.Determinant());
  const int moments = source.density->moves() ? kMoments : 1;
  std::array<int32_t, 3> cell{};
  const auto emits_at = [&](int x, int y, int z) {
    const Vec3d p = cells.render_from_cell.Point(
        {cell[0] + (x + 0.5) / parts, cell[1] + (y + 0.5) / parts, cell[2] + (z + 0.5) / parts});
    double sum = 0;
    for (int moment = 0; moment < moments; ++moment) {
      const double time = (moment + 0.5) / moments;
      const double density = source.density->DensityAt(p, time);
      if (!(density > 0)) continue;
      const Vec3d origin = source.density->OriginOf(p, time);
      sum += density * double{Luminance(source.emission->At<Rgb>(origin, {}) * source.sigma_a)};
    }
    return sum / moments;
  };
  for (cell[0] = 0; cell[0] < cells.counts[0]; ++cell[0]) {
    for (cell[1] = 0; cell[1] < cells.counts[1]; ++cell[1]) {
      for (cell[2] = 0; cell[2] < cells.counts[2]; ++cell[2]) {
        double sum = 0;
        for (int x = 0; x < parts; ++x) {
          for (int y = 0; y < parts; ++y) {
            for (int z = 0; z < parts; ++z) sum += emits_at(x, y, z);
          }
        }
        const double power = sum * volume / std::pow(parts, 3);
        powers->push_back(power > 0 && std::isfinite(power) ? power : 0);
      }
    }
  }
}

EmissiveVolumeSampler::EmissiveVolumeSampler(const std::vector<Source>& sources) {
  std::vector<double> powers;
  for (const Source& source : sources) {
    Cells cells = CutUp(*source.density);
    const double volume = std::fabs(cells.render_from_cell.Determinant());
    if (!(volume > 0) || !std::isfinite(1 / volume)) continue;
    cells.first = powers.size();
    Weigh(source, cells, &powers);
    cells_.push_back(std::move(cells));
  }
  choice_ = DiscreteDistribution(powers);
  for (const double power : powers) power_ += 4 * kPi * power;
  if (choice_.empty()) cells_.clear();
  for (Cells& cells : cells_) {
    const double volume = std::fabs(cells.render_from_cell.Determinant());
    for (size_t i = 0; i < CountOf(cells.counts); ++i) {
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
  size_t rest = chosen - cells.first;
  Vec3d at{double{u[0]}, double{u[1]}, double{u[3]}};
  for (size_t a = 3; a-- > 0;) {
    const auto count = static_cast<size_t>(cells.counts[a]);
    at[a] += static_cast<double>(rest % count);
    rest /= count;
  }
  return cells.render_from_cell.Point(at);
}

EmissiveVolumeSampler::PointSample EmissiveVolumeSampler::SamplePoint(
    const std::array<float, 4>& u) const {
  PointSample sample;
  sample.p = ToFloat(PointAt(u));
  sample.pdf = PdfPoint(sample.p);
  return sample;
}

double EmissiveVolumeSampler::PdfPoint(Vec3f p) const {
  double sum = 0;
  for (const Cells& cells : cells_) {
    const Vec3d at = cells.cell_from_render.Point(ToDouble(p));
    std::array<int32_t, 3> cell{};
    bool is_inside = true;
    for (size_t a = 0; a < 3; ++a) {
      is_inside = is_inside && at[a] >= 0 && at[a] < cells.counts[a];
      if (is_inside) cell[a] = static_cast<int32_t>(at[a]);
    }
    if (is_inside) sum += cells.density[IndexOf(cells.counts, cell)];
  }
  return sum;
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
// angle. Cell traversal: Amanatides and Woo 1987.
double EmissiveVolumeSampler::PdfOf(const Cells& cells, Vec3d p, Vec3d w) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Vec3d o = cells.cell_from_render.Point(p), d = cells.cell_from_render.Vector(w);
  double t = 0, end = kInfinity;
  for (size_t a = 0; a < 3; ++a) {
    const double size = cells.counts[a];
    if (d[a] == 0) {
      if (!(o[a] >= 0 && o[a] <= size)) return 0;
      continue;
    }
    const double first = -o[a] / d[a], last = (size - o[a]) / d[a];
    t = std::max(t, std::min(first, last));
    end = std::min(end, std::max(first, last));
  }
  if (!(t < end)) return 0;
  std::array<int32_t, 3> cell{};
  for (size_t a = 0; a < 3; ++a) {
    const double at = std::clamp(std::floor(o[a] + t * d[a]), 0.0, cells.counts[a] - 1.0);
    cell[a] = static_cast<int32_t>(at);
  }
  double sum = 0;
  for (;;) {
    // Where the ray leaves the cell, and through which face.
    double next = end;
    size_t axis = 3;
    for (size_t a = 0; a < 3; ++a) {
      if (d[a] == 0) continue;
      const double side = (cell[a] + (d[a] > 0 ? 1 : 0) - o[a]) / d[a];
      if (side < next) {
        next = side;
        axis = a;
      }
    }
    if (next > t) {
      sum += cells.density[IndexOf(cells.counts, cell)] * (next - t) *
             (next * next + next * t + t * t);
      t = next;
    }
    if (axis == 3) break;
    cell[axis] += d[axis] > 0 ? 1 : -1;
    if (cell[axis] < 0 || cell[axis] >= cells.counts[axis]) break;
  }
  return sum / 3;
}

}  // namespace sheaf::render
