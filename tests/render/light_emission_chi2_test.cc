// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the rays that leave lights against LightEmission::PdfLe, for every kind of light: it
// integrates to 1 over positions and directions, and the rays follow it by Pearson's chi-square
// over cells of positions and directions together. Cells with fewer than 8 expected rays are
// pooled. The false-alarm probability of all 22 tests together is 10^-4 (Sidak), and the seeds are
// fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "tests/support/chi_square.h"
#include "tests/support/light_setups.h"
#include "tests/support/long_tests.h"
#include "worker/render/light/light_emission.h"
#include "worker/render/light/light_table_impl.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::EmissionOf;
using testing::kSetupRadius;
using testing::LightSetup;
using testing::LightSetups;
using testing::NextUniforms;
using testing::RandomPoints;

// Where the rays of a light along w leave it: points by (s, t) in [0, 1)^2, with the normal and the
// area, in the light's measure, of the whole square at that point.
struct RayPoint {
  Vec3d p, n;
  double area = 1;
};
struct RayMap {
  std::function<RayPoint(double s, double t, Vec3d w)> at;
  std::function<Vec2d(const EmittedRay& ray)> inverse;
  // Cells of each coordinate of points, and of directions; a single one where light has one. Each
  // is integrated by the midpoints of its parts.
  int point_cells = 4, direction_cells = 8;
  int point_parts = 3, direction_parts = 20;
  // Directions by a point of [0, 1)^2, with the solid angle of the whole square there; empty: the
  // equal-area map.
  std::function<Vec3d(Vec2d, double* steradians)> direction{};
  std::function<Vec2d(Vec3d w)> direction_inverse{};
};
Vec3d DirectionAt(const RayMap& map, Vec2d square, double* steradians) {
  if (map.direction) return map.direction(square, steradians);
  *steradians = 4 * kPi;
  return EqualAreaSquareToSphere(square);
}
Vec2d SquareOf(const RayMap& map, Vec3f w) {
  if (map.direction) return map.direction_inverse(ToDouble(w));
  const Vec2f square = EqualAreaSphereToSquare(w);
  return {double{square.x}, double{square.y}};
}

double WrappedTurn(double y, double x) {
  const double turn = std::atan2(y, x) / (2 * kPi);
  return turn < 0 ? turn + 1 : turn;
}

