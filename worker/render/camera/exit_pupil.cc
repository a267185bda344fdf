// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds the pupil of a film point: scans a grid over the bounds; while no ray passes, zooms to a
// finer grid about the ray that reaches the stop closest to its center; finally scans a finer grid
// over the passing cells, widened by one cell on each side.
#include "worker/render/camera/exit_pupil.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sheaf::render {
namespace {

constexpr size_t kRingCount = 64;
constexpr int kGridX = 64, kGridY = 32;  // Over [x0, x1] and [0, y].
// Each zoom step narrows the view to 5 of 64 cells: together by more than 10^8.
constexpr int kZoomStepsMax = 8;
constexpr int kGrowStepsMax = 8;

using Box = ExitPupil::Box;

Box Union(const Box& a, const Box& b) {
  return {std::min(a.x0, b.x0), std::max(a.x1, b.x1), std::max(a.y, b.y)};
}
Box Lerp(const Box& a, const Box& b, double t) {
  return {a.x0 + t * (b.x0 - a.x0), a.x1 + t * (b.x1 - a.x1), a.y + t * (b.y - a.y)};
}
Box Clip(const Box& box, const Box& to) {
  return {std::clamp(box.x0, to.x0, to.x1), std::clamp(box.x1, to.x0, to.x1),
          std::min(box.y, to.y)};
}

// The rear surface lies within the circle of its edge, between two planes; a point (x, y, z) on it
// is projected from (r, 0, 0) to r + (x - r) k, y k with k = rear z / z. Both are linear in x, y, r
// and k, so the corners give bounds.
Box BoundAll(const LensSystem& lens, double r0, double r1) {
  const double a = lens.rear_radius_mm();
  const double ks[2] = {lens.rear_z_mm() / lens.rear_z_max_mm(),
                        lens.rear_z_mm() / lens.rear_z_min_mm()};
  Box box{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
          a * ks[1]};
  for (const double k : ks) {
    for (const double r : {r0, r1}) {
      for (const double x : {-a, a}) {
        box.x0 = std::min(box.x0, r + (x - r) * k);
        box.x1 = std::max(box.x1, r + (x - r) * k);
      }
    }
  }
  // For the rounding above.
  const double slack = 1e-9 * (box.x1 - box.x0 + box.y);
  return {box.x0 - slack, box.x1 + slack, box.y + slack};
}

struct Scan {
  std::optional<Box> passing;    // The cells whose centers pass.
  std::optional<Vec2d> nearest;  // Nearest to the center of the stop, among rays that reach it.
  double cell_x = 0, cell_y = 0;
};

Scan ScanBox(const LensSystem& lens, double r, const Box& box) {
  Scan scan;
  scan.cell_x = (box.x1 - box.x0) / kGridX;
  scan.cell_y = box.y / kGridY;
  double least = std::numeric_limits<double>::infinity();
  for (int j = 0; j < kGridY; ++j) {
    for (int i = 0; i < kGridX; ++i) {
      const Vec2d p{box.x0 + (i + 0.5) * scan.cell_x, (j + 0.5) * scan.cell_y};
      LensRay ray{{r, 0, 0}, Normalize(Vec3d{p.x - r, p.y, lens.rear_z_mm()})};
      double from_middle = std::numeric_limits<double>::infinity();
      if (lens.MayPass(&ray, &from_middle)) {
        const Box cell{p.x - 0.5 * scan.cell_x, p.x + 0.5 * scan.cell_x, p.y + 0.5 * scan.cell_y};
        scan.passing = scan.passing ? Union(*scan.passing, cell) : cell;
      }
      if (from_middle < least) {
        least = from_middle;
        scan.nearest = p;
      }
    }
  }
  return scan;
}

// Adds one cell on each side, but stays within `all`.
Box Widened(const Scan& scan, const Box& all) {
  const Box& box = *scan.passing;
  return Clip({box.x0 - scan.cell_x, box.x1 + scan.cell_x, box.y + scan.cell_y}, all);
}

std::optional<Box> FindPupil(const LensSystem& lens, double r, const Box& all) {
  Box view = all;
  Scan scan = ScanBox(lens, r, view);
  for (int step = 0; step < kZoomStepsMax && !scan.passing && scan.nearest; ++step) {
    const Vec2d at = *scan.nearest;
    view =
        Clip({at.x - 2.5 * scan.cell_x, at.x + 2.5 * scan.cell_x, at.y + 2.5 * scan.cell_y}, all);
    scan = ScanBox(lens, r, view);
  }
  if (!scan.passing) return std::nullopt;
  // A pupil that touches the view's border may extend beyond it.
  for (int step = 0; step < kGrowStepsMax; ++step) {
    const Box found = *scan.passing;
    const bool cut = (found.x0 <= view.x0 + scan.cell_x && view.x0 > all.x0) ||
                     (found.x1 >= view.x1 - scan.cell_x && view.x1 < all.x1) ||
                     (found.y >= view.y - scan.cell_y && view.y < all.y);
    if (!cut) break;
    const double grow = view.x1 - view.x0;
    view = Clip({view.x0 - grow, view.x1 + grow, view.y + grow}, all);
    const Scan wider = ScanBox(lens, r, view);
    if (!wider.passing) break;
    scan = wider;
    scan.passing = Union(*scan.passing, found);
  }
  const Box coarse = *scan.passing;
  const Scan fine = ScanBox(lens, r, Widened(scan, all));
  if (!fine.passing) return Widened(scan, all);
  // Includes the cell centers that passed before, half a cell inside.
  const Box seen{coarse.x0 + 0.5 * scan.cell_x, coarse.x1 - 0.5 * scan.cell_x,
                 coarse.y - 0.5 * scan.cell_y};
  return Clip(Union(Widened(fine, all), seen), all);
}

}  // namespace

