// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::render {
namespace {

constexpr double kInfinite = HUGE_VAL;
constexpr CurvePiece kWhole{};

class RandomCurves {
 public:
  double Uniform(double a, double b) {
    return a + (b - a) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  Vec3d InBox(double half) {
    return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)};
  }

 private:
  std::mt19937_64 engine_{15};
};

// Along x from 0 to `length`.
CurveSegment Straight(double length, double width0, double width1,
                      CurveSet::Kind kind = CurveSet::Kind::kFlat) {
  CurveSegment segment;
  segment.kind = kind;
  for (size_t i = 0; i < 4; ++i) segment.points[i] = {length * static_cast<double>(i) / 3, 0, 0};
  segment.widths = {width0, width1};
  return segment;
}
CurveSegment RandomSegment(RandomCurves* random, double width) {
  CurveSegment segment;
  for (Vec3d& p : segment.points) p = random->InBox(1);
  segment.widths = {width, width * random->Uniform(0.2, 1)};
  return segment;
}
std::optional<CurveHit> Intersect(const CurveSegment& segment, Vec3d o, Vec3d d) {
  return IntersectCurve(segment, kWhole, o, d, kInfinite);
}

// Returns, by sampling, the least distance across the ray from the curve's center line minus half
// its width there. If that is negative, the ray hits the curve, first at *t.
double SampledGap(const CurveSegment& segment, Vec3d o, Vec3d d, double* t) {
  constexpr int kSteps = 20000;
  double gap_min = kInfinite;
  std::array<double, 3> off{};  // The last three samples.
  *t = kInfinite;
  for (int i = 0; i <= kSteps; ++i) {
    const Vec3d c = segment.PointAt(static_cast<double>(i) / kSteps) - o;
    const double along = Dot(c, d) / LengthSquared(d);
    off = {off[1], off[2], Length(c - d * along)};
    if (i < 2 || along <= 0 || off[1] > off[0] || off[1] > off[2]) continue;
    const double gap = off[1] - 0.5 * segment.WidthAt((i - 1.0) / kSteps);
    gap_min = std::min(gap_min, gap);
    if (gap < 0) *t = std::min(*t, along);
  }
  return gap_min;
}

TEST(CurveTest, StraightCurvesAreStrips) {
  const CurveSegment strip = Straight(3, 0.4, 0.2);
  RandomCurves random;
  int hits = 0;
  constexpr int kRays = 20000;
  for (int i = 0; i < kRays; ++i) {
    const double x = random.Uniform(-0.5, 3.5), y = random.Uniform(-0.3, 0.3);
    const bool expected = x > 0 && x < 3 && std::fabs(y) < 0.5 * (0.4 - 0.2 * x / 3);
    const std::optional<CurveHit> hit = Intersect(strip, {x, y, 5}, {0, 0, -2});
    ASSERT_EQ(hit.has_value(), expected) << x << " " << y;
    if (!hit.has_value()) continue;
    ++hits;
    EXPECT_NEAR(hit->t, 2.5, 1e-14);
    EXPECT_NEAR(hit->u, x / 3, 1e-14);
    // Cross(d, dpdu) is -y here.
    EXPECT_NEAR(hit->v, 0.5 - y / (0.4 - 0.2 * x / 3), 1e-12);
  }
  EXPECT_NEAR(hits, kRays * (3 * 0.3) / (4 * 0.6), 5 * std::sqrt(kRays * 0.25));
}

// Rays of any direction against dense samples of the definition.
TEST(CurveTest, BentCurvesAreHitAccurately) {
  RandomCurves random;
  int hits = 0, judged = 0;
  for (int i = 0; i < 300; ++i) {
    const CurveSegment segment = RandomSegment(&random, i % 3 == 0 ? 0.2 : 0.02);
    const double u = random.Uniform(0.02, 0.98);
    const Vec3d aim = segment.PointAt(u) + random.InBox(segment.WidthAt(u));
    const Vec3d o = random.InBox(4), d = aim - o;
    double t = 0;
    const double gap = SampledGap(segment, o, d, &t);
    const std::optional<CurveHit> hit = Intersect(segment, o, d);
    // Skip rays that only graze.
    if (std::fabs(gap) < 0.02 * segment.widths[1]) continue;
    ++judged;
    ASSERT_EQ(hit.has_value(), gap < 0) << i;
    if (!hit.has_value()) continue;
    ++hits;
    EXPECT_NEAR(hit->t, t, 1e-4) << i;
    const CurvePoint point = CurvePointAt(segment, hit->u, hit->v, d);
    EXPECT_NEAR(Length(point.p - (o + d * hit->t)), 0, 1e-6) << i;
    EXPECT_GE(-Dot(point.n, d), 0);
    EXPECT_NEAR(Dot(point.n, point.dpdu), 0, 1e-12);
    EXPECT_NEAR(Length(point.n), 1, 1e-12);
  }
  EXPECT_GT(judged, 150);
  EXPECT_GT(hits, 80);
}

