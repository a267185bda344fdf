// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests every light sampler against its own pdf by Pearson's chi-square: samples are counted in
// cells of a smooth map of the shape's surface (of the square, for environment maps), and the pdf,
// transformed to that map by the exact Jacobian, is integrated over each cell. Cells with fewer
// than 5 expected samples are pooled. The statistic is converted to a normal deviate (Wilson and
// Hilferty 1931); with about 40 tests and a bound of 5 a correct sampler fails for one seed in
// 80000, and the seeds are fixed. The tests also check that the pdfs of Sample and of PdfEmitter
// are equal to the bit, and that the mean of 1/pdf is the solid angle.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "tests/support/light_tables.h"
#include "tests/support/long_tests.h"
#include "worker/render/light/environment_map.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::kWhite;
using testing::MakeTable;
using testing::RandomPoints;

constexpr int kCells = 12;     // Per axis.
constexpr int kSubCells = 48;  // Midpoint rule within a cell.
constexpr double kDeviateMax = 5;

int SampleCount() { return DrawCount(100000, 4000000); }

double ChiSquareDeviate(const std::vector<double>& observed, const std::vector<double>& expected) {
  double statistic = 0, pooled_observed = 0, pooled_expected = 0;
  int cells = 0;
  const auto add = [&](double o, double e) {
    statistic += (o - e) * (o - e) / e;
    ++cells;
  };
  for (size_t i = 0; i < observed.size(); ++i) {
    EXPECT_TRUE(expected[i] > 0 || observed[i] == 0) << "samples where the pdf is 0";
    if (expected[i] >= 5) {
      add(observed[i], expected[i]);
    } else {
      pooled_observed += observed[i];
      pooled_expected += expected[i];
    }
  }
  if (pooled_expected >= 5) add(pooled_observed, pooled_expected);
  const double k = cells - 1;
  return (std::cbrt(statistic / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
}

// A smooth map of the light's surface: from the square to point and normal, with the area element.
struct SurfacePoint {
  Vec3d p, n;
  double area = 0;  // d(area) / d(s, t).
};
struct Surface {
  std::function<SurfacePoint(double s, double t)> at;
  std::function<Vec2d(Vec3d p)> inverse;
};

Vec3f UnitTo(Vec3d from, Vec3d to) { return ToFloat((to - from) / Length(to - from)); }

void ExpectMatches(const LightTable& table, uint32_t emitter, const Surface& surface, Vec3f p,
                   uint64_t seed) {
  const double sample_count = SampleCount();
  const size_t cell_count = static_cast<size_t>(kCells) * kCells;
  std::vector<double> expected(cell_count), observed(cell_count);
  const Vec3d pd = ToDouble(p);
  double solid_angle = 0, total = 0;
  constexpr int kFine = kCells * kSubCells;
  for (int y = 0; y < kFine; ++y) {
    for (int x = 0; x < kFine; ++x) {
      const SurfacePoint point = surface.at((x + 0.5) / kFine, (y + 0.5) / kFine);
      const Vec3d l = point.p - pd;
      const double d = Length(l);
      const double to_solid_angle =
          std::fabs(Dot(l, point.n)) * point.area / (d * d * d * kFine * kFine);
      const double pdf = static_cast<double>(
          table.PdfEmitter<kAllTraits>(emitter, p, {}, UnitTo(pd, point.p), ToFloat(point.p)));
      expected[static_cast<size_t>(y / kSubCells * kCells + x / kSubCells)] +=
          pdf * to_solid_angle * sample_count;
      total += pdf * to_solid_angle;
      solid_angle += to_solid_angle;
    }
  }
  EXPECT_NEAR(total, 1, 2e-3) << "the pdf's integral";
  RandomPoints random(seed);
  double inverse_pdf_sum = 0, inverse_pdf_squares = 0;
  int different_bits = 0;
  for (int i = 0; i < SampleCount(); ++i) {
    const auto sample = table.Sample<kAllTraits>(p, {}, random.Next(), random.Next2());
    if (!sample) continue;
    different_bits +=
        sample->pdf != table.PdfEmitter<kAllTraits>(emitter, p, {}, sample->wi, sample->p_light);
    const Vec2d st = surface.inverse(ToDouble(sample->p_light));
    const int x = std::clamp(static_cast<int>(st.x * kCells), 0, kCells - 1);
    const int y = std::clamp(static_cast<int>(st.y * kCells), 0, kCells - 1);
    observed[static_cast<size_t>(y * kCells + x)] += 1;
    const double inverse_pdf = 1 / static_cast<double>(sample->pdf);
    inverse_pdf_sum += inverse_pdf;
    inverse_pdf_squares += inverse_pdf * inverse_pdf;
  }
  EXPECT_EQ(different_bits, 0);
  const double scale = total;  // Corrects the midpoint rule's own error.
  for (double& e : expected) e /= scale;
  EXPECT_LE(ChiSquareDeviate(observed, expected), kDeviateMax);
  const double mean = inverse_pdf_sum / sample_count;
  const double variance = std::max(inverse_pdf_squares / sample_count - mean * mean, 0.0);
  EXPECT_NEAR(mean, solid_angle, 5 * std::sqrt(variance / sample_count) + 2e-3 * solid_angle);
}

Surface TriangleSurface(const TriangleEmitter& t) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2);
  const double twice_area = Length(normal);
  const Vec3d n = normal / twice_area;
  return {[=](double s, double v) {
            return SurfacePoint{v0 + s * (1 - v) * e1 + v * e2, n, twice_area * (1 - v)};
          },
          [=](Vec3d p) {
            const Vec3d q = p - v0;
            const double b1 = Dot(Cross(q, e2), n) / twice_area;
            const double b2 = Dot(Cross(e1, q), n) / twice_area;
            return Vec2d{b2 < 1 ? b1 / (1 - b2) : 0.0, b2};
          }};
}

