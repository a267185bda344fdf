// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Renders media that move by velocities while the shutter is open: compared with the mean of images
// of still media, strip by strip; in files; and with the shutter closed. Means are compared with a
// tolerance of 5 standard errors of the difference, from 16 replicates each: a correct mean fails
// with a probability of at most 2e-5 (Student's t with 30 degrees of freedom), and there are fewer
// than a hundred comparisons.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "common/base/file.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/long_tests.h"
#include "tests/support/temporary_path.h"
#include "tests/support/test_scene.h"
#include "tests/support/volume/volume_writers.h"
#include "worker/render/ablation/ablate.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {
namespace {

using ::sheaf::testing::GridToWrite;
using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::VdbFile;
using ::sheaf::testing::Voxel;
using ::testing::HasSubstr;

constexpr int kSide = 32, kStrips = 4;
constexpr double kHalf = 2;

// A smooth ball of smoke that ends at its radius.
float Puff(Vec3d p) {
  const double r2 = Dot(p, p) / (0.55 * 0.55);
  return r2 < 1 ? static_cast<float>(6 * (1 - r2) * (1 - r2)) : 0.0f;
}

class PuffScene : public TestScene {
 public:
  PuffScene() : TestScene({0.1, 0.3, -6}, {0, 0, 0}, 38) {
    MediumDescription medium;
    medium.name = "smoke";
    medium.location = {0, 7, 3};
    medium.sigma_a.rgb = {0.2f, 0.4f, 0.6f};
    medium.sigma_s.rgb = {0.6f, 0.4f, 0.2f};
    UniformGridMedium grid;
    grid.box = {{kSide, kSide, kSide}, {-kHalf, -kHalf, -kHalf}, {kHalf, kHalf, kHalf}};
    for (int i = 0; i < kSide * kSide * kSide; ++i) {
      const Vec3d p = PointOf({i % kSide, i / kSide % kSide, i / kSide / kSide});
      grid.density.push_back(Puff(p - Vec3d{-0.6, -0.2, 0}));
    }
    medium.kind = std::move(grid);
    scene.media.push_back(std::move(medium));
    const float h = 1.9f;
    AddShape(MeshShape{Box({-h, -h, -h}, {h, h, h})}, AddMaterial(InterfaceMaterial{})).media = {
        0, kNone};
    scene.camera.shutter_close = 0.5f;
  }
  static Vec3d PointOf(const Voxel& cell) {
    const double voxel = 2 * kHalf / kSide;
    return Vec3d{cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5} * voxel - Vec3d{kHalf, kHalf, kHalf};
  }
  MediumDescription& medium() { return scene.media[0]; }
  UniformGridMedium& grid() { return std::get<UniformGridMedium>(medium().kind); }
  void Blow(Vec3f wind) { grid().velocity.assign(grid().density.size(), wind); }
  void Shift(Vec3d by) { medium().world_from_medium = TranslateMatrix(by); }
  // Adds temperatures that increase to the right.
  void Heat() {
    for (int i = 0; i < kSide * kSide * kSide; ++i) {
      grid().temperature_k.push_back(1200 + 600 * static_cast<float>(PointOf({i % kSide}).x));
    }
    medium().emits = true;
    medium().radiance_scale = 50;
  }
};

using Strips = std::array<TileMean, kStrips>;
Strips Render(const PuffScene& t, int samples, ColorTransport color, FileSource& files,
              uint32_t seed = 0) {
  Strips strips;
  for (int32_t i = 0; i < kStrips; ++i) {
    FrameSettings settings = SquareSettings(16, static_cast<uint64_t>(samples), 16);
    settings.window = {4 * i, 0, 4 * (i + 1), 16};
    settings.color = color;
    settings.seed = seed;
    auto compiled = CompileScene(t.scene, settings, files, {});
    EXPECT_TRUE(compiled.ok()) << compiled.status();
    RenderStats stats;
    strips[static_cast<size_t>(i)] = MeanOf(RenderAll(**compiled, &stats));
    EXPECT_EQ(stats.broken_majorants, 0u);
    EXPECT_EQ(stats.raised_majorants, 0u);
    // Among millions of rays one may slip through an edge of the box. It is counted and affects
    // only its own path; the long runs with still media contain such a ray.
    EXPECT_LE(stats.broken_nestings, LongTests() ? 1u : 0u);
  }
  return strips;
}
Strips Render(const PuffScene& t, int samples, ColorTransport color = ColorTransport::kRgb) {
  TableFileSource files({});
  return Render(t, samples, color, files);
}

// The mean of images of the still medium, shifted by 1/32, 3/32, ... of the way, each with
// independent noise.
Strips MeanOfStills(PuffScene t, Vec3d way, int samples, ColorTransport color, FileSource& files) {
  constexpr int kImages = 16;
  t.medium().RemoveMotion();
  Strips mean;
  std::array<std::array<double, 3>, kStrips> sum{}, squares{};
  for (int k = 0; k < kImages; ++k) {
    t.Shift((k + 0.5) / kImages * way);
    t.scene.camera.shutter_close = t.scene.camera.shutter_open;
    const Strips strips = Render(t, samples, color, files, static_cast<uint32_t>(k + 1));
    for (size_t i = 0; i < kStrips; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        sum[i][c] += strips[i].mean[c];
        squares[i][c] += std::pow(static_cast<double>(strips[i].standard_error[c]), 2);
      }
    }
  }
  for (size_t i = 0; i < kStrips; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      mean[i].mean[c] = static_cast<float>(sum[i][c] / kImages);
      mean[i].standard_error[c] = static_cast<float>(std::sqrt(squares[i][c]) / kImages);
    }
  }
  return mean;
}