TEST(CurveTest, PiecesCoverTheWholeCurve) {
  RandomCurves random;
  for (int i = 0; i < 2000; ++i) {
    const CurveSegment segment = RandomSegment(&random, 0.05);
    const Vec3d o = random.InBox(3);
    const Vec3d d = segment.PointAt(random.Uniform(0, 1)) - o;
    const std::optional<CurveHit> whole = Intersect(segment, o, d);
    double nearest = kInfinite;
    for (uint16_t k = 0; k < kCurvePiecesMax; ++k) {
      const std::optional<CurveHit> part =
          IntersectCurve(segment, {0, k, kCurvePiecesMax}, o, d, nearest);
      if (part.has_value()) nearest = part->t;
    }
    ASSERT_TRUE(whole.has_value()) << i;
    EXPECT_NEAR(nearest, whole->t, 1e-3);
  }
}

// A ray aimed at a curve of any thinness hits it; one aimed beside it misses.
TEST(CurveTest, G10ThinCurvesAreHit) {
  RandomCurves random;
  for (const double width : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10}) {
    SCOPED_TRACE(width);
    for (int i = 0; i < 500; ++i) {
      const CurveSegment segment = RandomSegment(&random, width);
      const double u = random.Uniform(0, 1);
      const Vec3d o = random.InBox(3), aim = segment.PointAt(u);
      const Vec3d side = Normalize(Cross(aim - o, segment.TangentAt(u)));
      EXPECT_TRUE(Intersect(segment, o, aim - o).has_value()) << i;
      EXPECT_TRUE(Intersect(segment, o, aim + side * (0.49 * segment.WidthAt(u)) - o).has_value())
          << i;
      // Thick curves may bend back there, as may curves seen end on; any curve may pass again.
      const Vec3d along = Normalize(segment.TangentAt(u));
      if (width > 1e-3 || Length(Cross(along, Normalize(aim - o))) < 0.1) continue;
      const std::optional<CurveHit> beside =
          Intersect(segment, o, aim + side * (0.51 * segment.WidthAt(u)) - o);
      EXPECT_TRUE(!beside.has_value() || std::fabs(beside->u - u) > 0.01) << i;
    }
  }
}

TEST(CurveTest, G10DegenerateCurvesAreNotHit) {
  CurveSegment point = Straight(0, 1, 1);
  EXPECT_FALSE(Intersect(point, {0, 0, 5}, {0, 0, -1}).has_value());
  EXPECT_FALSE(Intersect(Straight(1, 0, 0), {0.5, 0, 5}, {0, 0, -1}).has_value());
  // A ray along the curve misses it, too; a tip of zero width is hit up to its end.
  EXPECT_FALSE(Intersect(Straight(1, 0.1, 0.1), {-1, 0, 0}, {1, 0, 0}).has_value());
  EXPECT_TRUE(Intersect(Straight(1, 0.1, 0), {0.999, 0, 5}, {0, 0, -1}).has_value());
}

// Coincident control points at the ends still give square cuts.
TEST(CurveTest, ClampedEndsAreSquare) {
  CurveSegment segment = Straight(1, 0.5, 0.5);
  segment.points[1] = segment.points[0];
  segment.points[2] = segment.points[3];
  EXPECT_TRUE(Intersect(segment, {0.001, 0.1, 1}, {0, 0, -1}).has_value());
  EXPECT_FALSE(Intersect(segment, {-0.001, 0.1, 1}, {0, 0, -1}).has_value());
  EXPECT_TRUE(Intersect(segment, {0.999, 0.1, 1}, {0, 0, -1}).has_value());
  EXPECT_FALSE(Intersect(segment, {1.001, 0.1, 1}, {0, 0, -1}).has_value());
  const CurvePoint point = CurvePointAt(segment, 0, 0.5, {0, 0, -1});
  EXPECT_GT(point.dpdu.x, 0);
  EXPECT_EQ(CurvePointAt(segment, 1, 0.5, {0, 0, -1}).dpdu.x > 0, true);
}

