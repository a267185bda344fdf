// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/volume_cells.h"

namespace sheaf::render {

Vec3d VolumeCells::PointIn(size_t index, Vec3d at) const {
  for (size_t a = 3; a-- > 0;) {
    const auto count = static_cast<size_t>(counts[a]);
    at[a] += static_cast<double>(index % count);
    index /= count;
  }
  return render_from_cell.Point(at);
}

std::optional<size_t> VolumeCells::CellAt(Vec3d p) const {
  const Vec3d at = cell_from_render.Point(p);
  std::array<int32_t, 3> cell{};
  for (size_t a = 0; a < 3; ++a) {
    if (!(at[a] >= 0 && at[a] < counts[a])) return std::nullopt;
    cell[a] = static_cast<int32_t>(at[a]);
  }
  return IndexOf(cell);
}

VolumeCells CutIntoCells(const HeterogeneousMedium& medium, int32_t across) {
  VolumeCells cells;
  const IndexBox& box = medium.majorants().box();
  const Affine& render_from_index = medium.render_from_index();
  const Vec3d size = box.hi - box.lo;
  const Vec3d sides[3] = {size.x * render_from_index.x, size.y * render_from_index.y,
                          size.z * render_from_index.z};
  const double longest = std::max({Length(sides[0]), Length(sides[1]), Length(sides[2])});
  for (size_t a = 0; a < 3; ++a) {
    const double fraction = longest > 0 ? Length(sides[a]) / longest : 1;
    cells.counts[a] = std::max(1, static_cast<int32_t>(std::lround(fraction * across)));
  }
  cells.render_from_cell = {sides[0] / cells.counts[0], sides[1] / cells.counts[1],
                            sides[2] / cells.counts[2], render_from_index.Point(box.lo)};
  cells.cell_from_render = Inverse(cells.render_from_cell);
  return cells;
}

std::vector<double> EmissionOfCells(const EmissiveDensity& source, const VolumeCells& cells) {
  std::vector<double> emitted;
  const auto count = static_cast<double>(cells.size());
  const int parts = std::max(1, static_cast<int>(std::cbrt(kEmissionPlacesMax / count)));
  const double volume = cells.VolumeOfCell();
  const int moments = source.density->moves() ? kEmissionMoments : 1;
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
        emitted.push_back(power > 0 && std::isfinite(power) ? power : 0);
      }
    }
  }
  return emitted;
}

}  // namespace sheaf::render