TEST(LightChi2Test, Triangles) {
  const TriangleEmitter triangles[] = {
      {{-1, -1, 2}, {1.5f, -0.5f, 2.2f}, {0.2f, 1.4f, 1.7f}, kWhite, true},
      {{-1, -1, 0.2f}, {3, -0.5f, 0.2f}, {0.2f, 2, 0.2f}, kWhite, true},  // Close: 4 sr.
      {{100, 0, 0}, {100, 1, 0}, {100, 0, 1}, kWhite, true},              // Far.
      {{2, 0, 0}, {2, 1, 0}, {2, 0.5f, 1e-3f}, kWhite, true},             // A needle.
      {{-5, -5, -0.2f}, {5, -5, -0.2f}, {0, 7, -0.2f}, kWhite, true},     // Nearly a hemisphere.
      {{1e6f, 0, 0}, {1e6f, 1, 0}, {1e6f, 0, 1}, kWhite, true},
      {{1, 0.01f, 0}, {3, 0.01f, 0}, {1, 0.01f, 2}, kWhite, true},  // Grazing.
      {{3e7f, 0, 0}, {3e7f, 1, 0}, {3e7f, 0, 2}, kWhite, true},     // By area.
  };
  uint64_t seed = 100;
  for (const TriangleEmitter& t : triangles) {
    SCOPED_TRACE(seed);
    LightTableInput input;
    input.triangles = {t};
    Vec3f p{0, 0, 0};
    // For a distant triangle, p_light must have enough bits to distinguish the cells: the receiver
    // is moved instead.
    const auto table = MakeTable(input);
    if (t.v0.x > 1e5f) {
      const Vec3f far = t.v0;
      for (Vec3f* v : {&input.triangles[0].v0, &input.triangles[0].v1, &input.triangles[0].v2}) {
        *v -= far;
      }
      p = -far;
      ExpectMatches(*MakeTable(input), 0, TriangleSurface(input.triangles[0]), p, seed++);
      continue;
    }
    ExpectMatches(*table, 0, TriangleSurface(t), p, seed++);
  }
}

// The part of a sphere's surface visible from p (all of it if p is inside), in polar coordinates
// about the point nearest to p, where cells are densest.
Surface SphereSurface(const SphereEmitter& s, Vec3d p) {
  const Vec3d to_p = p - s.center;
  const double d = Length(to_p);
  const Vec3d axis = to_p / d;
  const Frame frame = Frame::FromNormal(ToFloat(axis));
  const Vec3d x = ToDouble(frame.t), y = ToDouble(frame.b);
  const double low = d > s.radius ? s.radius / d : -1.0;
  const double r = s.radius;
  const Vec3d c = s.center;
  return {[=](double u, double v) {
            const double below_pole = (1 - low) * (1 - u) * (1 - u);
            const double z = 1 - below_pole, rho = std::sqrt(below_pole * (2 - below_pole));
            const Vec3d n =
                z * axis + rho * std::cos(2 * kPi * v) * x + rho * std::sin(2 * kPi * v) * y;
            return SurfacePoint{c + r * n, n, 2 * (1 - u) * (1 - low) * 2 * kPi * r * r};
          },
          [=](Vec3d q) {
            const Vec3d n = (q - c) / r;
            const double phi = std::atan2(Dot(n, y), Dot(n, x)) / (2 * kPi);
            const double below_pole = 0.5 * LengthSquared(n - axis);
            return Vec2d{1 - std::sqrt(below_pole / (1 - low)), phi < 0 ? phi + 1 : phi};
          }};
}