TEST(CurveTest, G2PowersOfTwoChangeNoBit) {
  RandomCurves random;
  for (int i = 0; i < 500; ++i) {
    CurveSegment segment = RandomSegment(&random, 0.1);
    const Vec3d o = random.InBox(3), d = segment.PointAt(0.4) - o;
    const std::optional<CurveHit> hit = Intersect(segment, o, d);
    ASSERT_TRUE(hit.has_value());
    for (const int exponent : {-20, -7, 20}) {
      const double scale = std::ldexp(1.0, exponent);
      CurveSegment scaled = segment;
      for (Vec3d& p : scaled.points) p *= scale;
      for (double& width : scaled.widths) width *= scale;
      const std::optional<CurveHit> same = Intersect(scaled, o * scale, d);
      ASSERT_TRUE(same.has_value());
      EXPECT_EQ(same->t, hit->t * scale);
      EXPECT_EQ(same->u, hit->u);
      EXPECT_EQ(same->v, hit->v);
    }
  }
}

// The visible width of a ribbon scales with the cosine.
TEST(CurveTest, RibbonsFaceAlongTheirNormals) {
  CurveSegment ribbon = Straight(2, 1, 1, CurveSet::Kind::kRibbon);
  ribbon.normals = {Vec3d{0, 0, 1}, Vec3d{0, 0.6, 0.8}};
  const auto half_width_at = [&](double x) {
    double low = 0, high = 1;
    for (int i = 0; i < 50; ++i) {
      const double y = 0.5 * (low + high);
      (Intersect(ribbon, {x, y, 3}, {0, 0, -1}).has_value() ? low : high) = y;
    }
    return low;
  };
  EXPECT_NEAR(half_width_at(1e-9), 0.5, 1e-6);
  EXPECT_NEAR(half_width_at(2 - 1e-9), 0.4, 1e-6);
  // Half way between them the angle is half.
  EXPECT_NEAR(half_width_at(1), 0.5 * std::cos(0.5 * std::acos(0.8)), 1e-9);
  const CurvePoint point = CurvePointAt(ribbon, 1, 0.5, {0, 0, -1});
  EXPECT_NEAR(Length(point.n - Vec3d{0, 0.6, 0.8}), 0, 1e-12);
  // From behind the ribbon has the same normal.
  EXPECT_NEAR(CurvePointAt(ribbon, 1, 0.5, {0, 0, 1}).n.z, 0.8, 1e-12);
}

// Normals of a round thread point outwards at the sides and towards the ray in the middle.
TEST(CurveTest, CylinderNormalsTurnToTheSides) {
  const CurveSegment thread = Straight(2, 1, 1, CurveSet::Kind::kCylinder);
  const Vec3d d{0, 0, -1};
  for (const double y : {-0.49, -0.2, 0.0, 0.3, 0.49}) {
    const std::optional<CurveHit> hit = Intersect(thread, {1, y, 5}, d);
    ASSERT_TRUE(hit.has_value());
    const CurvePoint point = CurvePointAt(thread, hit->u, hit->v, d);
    EXPECT_NEAR(point.n.y, std::sin(std::numbers::pi * y), 1e-12);
    EXPECT_NEAR(point.n.z, std::cos(std::numbers::pi * y), 1e-12);
    EXPECT_NEAR(point.p.y, y, 1e-12);
    EXPECT_NEAR(point.dpdu.x, 2, 1e-12);
  }
}

TEST(CurveTest, BoundsContainThePieces) {
  RandomCurves random;
  for (int i = 0; i < 300; ++i) {
    const CurveSegment segment = RandomSegment(&random, 0.3);
    const Affine place{{2, 1, 0}, {0, 0.5, 0.3}, {1, 0, -1}, {5, -3, 1}};
    const Affine back = Inverse(place);
    std::vector<CurvePiece> pieces;
    SplitCurve(segment, 0, place, &pieces);
    ASSERT_LE(pieces.size(), kCurvePiecesMax);
    const CurvePiece& piece = pieces[static_cast<size_t>(i) % pieces.size()];
    const std::array<Vec3f, 2> bounds = CurveBounds(segment, piece, place);
    const double u = (piece.index + random.Uniform(0, 1)) / piece.count;
    const Vec3d aim = segment.PointAt(u) + random.InBox(0.1), o = random.InBox(3);
    const std::optional<CurveHit> hit = IntersectCurve(segment, piece, o, aim - o, kInfinite);
    if (!hit.has_value()) continue;
    const Vec3d on = place.Point(o + (aim - o) * hit->t);
    EXPECT_NEAR(Length(back.Point(on) - (o + (aim - o) * hit->t)), 0, 1e-12);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_GE(on[k], bounds[0][k]);
      EXPECT_LE(on[k], bounds[1][k]);
    }
  }
}