double LargestZ(const Strips& a, const Strips& b) {
  double largest = 0;
  for (size_t i = 0; i < kStrips; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const double error = std::hypot(a[i].standard_error[c], b[i].standard_error[c]);
      const double difference = std::fabs(double{a[i].mean[c]} - double{b[i].mean[c]});
      // 1e-4: the error of the midpoint rule.
      largest = std::max(largest, difference / std::hypot(error, 1e-4 * double{b[i].mean[c]}));
    }
  }
  return largest;
}

// The moving medium matches the mean of the still ones, and neither the first nor the last of them.
void ExpectBlur(const PuffScene& t, Vec3d way, int samples, ColorTransport color,
                FileSource& files) {
  const Strips moving = Render(t, samples, color, files);
  EXPECT_LT(LargestZ(moving, MeanOfStills(t, way, samples / 4, color, files)), 5);
  for (const double time : {0.0, 1.0}) {
    PuffScene still = t;
    still.medium().RemoveMotion();
    still.Shift(time * way);
    EXPECT_GT(LargestZ(moving, Render(still, samples, color, files)), 10) << time;
  }
}

TEST(MovingVolumesTest, UniformMotionEqualsTheMeanOfStaticVolumes) {
  TableFileSource files({});
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    SCOPED_TRACE(ColorTransportName(color));
    PuffScene t;
    t.ConstantEnvironment({0.5f, 0.7f, 1});
    // The shutter is open for half a time unit.
    t.Blow({4.8f, 0.8f, 0});
    t.medium().velocity_scale = 0.5f;
    ExpectBlur(t, {1.2, 0.2, 0}, DrawCount(256, 2048), color, files);
  }
}

TEST(MovingVolumesTest, BlackbodyEmissionMoves) {
  TableFileSource files({});
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    SCOPED_TRACE(ColorTransportName(color));
    PuffScene t;
    t.Heat();
    t.Blow({2.4f, 0, 0});
    ExpectBlur(t, {1.2, 0, 0}, DrawCount(256, 2048), color, files);
  }
}

// The background behind the smoke and its shadow are blurred too: shadow rays carry the time.
TEST(MovingVolumesTest, ShadowsMove) {
  PuffScene t;
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(3);
  sun.from = {0, 1, 0};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  t.AddShape(MeshShape{t.Quad({-5, -2, -5}, {-5, -2, 5}, {5, -2, 5}, {5, -2, -5})},
             t.Diffuse(Rgb::Gray(0.6f)));
  t.Blow({2.4f, 0, 0});
  TableFileSource files({});
  ExpectBlur(t, {1.2, 0, 0}, DrawCount(256, 2048), ColorTransport::kRgb, files);
}

// V5: lumps that move in all directions, slowly and fast, into empty space.
TEST(MovingVolumesTest, V5BoundsHoldInImages) {
  Random random(7);
  for (const float speed : {0.2f, 2.0f, 20.0f}) {
    PuffScene t;
    t.ConstantEnvironment({0.5f, 0.7f, 1});
    t.medium().scale = 40;  // Dense enough that majorants use small cells.
    for (float& v : t.grid().density) v *= static_cast<float>(std::pow(random.Uniform(), 3));
    t.Blow({});
    for (Vec3f& v : t.grid().velocity) v = random.Direction() * speed;
    Render(t, 16);  // Checks for violated majorants.
  }
}

FilmTile Film(const PuffScene& t, RenderPlan* plan) {
  const CompiledScenePtr scene = Compile(t.scene, SquareSettings(16, 16, 16));
  *plan = PlanOf(*scene);
  return RenderAll(*scene);
}