TEST(LightChi2Test, Spheres) {
  uint64_t seed = 200;
  for (double d : {1.05, 1.5, 3.0, 100.0, 1e4}) {
    SCOPED_TRACE(d);
    LightTableInput input;
    input.spheres = {{{0, 0, 0}, 1, kWhite}};
    const Vec3d p{0.6 * d, 0, 0.8 * d};
    ExpectMatches(*MakeTable(input), 0, SphereSurface(input.spheres[0], ToDouble(ToFloat(p))),
                  ToFloat(p), seed++);
  }
  for (double d : {0.1, 0.5, 0.9}) {
    SCOPED_TRACE(d);
    LightTableInput input;
    input.spheres = {{{0, 0, 0}, 1, kWhite, false, true}};
    const Vec3d p{0.6 * d, 0, 0.8 * d};
    ExpectMatches(*MakeTable(input), 0, SphereSurface(input.spheres[0], ToDouble(ToFloat(p))),
                  ToFloat(p), seed++);
  }
}

Surface DiskSurface(const DiskEmitter& d) {
  const Vec3d axis_y = Cross(d.normal, d.axis_x);
  const double inner = d.inner_radius * d.inner_radius, outer = d.radius * d.radius;
  const DiskEmitter disk = d;
  return {[=](double u, double v) {
            const double r = std::sqrt(inner + (outer - inner) * u);
            return SurfacePoint{disk.center + r * std::cos(2 * kPi * v) * disk.axis_x +
                                    r * std::sin(2 * kPi * v) * axis_y,
                                disk.normal, kPi * (outer - inner)};
          },
          [=](Vec3d q) {
            const double x = Dot(q - disk.center, disk.axis_x), y = Dot(q - disk.center, axis_y);
            const double phi = std::atan2(y, x) / (2 * kPi);
            return Vec2d{(x * x + y * y - inner) / (outer - inner), phi < 0 ? phi + 1 : phi};
          }};
}

TEST(LightChi2Test, Disks) {
  const Vec3f receivers[] = {{0, 0, 1},          {0.3f, 0.2f, 0.2f}, {0.95f, 0, 0.3f},
                             {1.3f, 0.4f, 0.5f}, {2.5f, 1, -0.7f},   {3.f, 0, 10},
                             {0, 300, 400},      {0, 0, 3}};
  uint64_t seed = 300;
  for (const Vec3f& p : receivers) {
    SCOPED_TRACE(seed);
    LightTableInput input;
    input.disks = {{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, 1, 0, kWhite, true}};
    ExpectMatches(*MakeTable(input), 0, DiskSurface(input.disks[0]), p, seed++);
  }
}

// The pdf of a nearby ring includes the directions to its hole, so it integrates to 1 only far
// away.
TEST(LightChi2Test, RingFarAway) {
  LightTableInput input;
  input.disks = {{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, 1, 0.6, kWhite, true}};
  ExpectMatches(*MakeTable(input), 0, DiskSurface(input.disks[0]), {2, 3, 6}, 400);
}

// --- Environment maps --------------------------------------------------------------------------

std::vector<Rgb> RandomTexels(int size, uint64_t seed) {
  RandomPoints random(seed);
  std::vector<Rgb> texels(static_cast<size_t>(size) * static_cast<size_t>(size));
  for (Rgb& texel : texels) {
    const float bright = random.Next();
    // Strong contrast: a few texels carry most of the light, and a quarter are black.
    const float value = bright < 0.25f ? 0 : bright * bright * bright * bright;
    texel = {value, value * random.Next(), value * random.Next()};
  }
  return texels;
}