// Sorting moves whole segments, makes neighbors adjacent, and loses none.
TEST(CurveTest, SortingKeepsSegments) {
  RandomCurves random;
  CurveSet curves;
  curves.kind = CurveSet::Kind::kRibbon;
  for (int i = 0; i < 512; ++i) {
    const Vec3f at = ToFloat(random.InBox(1));
    const auto mark = static_cast<float>(i);
    for (int k = 0; k < 4; ++k) curves.points.push_back(at);
    curves.widths.insert(curves.widths.end(), {mark, at.x});
    curves.normals.insert(curves.normals.end(), {at, {mark, 0, 0}});
  }
  const auto path_length = [&curves] {
    double length = 0;
    for (size_t i = 1; i < curves.size(); ++i) {
      length += static_cast<double>(Length(curves.points[4 * i] - curves.points[4 * i - 1]));
    }
    return length;
  };
  const double before = path_length();
  SortCurves(&curves);
  EXPECT_LT(path_length(), 0.3 * before);
  std::vector<bool> seen(512);
  ASSERT_EQ(curves.size(), 512u);
  for (size_t i = 0; i < 512; ++i) {
    seen[static_cast<size_t>(curves.widths[2 * i])] = true;
    EXPECT_EQ(curves.widths[2 * i + 1], curves.points[4 * i].x);
    EXPECT_EQ(curves.normals[2 * i], curves.points[4 * i]);
    EXPECT_EQ(curves.normals[2 * i + 1].x, curves.widths[2 * i]);
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 512);
}

// A segment along an axis stays whole; a diagonal hair is split as often as allowed.
TEST(CurveTest, OnlySlantedCurvesAreSplit) {
  std::vector<CurvePiece> pieces;
  SplitCurve(Straight(1, 1e-3, 1e-3), 3, {}, &pieces);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].segment, 3u);
  pieces.clear();
  CurveSegment slanted = Straight(1, 1e-3, 1e-3);
  for (Vec3d& p : slanted.points) p = {p.x, p.x, p.x};
  SplitCurve(slanted, 0, {}, &pieces);
  EXPECT_EQ(pieces.size(), kCurvePiecesMax);
}

// A ray that hits a piece also hits its rod, under any transform; for thin hair, rods reject most
// of the rays that hit boxes.
TEST(CurveTest, RodsContainEveryHit) {
  RandomCurves random;
  int hits = 0, passed_by = 0, rejected = 0;
  for (int i = 0; i < 2000; ++i) {
    const bool is_hair = i % 2 == 0;
    CurveSegment segment = RandomSegment(&random, is_hair ? 1e-3 : random.Uniform(0.01, 0.5));
    if (is_hair) {  // Nearly straight.
      segment.points[1] = segment.points[0] * (2.0 / 3) + segment.points[3] * (1.0 / 3);
      segment.points[2] = segment.points[0] * (1.0 / 3) + segment.points[3] * (2.0 / 3);
      segment.points[1] += random.InBox(1e-3);
    }
    segment.kind = static_cast<CurveSet::Kind>(i % 3);
    segment.normals = {Vec3d{0, 0, 1}, Vec3d{0, 1, 0}};
    Affine transform{random.InBox(2), random.InBox(2), random.InBox(2), random.InBox(100)};
    if (std::fabs(transform.Determinant()) < 0.1) continue;
    const Affine back = Inverse(transform);
    const CurvePiece piece{0, static_cast<uint16_t>(i % 4), 4};
    const CurveRod rod = RodAbout(segment, piece, transform);
    const std::array<Vec3f, 2> box = CurveBounds(segment, piece, transform);
    for (int k = 0; k < 100; ++k) {
      const Vec3d o = transform.offset + random.InBox(10);
      // Half the rays are aimed at the piece's width, half at its box.
      Vec3d target;
      if (k % 2 == 0) {
        const double u = (piece.index + random.Uniform(0, 1)) / 4;
        target = transform.Point(segment.PointAt(u) + random.InBox(0.3) * segment.WidthAt(u));
      } else {
        for (size_t c = 0; c < 3; ++c) {
          target[c] =
              random.Uniform(static_cast<double>(box[0][c]), static_cast<double>(box[1][c]));
        }
      }
      // Rays have float precision.
      const Vec3d from = ToDouble(ToFloat(o)), d = ToDouble(ToFloat(target - o));
      const bool may = MayIntersect(rod, from, d);
      if (IntersectCurve(segment, piece, back.Point(from), back.Vector(d), kInfinite)) {
        ++hits;
        ASSERT_TRUE(may);
      } else if (is_hair && k % 2 == 1) {
        ++passed_by;
        rejected += !may;
      }
    }
  }
  EXPECT_GT(hits, 20000);
  EXPECT_GT(rejected, 0.95 * passed_by);
}

}  // namespace
}  // namespace sheaf::render
