// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests of chains through smooth interfaces: irradiance behind a slab, a ball and in a concave
// mirror in closed form, with all of their solutions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <iterator>
#include <string>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/test_scene.h"
#include "worker/render/plan/chain_shapes.h"

namespace sheaf::render {
namespace {

constexpr TechniqueSet kChained{Technique::kChains};
constexpr double kGlass = 1.5, kAlbedo = 0.5, kRadiance = 1e5, kLampRadius = 0.01;
// The intensity of a lamp.
constexpr double kIntensity = kRadiance * kPi * kLampRadius * kLampRadius;

int32_t AddGlass(TestScene* t) {
  DielectricMaterial glass;
  glass.eta.mean = static_cast<float>(kGlass);
  return t->AddMaterial(glass);
}
int32_t AddMirror(TestScene* t) {
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  return t->AddMaterial(mirror);
}
SphereShape Ball(double radius) {
  const auto r = static_cast<float>(radius);
  return {r, -r, r, 360};
}
void AddLamp(TestScene* t, Vec3d p, double radius = kLampRadius, double radiance = kRadiance) {
  const int32_t light = t->AreaLight(Rgb::Gray(static_cast<float>(radiance)));
  t->AddShape(Ball(radius), t->Diffuse({}), TranslateMatrix(p)).area_light = light;
}
// A diffuse square about p that faces upwards.
void AddTable(TestScene* t, Vec3d p, double half) {
  const Vec3f c = ToFloat(p);
  const auto h = static_cast<float>(half);
  const int32_t quad = t->Quad({c.x - h, c.y, c.z - h}, {c.x - h, c.y, c.z + h},
                               {c.x + h, c.y, c.z + h}, {c.x + h, c.y, c.z - h});
  t->AddShape(MeshShape{quad}, t->Diffuse(Rgb::Gray(static_cast<float>(kAlbedo))));
}

// The irradiance that the camera sees, within 3 standard errors; the lamp's size changes it by a
// part of 1e-4.
void ExpectIrradiance(const TestScene& t, int32_t max_depth, uint64_t samples, double expected) {
  FrameSettings settings = SquareSettings(4, samples, max_depth);
  settings.techniques = kChained;
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    settings.color = color;
    RenderStats stats;
    const TileMean mean = MeanOf(RenderAll(*Compile(t.scene, settings), &stats));
    const double scale = kPi / kAlbedo;
    const double measured = static_cast<double>(mean.mean.g) * scale;
    const double error = static_cast<double>(mean.standard_error.g) * scale;
    EXPECT_NEAR(measured, expected, 3 * error + 3e-4 * expected);
    EXPECT_LT(error, 0.03 * expected);
    EXPECT_EQ(mean.non_finite, 0u);
    EXPECT_EQ(stats.capped_chains, 0u);
    EXPECT_GT(stats.chains, 0u);
    std::printf("irradiance %.6g, expected %.6g, error %.2g; %.3g trials a chain\n", measured,
                expected, error,
                static_cast<double>(stats.chain_trials) / static_cast<double>(stats.chains));
  }
}

double Transmittance(double sine) {
  const double ci = std::sqrt(1 - sine * sine), ct = std::sqrt(1 - sine * sine / (kGlass * kGlass));
  const double s = (ci - kGlass * ct) / (ci + kGlass * ct),
               p = (kGlass * ci - ct) / (kGlass * ci + ct);
  return 1 - (s * s + p * p) / 2;
}

// Behind a slab of thickness h, with `air` above and below together, at a distance r from the point
// below the lamp: the cone of light at the angle a from the normal covers the ring about r(a).
double SlabIrradiance(double air, double h, double r) {
  const auto reached = [&](double a) {
    const double sine = std::sin(a) / kGlass;
    return air * std::tan(a) + h * sine / std::sqrt(1 - sine * sine);
  };
  double low = 0, high = 1.5;
  for (int i = 0; i < 100; ++i) {
    const double middle = (low + high) / 2;
    (reached(middle) < r ? low : high) = middle;
  }
  const double a = low, sine = std::sin(a) / kGlass, cosine = std::sqrt(1 - sine * sine);
  const double by_angle =
      air / (std::cos(a) * std::cos(a)) + h * std::cos(a) / (kGlass * cosine * cosine * cosine);
  const double through = Transmittance(std::sin(a));
  return kIntensity * through * through * std::sin(a) / (r * by_angle);
}

// A mesh whose triangles are each cut into four.
void SplitTriangles(TriangleMesh* mesh) {
  std::vector<uint32_t> indices;
  for (size_t i = 0; i < mesh->indices.size(); i += 3) {
    const uint32_t* t = &mesh->indices[i];
    const auto next = static_cast<uint32_t>(mesh->positions.size());
    for (size_t k = 0; k < 3; ++k) {
      mesh->positions.push_back((mesh->positions[t[k]] + mesh->positions[t[(k + 1) % 3]]) * 0.5f);
    }
    const uint32_t cut[] = {t[0],     next, next + 2, next, t[1],     next + 1,
                            next + 1, t[2], next + 2, next, next + 1, next + 2};
    indices.insert(indices.end(), std::begin(cut), std::end(cut));
  }
  mesh->indices = indices;
}

TEST(ChainsTest, ASlabShiftsTheLamp) {
  for (const bool is_split : {false, true}) {
    TestScene t({1.5, 0.5, -0.7}, {1.2, 0, 0}, 0.5f);
    AddTable(&t, {0, 0, 0}, 10);
    const int32_t box = t.Box({-8, 1, -8}, {8, 1.5f, 8});
    for (int i = 0; is_split && i < 3; ++i) SplitTriangles(&t.scene.meshes[box]);
    t.AddShape(MeshShape{box}, AddGlass(&t));
    AddLamp(&t, {0, 3, 0});
    ExpectIrradiance(t, 3, 1024, SlabIrradiance(2.5, 0.5, 1.2));
  }
}

// Behind a ball at the origin, in the plane below it, at the distance r from the axis of the ball
// and the lamp: all cones of light about the axis that reach that ring. *count: their number.
double BallIrradiance(double lamp_height, double plane_height, double r, int* count) {
  struct Reached {
    bool is_below = false;
    double r = 0, transmittance = 0;
  };
  const auto reach = [&](double a) -> Reached {
    const Vec3d d{std::sin(a), -std::cos(a), 0}, o{0, lamp_height, 0};
    const double along = Dot(o, d), inside = along * along - (Dot(o, o) - 1);
    if (!(inside > 0)) return {};
    const Vec3d p = o + d * (-along - std::sqrt(inside));
    const double cos_i = -Dot(d, p), sine = std::sqrt(1 - cos_i * cos_i);
    const double cos_t = std::sqrt(1 - sine * sine / (kGlass * kGlass));
    const Vec3d in = d * (1 / kGlass) + p * (cos_i / kGlass - cos_t);
    const Vec3d q = p + in * (2 * cos_t);
    // It leaves at the angle at which it came.
    const Vec3d out = in * kGlass + q * (cos_i - kGlass * cos_t);
    if (!(out.y < 0)) return {};
    const double through = Transmittance(sine);
    return {true, q.x + out.x * ((plane_height - q.y) / out.y), through * through};
  };
  constexpr int kSteps = 100000;
  double sum = 0;
  for (int i = 1; i < kSteps; ++i) {
    const double step = std::asin(1 / lamp_height) / kSteps, a = step * i;
    const Reached low = reach(a), high = reach(a + step);
    if (!low.is_below || !high.is_below) continue;
    if ((std::fabs(low.r) < r) == (std::fabs(high.r) < r)) continue;
    ++*count;
    sum += kIntensity * low.transmittance * std::sin(a) * step / (r * std::fabs(high.r - low.r));
  }
  return sum;
}

// In the caustic, in the shadow beside it, and at the foot of the ball, where light leaves the ball
// along its surface: 3 to 8 degrees from it.
TEST(ChainsTest, ABallGathersLight) {
  struct Case {
    double gap, r;
    int chains;
    uint64_t samples;
  };
  constexpr double kHeight = 6;
  for (const Case& in :
       {Case{0.2, 0.05, 3, 1024}, Case{0.2, 0.5, 1, 4096}, Case{0.02, 0.05, 3, 1024}}) {
    TestScene t({-3, 0.3, 0}, {in.r, 0, 0}, 0.002f);
    AddTable(&t, {in.r, 0, 0}, 0.01);
    t.AddShape(Ball(1), AddGlass(&t), TranslateMatrix({0, 1 + in.gap, 0}));
    AddLamp(&t, {0, 1 + in.gap + kHeight, 0}, 1e-3, kRadiance * 100);
    int count = 0;
    const double expected = BallIrradiance(kHeight, -1 - in.gap, in.r, &count);
    EXPECT_EQ(count, in.chains);
    ExpectIrradiance(t, 3, in.samples, expected);
  }
}

// In a mirrored sphere, all reflections to the point lie in the plane through it, the lamp and the
// center (Alhazen's problem). By the mirror's two foci each spreads light in two ways.
double MirrorIrradiance(Vec3d x, Vec3d y, double radius, int* count) {
  const Vec3d e1 = Normalize(x), e2 = Normalize(y - e1 * Dot(e1, y));
  const auto at = [&](double a) { return (e1 * std::cos(a) + e2 * std::sin(a)) * radius; };
  const auto miss = [&](double a) {
    const Vec3d p = at(a), along = e2 * std::cos(a) - e1 * std::sin(a);
    return Dot(Normalize(x - p) + Normalize(y - p), along);
  };
  double sum = kIntensity * (y - x).y / std::pow(Length(y - x), 3);
  constexpr int kSteps = 10000;
  for (int i = 0; i < kSteps; ++i) {
    double low = 2 * kPi * i / kSteps, high = 2 * kPi * (i + 1) / kSteps;
    if ((miss(low) > 0) == (miss(high) > 0)) continue;
    for (int k = 0; k < 60; ++k) {
      const double middle = (low + high) / 2;
      ((miss(middle) > 0) == (miss(low) > 0) ? low : high) = middle;
    }
    const Vec3d p = at(low);
    const double s = Length(p - x), t = Length(y - p), up = (p - x).y / s;
    if (up <= 0) continue;
    ++*count;
    const double cosine = Dot(Normalize(x - p), p * (-1 / radius));
    const double in_plane = s + t - 2 * s * t / (radius * cosine);
    const double across = s + t - 2 * s * t * cosine / radius;
    sum += kIntensity * up / std::fabs(in_plane * across);
  }
  return sum;
}

TEST(ChainsTest, AConcaveMirrorHasAllOfItsImages) {
  struct Case {
    Vec3d x, y;
    int images;
  };
  for (const Case& in : {Case{{0.5, -1.4, 0.1}, {-0.9, -1.2, 0.2}, 1},
                         Case{{0.3, -1.6, 0.1}, {-0.3, 1.5, 0.2}, 3}}) {
    int images = 0;
    const double expected = MirrorIrradiance(in.x, in.y, 2, &images);
    EXPECT_EQ(images, in.images);
    TestScene t(in.x + Vec3d{0.2, 0.5, -0.2}, in.x, 0.2f);
    AddTable(&t, in.x, 0.01);
    t.AddShape(Ball(2), AddMirror(&t));
    AddLamp(&t, in.y);
    ExpectIrradiance(t, 2, 2048, expected);
  }
}

// --- The plan
// --------------------------------------------------------------------------------------

TEST(ChainsTest, ThePlanChoosesCastersAndLamps) {
  TestScene t({0, 1, -3}, {0, 0, 0}, 40);
  AddTable(&t, {0, 0, 0}, 3);
  AddLamp(&t, {0, 3, 0});
  t.AddShape(Ball(0.5), AddGlass(&t), TranslateMatrix({0, 1, 0}));
  const ChainShapes shapes = FindChainShapes(t.scene);
  EXPECT_EQ(shapes.casters, std::vector<int32_t>{2});
  EXPECT_EQ(shapes.lamps, std::vector<int32_t>{1});
  AddLamp(&t, {0, 5, 0}, 1);
  t.AddShape(Ball(0.1), AddGlass(&t)).world_from_object.end = TranslateMatrix({1, 0, 0});
  const ChainShapes more = FindChainShapes(t.scene);
  EXPECT_EQ(more.casters, shapes.casters);
  EXPECT_EQ(more.lamps, shapes.lamps);
  ASSERT_EQ(more.notes.size(), 3u);
  EXPECT_THAT(more.notes[1], ::testing::HasSubstr("it moves"));
  EXPECT_THAT(more.notes[2], ::testing::HasSubstr("it is large"));
}

// The light paths that leave seeds are those of the scene, whichever tile comes first.
TEST(ChainsTest, TilesAreThoseOfTheWholeFrame) {
  TestScene t({0, 1, -3}, {0, 0, 0}, 40);
  AddTable(&t, {0, 0, 0}, 3);
  AddLamp(&t, {0, 3, 0}, 0.05);
  t.AddShape(Ball(0.5), AddGlass(&t), TranslateMatrix({0, 1, 0}));
  FrameSettings settings = SquareSettings(8, 16, 5);
  settings.techniques = kChained;
  const FilmTile whole = RenderAll(*Compile(t.scene, settings));
  const PixelRect corner{4, 4, 8, 8};
  const absl::StatusOr<FilmTile> tile =
      RenderTilePass(*Compile(t.scene, settings), corner, {0, settings.samples}, {}, nullptr);
  ASSERT_TRUE(tile.ok()) << tile.status();
  for (size_t y = 0; y < 4; ++y) {
    for (size_t x = 0; x < 4; ++x) {
      EXPECT_EQ(tile->channel(FilmChannel::kGreenHi)[y * 4 + x],
                whole.channel(FilmChannel::kGreenHi)[(y + 4) * 8 + x + 4]);
    }
  }
}

// Where nothing casts light, chains change nothing.
TEST(ChainsTest, WithoutCastersTheImageIsThatOfCameraPaths) {
  FrameSettings settings = SquareSettings(8, 16, 5);
  settings.force_generic_variant = true;
  const TileMean camera = MeanOf(RenderAll(*Compile(LitRoom(1).scene, settings)));
  settings.techniques = kChained;
  const TileMean chained = MeanOf(RenderAll(*Compile(LitRoom(1).scene, settings)));
  EXPECT_EQ(camera.mean, chained.mean);
}

}  // namespace
}  // namespace sheaf::render