RayMap TriangleMap(const TriangleEmitter& t) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2);
  const double twice_area = Length(normal);
  const Vec3d n = normal / twice_area;
  return {[=](double s, double v, Vec3d) {
            return RayPoint{v0 + s * (1 - v) * e1 + v * e2, n, twice_area * (1 - v)};
          },
          [=](const EmittedRay& ray) {
            const Vec3d q = ToDouble(ray.p) - v0;
            const double b1 = Dot(Cross(q, e2), n) / twice_area;
            const double b2 = Dot(Cross(e1, q), n) / twice_area;
            return Vec2d{b2 < 1 ? b1 / (1 - b2) : 0.0, b2};
          }};
}
RayMap SphereMap(const SphereEmitter& sphere) {
  const double r = sphere.radius;
  const Vec3d c = sphere.center;
  return {[=](double s, double t, Vec3d) {
            const double z = 1 - 2 * s, rho = std::sqrt(1 - z * z);
            const Vec3d n{rho * std::cos(2 * kPi * t), rho * std::sin(2 * kPi * t), z};
            return RayPoint{c + r * n, n, 4 * kPi * r * r};
          },
          [=](const EmittedRay& ray) {
            const Vec3d n = (ToDouble(ray.p) - c) / r;
            return Vec2d{0.5 * (1 - n.z), WrappedTurn(n.y, n.x)};
          },
          4,
          8,
          8,
          12};
}
RayMap DiskMap(const DiskEmitter& disk) {
  const Vec3d y_axis = Cross(disk.normal, disk.axis_x);
  const double inner = disk.inner_radius * disk.inner_radius;
  const double range = disk.radius * disk.radius - inner;
  return {[=](double s, double t, Vec3d) {
            const double r = std::sqrt(inner + s * range);
            return RayPoint{disk.center + r * std::cos(2 * kPi * t) * disk.axis_x +
                                r * std::sin(2 * kPi * t) * y_axis,
                            disk.normal, kPi * range};
          },
          [=](const EmittedRay& ray) {
            const Vec3d q = ToDouble(ray.p) - disk.center;
            const double x = Dot(q, disk.axis_x), y = Dot(q, y_axis);
            return Vec2d{(x * x + y * y - inner) / range, WrappedTurn(y, x)};
          }};
}
RayMap PositionMap() {
  return {[](double, double, Vec3d) { return RayPoint{}; },
          [](const EmittedRay&) {
            return Vec2d{0.5, 0.5};
          },
          1,
          24,
          1,
          50};
}
// The disk perpendicular to the rays of lights at infinity.
RayMap PerpendicularMap() {
  constexpr double kSquare = kSetupRadius * kSetupRadius;
  return {[=](double s, double t, Vec3d w) {
            const Frame frame = Frame::FromNormal(ToFloat(w));
            const double r = std::sqrt(s * kSquare);
            return RayPoint{r * std::cos(2 * kPi * t) * ToDouble(frame.t) +
                                r * std::sin(2 * kPi * t) * ToDouble(frame.b),
                            {},
                            kPi * kSquare};
          },
          [=](const EmittedRay& ray) {
            const Frame frame = Frame::FromNormal(ray.w);
            const double x = Dot(ray.p, frame.t), y = Dot(ray.p, frame.b);
            return Vec2d{(x * x + y * y) / kSquare, WrappedTurn(y, x)};
          },
          4,
          8,
          3,
          20};
}
// The same, for light of one direction.
RayMap DistantMap(Vec3d w) {
  RayMap map = PerpendicularMap();
  map.point_cells = 16;
  map.point_parts = 10;
  map.direction_cells = map.direction_parts = 1;
  map.direction = [w](Vec2d, double* steradians) {
    *steradians = 1;
    return w;
  };
  map.direction_inverse = [](Vec3d) { return Vec2d{0.5, 0.5}; };
  return map;
}
// Directions by their angles about the portal's edges, as its table has them (256 each way).
RayMap PortalMap() {
  const Vec3d corner = testing::kPortalCorners[0];
  const double width = 1.5, height = 2.5;
  RayMap map;
  map.at = [=](double s, double t, Vec3d w) {
    // Beyond the portal, as PdfLe requires.
    return RayPoint{
        corner + Vec3d{s * width, t * height, 0} + 0.5 * w, {}, width * height * std::fabs(w.z)};
  };
  map.inverse = [=](const EmittedRay& ray) {
    const Vec3d w = ToDouble(ray.w), p = ToDouble(ray.p);
    const Vec3d q = p + (corner.z - p.z) / w.z * w - corner;
    return Vec2d{q.x / width, q.y / height};
  };
  map.point_parts = 1;
  map.direction_parts = 32;
  map.direction = [](Vec2d square, double* steradians) {
    const double x = std::tan((square.x - 0.5) * kPi), y = std::tan((square.y - 0.5) * kPi);
    const double length = std::sqrt(1 + x * x + y * y);
    *steradians = kPi * kPi * (1 + x * x) * (1 + y * y) / (length * length * length);
    return Vec3d{x, y, 1} / -length;
  };
  map.direction_inverse = [](Vec3d w) {
    return Vec2d{std::atan2(-w.x, -w.z) / kPi + 0.5, std::atan2(-w.y, -w.z) / kPi + 0.5};
  };
  return map;
}

size_t CellOf(double v, int cells) {
  return static_cast<size_t>(std::clamp(static_cast<int>(v * cells), 0, cells - 1));
}

// Counts or masses by cells of points and directions.
class RayCells {
 public:
  explicit RayCells(const RayMap& map)
      : points_(map.point_cells), directions_(map.direction_cells), values_(Size()) {}
  double& At(Vec2d st, Vec2d direction) {
    const size_t point =
        CellOf(st.x, points_) * static_cast<size_t>(points_) + CellOf(st.y, points_);
    const size_t across = static_cast<size_t>(directions_);
    return values_[(point * across + CellOf(direction.x, directions_)) * across +
                   CellOf(direction.y, directions_)];
  }
  const std::vector<double>& values() const { return values_; }

 private:
  size_t Size() const { return static_cast<size_t>(points_ * points_ * directions_ * directions_); }
  int points_, directions_;
  std::vector<double> values_;
};