void ExpectMapMatches(int size, const std::vector<Rgb>& texels, uint64_t seed) {
  const auto map = EnvironmentMap::Make(size, texels);
  ASSERT_TRUE(map.ok()) << map.status();
  constexpr int kMapCells = 24;
  const size_t cell_count = static_cast<size_t>(kMapCells) * kMapCells;
  std::vector<double> expected(cell_count), observed(cell_count);
  // A multiple of the quarter texels that make up the pdf, if the size is a power of two.
  constexpr int kFineInCell = 32, kFine = kMapCells * kFineInCell;
  double total = 0;
  int unreachable = 0;
  for (int y = 0; y < kFine; ++y) {
    for (int x = 0; x < kFine; ++x) {
      const Vec3f d = ToFloat(EqualAreaSquareToSphere({(x + 0.5) / kFine, (y + 0.5) / kFine}));
      const double pdf = static_cast<double>(map->Pdf(d));
      unreachable += pdf == 0 && !map->Radiance(d).IsBlack();
      const double mass = pdf * 4 * kPi / (double{kFine} * kFine);
      expected[static_cast<size_t>(y / kFineInCell * kMapCells + x / kFineInCell)] +=
          mass * SampleCount();
      total += mass;
    }
  }
  EXPECT_NEAR(total, 1, 2e-3);
  EXPECT_EQ(unreachable, 0);
  RandomPoints random(seed);
  int different_pdfs = 0;
  for (int i = 0; i < SampleCount(); ++i) {
    const EnvironmentMap::PlaceSample sample = map->Sample(random.Next2());
    const Vec3f d = ToFloat(map->Direction(sample.place));
    EXPECT_NEAR(Length(d), 1, 1e-6);
    ASSERT_GT(sample.pdf, 0);
    ASSERT_EQ(map->Pdf(sample.place), sample.pdf);
    // Rounding may move a point across the edge of its square.
    different_pdfs += map->Pdf(d) != sample.pdf;
    const Vec2f st = EqualAreaSphereToSquare(d);
    const int x = std::min(static_cast<int>(st.x * kMapCells), kMapCells - 1);
    const int y = std::min(static_cast<int>(st.y * kMapCells), kMapCells - 1);
    observed[static_cast<size_t>(y * kMapCells + x)] += 1;
  }
  EXPECT_LE(different_pdfs, SampleCount() / 2000);
  for (double& e : expected) e = std::max(e / total, 1e-12);
  EXPECT_LE(ChiSquareDeviate(observed, expected), kDeviateMax);
}

TEST(LightChi2Test, EnvironmentMaps) {
  for (int size : {1, 2, 3, 7, 16, 64}) {
    SCOPED_TRACE(size);
    ExpectMapMatches(size, RandomTexels(size, 900 + static_cast<uint64_t>(size)),
                     500 + static_cast<uint64_t>(size));
  }
  std::vector<Rgb> one_bright(256);
  one_bright[16 * 5 + 9] = {1e6f, 1e6f, 1e6f};
  ExpectMapMatches(16, one_bright, 600);
  one_bright.assign(256, {1e-3f, 1e-3f, 1e-3f});
  one_bright[0] = {50, 50, 50};
  ExpectMapMatches(16, one_bright, 601);
}

TEST(LightChi2Test, ConstantSkyIsUniform) {
  const auto table = MakeTable({}, {testing::MakeSky(kWhite)});
  constexpr int kSkyCells = 16;
  std::vector<double> observed(kSkyCells * kSkyCells),
      expected(kSkyCells * kSkyCells, double(SampleCount()) / (kSkyCells * kSkyCells));
  RandomPoints random(700);
  for (int i = 0; i < SampleCount(); ++i) {
    const auto sample = table->Sample<kAllTraits>({}, {}, random.Next(), random.Next2());
    ASSERT_TRUE(sample.has_value());
    ASSERT_EQ(sample->pdf, table->PdfEnvironment<kAllTraits>({}, {}, sample->wi));
    const Vec2f st = EqualAreaSphereToSquare(sample->wi);
    const int x = std::min(static_cast<int>(st.x * kSkyCells), kSkyCells - 1);
    const int y = std::min(static_cast<int>(st.y * kSkyCells), kSkyCells - 1);
    observed[static_cast<size_t>(y * kSkyCells + x)] += 1;
  }
  EXPECT_LE(ChiSquareDeviate(observed, expected), kDeviateMax);
}

}  // namespace
}  // namespace sheaf::render