// A shutter interval of length 0, and zero velocities, cost nothing and change no bit.
TEST(MovingVolumesTest, StaticVolumesChangeNoBit) {
  PuffScene still;
  still.ConstantEnvironment({0.5f, 0.7f, 1});
  PuffScene shut = still, zero = still, unscaled = still;
  shut.Blow({2.4f, 1, 0});
  shut.scene.camera.shutter_close = shut.scene.camera.shutter_open = 0.25f;
  zero.Blow({0, 0, 0});
  unscaled.Blow({2.4f, 1, 0});
  unscaled.medium().velocity_scale = 0;
  RenderPlan expected;
  const FilmTile film = Film(still, &expected);
  EXPECT_EQ(expected.variant_name, "cloud");
  for (const PuffScene* t : {&shut, &zero, &unscaled}) {
    RenderPlan plan;
    EXPECT_TRUE(Film(*t, &plan) == film);
    EXPECT_EQ(plan.traits, expected.traits);
    EXPECT_EQ(plan.variant_name, "cloud");
  }
}

TEST(MovingVolumesTest, PlanNamesTheMovingVolume) {
  PuffScene t;
  t.ConstantEnvironment(Rgb::Gray(1));
  t.Blow({2, 0, 0});
  const FrameSettings settings = SquareSettings(8, 4, 4);
  const RenderPlan plan = MakeRenderPlan(t.scene, settings);
  EXPECT_TRUE(Has(plan.traits, Trait::kMotion));  // Rays carry time.
  EXPECT_TRUE(Has(plan.traits, Trait::kMovingVolumes));
  const auto effect =
      std::find_if(plan.effects.begin(), plan.effects.end(),
                   [](const PlannedEffect& e) { return e.trait == Trait::kMovingVolumes; });
  ASSERT_NE(effect, plan.effects.end());
  EXPECT_EQ(effect->name, "moving volumes");
  EXPECT_EQ(effect->cause, "test.pbrt:7:3: medium \"smoke\"");
  // Either can be ablated; the remaining scene is still.
  TableFileSource files({});
  for (const Trait trait : {Trait::kMovingVolumes, Trait::kMotion}) {
    const auto without = Ablate(trait, t.scene, settings, files);
    ASSERT_TRUE(without.ok()) << without.status();
    const TraitBits rest = MakeRenderPlan(without->scene, without->settings).traits;
    EXPECT_EQ(rest, plan.traits & ~TraitSet(Trait::kMovingVolumes, Trait::kMotion));
  }
  // The variants for scenes without motion do not contain it.
  t.medium().RemoveMotion();
  EXPECT_FALSE(Has(MakeRenderPlan(t.scene, settings).variant_traits, Trait::kMovingVolumes));
}

// --- Files ---------------------------------------------------------------------------------------

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

float PuffOf(const Voxel& v) {
  return Puff(Vec3d{v[0] * 0.125, v[1] * 0.125, v[2] * 0.125} - Vec3d{-0.6, -0.2, 0});
}
GridToWrite Density() {
  return {.lo = {-15, -15, -15}, .hi = {15, 15, 15}, .value = PuffOf, .voxel_size = 0.125};
}
// Velocities: value times (1, 2, 3).
GridToWrite Velocities(const std::string& name, float (*value)(const Voxel&)) {
  return {.name = name,
          .lo = {-8, -8, -8},
          .hi = {8, 8, 8},
          .value = value,
          .voxel_size = 0.25,
          .type = "Vec3f"};
}
float Even(const Voxel&) { return 0.25f; }
float Nothing(const Voxel&) { return 0; }
float Broken(const Voxel& v) { return v == Voxel{1, 2, 3} ? kNan : 1.0f; }

class MovingFilesTest : public ::testing::Test {
 protected:
  PuffScene FileScene(const std::string& bytes, const std::string& velocities) {
    EXPECT_TRUE(WriteFileAtomically(path_, bytes).ok());
    PuffScene t;
    t.ConstantEnvironment({0.5f, 0.7f, 1});
    VolumeFileMedium volume;
    volume.file = "smoke.vdb";
    volume.velocity_grid = velocities;
    t.medium().kind = volume;
    t.scene.camera.shutter_close = 1;
    return t;
  }
  std::string Message(const PuffScene& t) {
    const auto compiled = CompileScene(t.scene, SquareSettings(4, 1, 1), files_, {});
    EXPECT_FALSE(compiled.ok());
    return std::string(compiled.status().message());
  }
  const std::string path_ = sheaf::testing::TemporaryPath("smoke");
  TableFileSource files_{{{"smoke.vdb", path_}}};
};

TEST_F(MovingFilesTest, FileVelocitiesEqualTheMeanOfStaticVolumes) {
  const std::vector<GridToWrite> grids{Density(), Velocities("vel", Even)};
  const int samples = DrawCount(256, 2048);
  PuffScene named = FileScene(VdbFile(grids, {}), "vel");
  ExpectBlur(named, {0.25, 0.5, 0.75}, samples, ColorTransport::kRgb, files_);
  const Strips as_vdb = Render(named, 16, ColorTransport::kRgb, files_);
  PuffScene found = FileScene(NvdbFile(grids, NvdbCodec::kNone), "auto");
  const Strips as_nvdb = Render(found, 16, ColorTransport::kRgb, files_);
  for (size_t i = 0; i < kStrips; ++i) EXPECT_EQ(as_vdb[i].mean, as_nvdb[i].mean);
}