// Integrates PdfLe over each cell. Returns the whole integral.
double Integrate(const LightEmission& emission, const RayMap& map, RayCells* cells) {
  const int fine = map.direction_cells * map.direction_parts;
  const int fine_points = map.point_cells * map.point_parts;
  double total = 0;
  for (int i = 0; i < fine * fine; ++i) {
    const Vec2d direction{(i % fine + 0.5) / fine, (i / fine + 0.5) / fine};
    double steradians = 0;
    const Vec3d w = DirectionAt(map, direction, &steradians);
    for (int k = 0; k < fine_points * fine_points; ++k) {
      const Vec2d st{(k % fine_points + 0.5) / fine_points, (k / fine_points + 0.5) / fine_points};
      const RayPoint point = map.at(st.x, st.y, w);
      const double pdf = emission.PdfLe(0, ToFloat(point.p), ToFloat(point.n), ToFloat(w));
      const double mass =
          pdf * point.area * steradians / (std::pow(fine_points, 2) * std::pow(fine, 2));
      cells->At(st, direction) += mass;
      total += mass;
    }
  }
  return total;
}

// Counts rays by cell, and compares their pdf with PdfLe. Returns the number of samples.
int Count(const LightEmission& emission, const RayMap& map, RayCells* cells) {
  const int samples = DrawCount(200000, 4000000);
  RandomPoints random(77);
  int none = 0, other_pdf = 0;
  for (int i = 0; i < samples; ++i) {
    const auto ray = emission.SampleLe(NextUniforms(&random));
    none += !ray;
    if (!ray) continue;
    const Vec2d st = map.inverse(*ray);
    cells->At(st, SquareOf(map, ray->w)) += 1;
    const Vec3f reached = ToFloat(map.at(st.x, st.y, ToDouble(ray->w)).p);
    const double pdf = emission.PdfLe(ray->light, reached, ray->n, ray->w);
    other_pdf += std::fabs(pdf - ray->pdf) > 1e-6 * ray->pdf;
  }
  // Rounding may change the texel of a map.
  EXPECT_LE(none, samples / 1000);
  EXPECT_LE(other_pdf, samples / 2000);
  return samples;
}

void ExpectFollowsPdf(const LightSetup& setup, const RayMap& map) {
  const LightEmission emission = EmissionOf(setup);
  RayCells expected(map), observed(map);
  const double total = Integrate(emission, map, &expected);
  EXPECT_NEAR(total, 1, 5e-3) << "the integral of the pdf";
  const int samples = Count(emission, map, &observed);
  double statistic = 0, rest_expected = 0, rest_observed = 0;
  int cells = 0;
  for (size_t i = 0; i < expected.values().size(); ++i) {
    const double e = expected.values()[i] * samples / total, o = observed.values()[i];
    if (e < 8) {
      rest_expected += e;
      rest_observed += o;
      continue;
    }
    statistic += (o - e) * (o - e) / e;
    ++cells;
  }
  EXPECT_GT(cells, 30);
  EXPECT_NEAR(rest_observed, rest_expected, 5 * std::sqrt(rest_expected) + 1e-3 * samples);
  EXPECT_GT(sheaf::testing::UpperGammaQ(0.5 * (cells - 1), 0.5 * statistic),
            sheaf::testing::SidakThreshold(1e-4, 22))
      << statistic << " in " << cells << " cells";
}

TEST(LightEmissionChi2Test, RaysOfSurfacesFollowTheirPdf) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Surfaces()) {
    SCOPED_TRACE(setup.name);
    const LightTable::Impl& impl = setup.table->impl();
    // Black texels have a density but no rays; light_emission_test.cc measures the flux of images.
    if (!impl.maps.empty()) continue;
    if (!impl.triangles.empty()) ExpectFollowsPdf(setup, TriangleMap(impl.triangles[0]));
    if (!impl.spheres.empty()) ExpectFollowsPdf(setup, SphereMap(impl.spheres[0]));
    if (!impl.disks.empty()) ExpectFollowsPdf(setup, DiskMap(impl.disks[0]));
  }
}
TEST(LightEmissionChi2Test, RaysOfPositionsFollowTheirPdf) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Positions()) {
    SCOPED_TRACE(setup.name);
    ExpectFollowsPdf(setup, PositionMap());
  }
}
TEST(LightEmissionChi2Test, RaysFromInfinityFollowTheirPdf) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Infinite()) {
    SCOPED_TRACE(setup.name);
    if (setup.name == "distant") {
      ExpectFollowsPdf(
          setup,
          DistantMap(-ToDouble(std::get<DistantEmitter>(setup.table->impl().deltas[0]).to_light)));
    } else if (setup.name == "portal") {
      ExpectFollowsPdf(setup, PortalMap());
    } else if (setup.name != "two skies") {
      ExpectFollowsPdf(setup, PerpendicularMap());
    }
  }
}

}  // namespace
}  // namespace sheaf::render