ExitPupil::ExitPupil(const LensSystem& lens, double film_radius_max_mm)
    : rings_per_mm_(kRingCount / film_radius_max_mm), rings_(kRingCount) {
  const double width = film_radius_max_mm / kRingCount;
  std::optional<Box> inner;
  for (size_t i = 0; i < kRingCount; ++i) {
    const double r0 = static_cast<double>(i) * width, r1 = r0 + width;
    Ring& ring = rings_[i];
    ring.film_radius_mm = r0;
    ring.all = BoundAll(lens, r0, r1);
    if (i == 0) inner = FindPupil(lens, r0, ring.all);
    const std::optional<Box> outer = FindPupil(lens, r1, ring.all);
    const std::optional<Box> middle = FindPupil(lens, 0.5 * (r0 + r1), ring.all);
    if (inner && outer && middle) {
      // Extends both by the amount by which the middle exceeds their interpolation.
      const Box straight = Lerp(*inner, *outer, 0.5);
      const double x0 = std::max(0.0, straight.x0 - middle->x0);
      const double x1 = std::max(0.0, middle->x1 - straight.x1);
      const double y = std::max(0.0, middle->y - straight.y);
      ring.inner = Clip({inner->x0 - x0, inner->x1 + x1, inner->y + y}, ring.all);
      ring.outer = Clip({outer->x0 - x0, outer->x1 + x1, outer->y + y}, ring.all);
      ring.found = true;
    } else {
      // The rim of the image circle, where the last light passes.
      for (const std::optional<Box>& box : {inner, middle, outer}) {
        if (!box) continue;
        ring.inner = Clip(ring.found ? Union(ring.inner, *box) : *box, ring.all);
        ring.found = true;
      }
      ring.outer = ring.inner;
    }
    ring.found = ring.found && ring.inner.Area() > 0 && ring.outer.Area() > 0;
    inner = outer;
  }
}

const ExitPupil::Ring& ExitPupil::ring(double film_radius_mm) const {
  const double index = film_radius_mm * rings_per_mm_;
  return rings_[std::min(static_cast<size_t>(index), rings_.size() - 1)];
}
ExitPupil::Box ExitPupil::FoundIn(const Ring& ring, double film_radius_mm, double rings_per_mm) {
  const double fraction = (film_radius_mm - ring.film_radius_mm) * rings_per_mm;
  return Lerp(ring.inner, ring.outer, std::clamp(fraction, 0.0, 1.0));
}
std::optional<ExitPupil::Box> ExitPupil::Found(double film_radius_mm) const {
  const Ring& at = ring(film_radius_mm);
  if (!at.found) return std::nullopt;
  return FoundIn(at, film_radius_mm, rings_per_mm_);
}

namespace {

// Rotation between the film point's axes, x away from the lens's axis, and those of the film.
struct Turn {
  double cosine = 1, sine = 0;
  explicit Turn(Vec2d film, double radius) {
    if (radius == 0) return;
    cosine = film.x / radius;
    sine = film.y / radius;
  }
  Vec2d ToFilm(Vec2d p) const { return {p.x * cosine - p.y * sine, p.x * sine + p.y * cosine}; }
  Vec2d ToOwn(Vec2d p) const { return {p.x * cosine + p.y * sine, p.y * cosine - p.x * sine}; }
};

double RadiusOf(Vec2d p) { return std::sqrt(p.x * p.x + p.y * p.y); }

}  // namespace

PupilSample ExitPupil::Sample(Vec2d film_mm, Vec2f u) const {
  const double radius = RadiusOf(film_mm);
  const Ring& at = ring(radius);
  const Box found = FoundIn(at, radius, rings_per_mm_);
  double x = static_cast<double>(u.x);
  const Box* box = &at.all;
  if (at.found) {
    if (x < kPupilAreaFraction) {
      x *= 1 / kPupilAreaFraction;
    } else {
      x = (x - kPupilAreaFraction) / (1 - kPupilAreaFraction);
      box = &found;
    }
  }
  const Vec2d own{box->x0 + x * (box->x1 - box->x0), (2 * static_cast<double>(u.y) - 1) * box->y};
  double pdf = (at.found ? kPupilAreaFraction : 1) / at.all.Area();
  if (at.found && found.Holds(own)) pdf += (1 - kPupilAreaFraction) / found.Area();
  return {Turn(film_mm, radius).ToFilm(own), pdf};
}

double ExitPupil::Pdf(Vec2d film_mm, Vec2d p_mm) const {
  const double radius = RadiusOf(film_mm);
  const Ring& at = ring(radius);
  const Vec2d own = Turn(film_mm, radius).ToOwn(p_mm);
  double pdf = 0;
  if (at.all.Holds(own)) pdf += (at.found ? kPupilAreaFraction : 1) / at.all.Area();
  const Box found = FoundIn(at, radius, rings_per_mm_);
  if (at.found && found.Holds(own)) pdf += (1 - kPupilAreaFraction) / found.Area();
  return pdf;
}

}  // namespace sheaf::render