TEST_F(MovingFilesTest, VelocitiesAreIgnoredByDefault) {
  const std::string bytes = VdbFile({Density(), Velocities("vel", Even)}, {});
  const PuffScene t = FileScene(bytes, "");
  EXPECT_FALSE(Has(MakeRenderPlan(t.scene, SquareSettings(4, 1, 1)).traits, Trait::kMovingVolumes));
}

TEST_F(MovingFilesTest, GridsAreChosenByName) {
  GridToWrite smoke = Density(), unnamed = Density(), other = Density();
  smoke.name = "smoke";
  unnamed.name = "";
  other.value = [](const Voxel&) { return 9.0f; };
  const FrameSettings settings = SquareSettings(16, 4, 4);
  const auto render = [&](const std::string& bytes, const std::string& name) {
    PuffScene t = FileScene(bytes, "");
    std::get<VolumeFileMedium>(t.medium().kind).density_grid = name;
    const auto scene = CompileScene(t.scene, settings, files_, {});
    EXPECT_TRUE(scene.ok()) << scene.status();
    return RenderAll(**scene);
  };
  const auto expected = render(VdbFile({Density()}, {}), "density");
  EXPECT_TRUE(render(VdbFile({other, smoke}, {}), "smoke") == expected);
  EXPECT_TRUE(render(VdbFile({other, unnamed}, {}), "") == expected);
  EXPECT_TRUE(render(NvdbFile({other, smoke}, NvdbCodec::kNone), "smoke") == expected);
  EXPECT_TRUE(render(NvdbFile({other, unnamed}, NvdbCodec::kNone), "") == expected);
  PuffScene lacking = FileScene(VdbFile({other}, {}), "");
  std::get<VolumeFileMedium>(lacking.medium().kind).density_grid = "smoke";
  EXPECT_THAT(Message(lacking), HasSubstr("no grid \"smoke\"; there are: \"density\""));
  PuffScene cold = FileScene(VdbFile({other}, {}), "");
  cold.medium().emits = true;
  std::get<VolumeFileMedium>(cold.medium().kind).temperature_grid = "heat";
  EXPECT_THAT(Message(cold), HasSubstr("no grid \"heat\"; there are: \"density\""));
}

TEST_F(MovingFilesTest, ZeroVelocitiesMoveNothing) {
  const std::string bytes = VdbFile({Density(), Velocities("v", Nothing)}, {});
  const FrameSettings settings = SquareSettings(16, 16, 16);
  const auto zero = CompileScene(FileScene(bytes, "auto").scene, settings, files_, {});
  const auto still = CompileScene(FileScene(bytes, "").scene, settings, files_, {});
  ASSERT_TRUE(zero.ok() && still.ok());
  EXPECT_EQ(PlanOf(**zero).traits, PlanOf(**still).traits);
  EXPECT_EQ(PlanOf(**zero).variant_name, "cloud");
  EXPECT_TRUE(RenderAll(**zero) == RenderAll(**still));
}

TEST_F(MovingFilesTest, InvalidVelocitiesAreRefusedWithTheirLocation) {
  const std::string where = "test.pbrt:7:3: medium \"smoke\": smoke.vdb: ";
  const std::vector<GridToWrite> grids{Density(), Velocities("vel", Even)};
  EXPECT_THAT(Message(FileScene(VdbFile(grids, {}), "density")),
              HasSubstr(where + "grid \"density\" holds numbers, but velocities are vectors"));
  EXPECT_THAT(Message(FileScene(VdbFile(grids, {}), "speed")),
              HasSubstr(where + "no grid \"speed\"; there are: \"density\""));
  EXPECT_THAT(Message(FileScene(VdbFile({Density()}, {}), "auto")),
              HasSubstr(where + "no grid \"velocity\"; there are: \"density\""));
  for (const bool is_vdb : {true, false}) {
    const std::vector<GridToWrite> broken{Density(), Velocities("vel", Broken)};
    const std::string bytes = is_vdb ? VdbFile(broken, {}) : NvdbFile(broken, NvdbCodec::kNone);
    EXPECT_THAT(Message(FileScene(bytes, "vel")),
                ::testing::AllOf(HasSubstr(where), HasSubstr("NaN")));
  }
  PuffScene fast = FileScene(VdbFile(grids, {}), "vel");
  fast.medium().velocity_scale = 1e6f;
  EXPECT_THAT(Message(fast), HasSubstr("test.pbrt:7:3: medium \"smoke\": grid \"vel\" moves the "));
}

}  // namespace
}  // namespace sheaf::render
