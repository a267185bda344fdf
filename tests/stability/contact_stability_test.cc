// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of surfaces that lie at one place, named as in the catalogue (G17): bodies that touch,
// lamps and decals in the plane of a wall, faces that are given twice. Each scene is rendered with
// a small gap, which tells the surfaces apart, and without, in both orders of the file, along the
// axes and tilted, and by every technique that can.
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr float kGap = 1e-4f;

// A scene that is turned as a whole, camera included.
class FlushScene : public TestScene {
 public:
  explicit FlushScene(const Matrix4& turn) : TestScene({0, 0, 0}, {0, 0, 1}, 40), turn_(turn) {
    Matrix4 upright;
    EXPECT_TRUE(LookAtMatrix({0, 0.6, -5.5}, {0, 0.3, 0}, {0, 1, 0}, &upright));
    scene.camera.world_from_camera.start = scene.camera.world_from_camera.end = turn_ * upright;
  }

  ShapeDescription& Add(int32_t mesh, int32_t material) {
    return AddShape(MeshShape{mesh}, material, turn_);
  }
  ShapeDescription& AddDisk(float height, float radius, int32_t material) {
    // Its front looks down.
    return AddShape(
        DiskShape{radius, 0, 0, 360}, material,
        turn_ * TranslateMatrix({0, static_cast<double>(height), 0}) * RotateMatrix(90, {1, 0, 0}));
  }
  // A square at height y.
  int32_t Square(float y, float half, bool faces_up = true) {
    const Vec3f a{-half, y, -half}, b{-half, y, half}, c{half, y, half}, d{half, y, -half};
    return faces_up ? Quad(a, b, c, d) : Quad(d, c, b, a);
  }
  int32_t Glass(float eta) {
    DielectricMaterial glass;
    glass.eta.mean = eta;
    return AddMaterial(glass);
  }
  void AddLamp(float y, float half, float radiance) {
    ShapeDescription& lamp = Add(Square(y, half, /*faces_up=*/false), Diffuse({}));
    lamp.area_light = AreaLight(Rgb::Gray(radiance));
  }
  void AddFog(Vec3f lower, Vec3f upper, float sigma_a) {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.sigma_a.rgb = Rgb::Gray(sigma_a);
    medium.sigma_s.rgb = Rgb::Gray(0.4f);
    scene.media.push_back(medium);
    ShapeDescription& shape = Add(Box(lower, upper), AddMaterial(InterfaceMaterial{}));
    shape.media.inside = static_cast<int32_t>(scene.media.size() - 1);
  }

 private:
  Matrix4 turn_;
};

struct FlushPair {
  std::string name;
  std::function<void(FlushScene*)> one, rest;
  std::function<void(FlushScene*, float gap)> other;
  std::vector<TechniqueSet> techniques{TechniqueSet::kCamera};
};

void AddSky(FlushScene* t) { t->ConstantEnvironment(Rgb::Gray(1)); }
void AddFloor(FlushScene* t) { t->Add(t->Square(-1, 4), t->Diffuse(Rgb::Gray(0.5f))); }
void AddCeiling(FlushScene* t) {
  t->Add(t->Square(2, 3, /*faces_up=*/false), t->Diffuse(Rgb::Gray(0.5f)));
}
void AddTable(FlushScene* t) { t->Add(t->Square(0, 4), t->Diffuse(Rgb::Gray(0.5f))); }
// A thick vessel with a cavity from -1 to 1.
void AddVessel(FlushScene* t) {
  const int32_t glass = t->Glass(1.5f);
  t->Add(t->Box({-1.2f, -1.2f, -1.2f}, {1.2f, 1.2f, 1.2f}), glass);
  t->Add(t->Box({-1, -1, -1}, {1, 1, 1}), glass).reverse_orientation = true;
}

const std::vector<TechniqueSet> kAllTechniques{TechniqueSet::kCamera, TechniqueSet::kLight,
                                               TechniqueSet::kCameraAndLight};

std::vector<FlushPair> Pairs() {
  const auto red_wall = [](FlushScene* t) {
    t->Add(t->Square(0, 4), t->Diffuse({0.8f, 0.2f, 0.2f}));
  };
  return {
      {"glass on a table", AddTable, AddSky,
       [](FlushScene* t, float gap) {
         t->Add(t->Box({-1, gap, -1}, {1, 1, 1}), t->Glass(1.5f));
       }},
      {"glass on a massive table",
       [](FlushScene* t) {
         t->Add(t->Box({-4, -1, -4}, {4, 0, 4}), t->Diffuse(Rgb::Gray(0.5f)));
       },
       AddSky,
       [](FlushScene* t, float gap) {
         t->Add(t->Box({-1, gap, -1}, {1, 1, 1}), t->Glass(1.5f));
       }},
      {"glass and dyed glass",
       [](FlushScene* t) {
         t->Add(t->Box({-1, -1, -1}, {0, 1, 1}), t->Glass(1.5f));
         AddFloor(t);
       },
       AddSky,
       [](FlushScene* t, float gap) {
         t->Add(t->Box({gap, -1, -1}, {1, 1, 1}), t->Glass(1.7f));
       }},
      {"two media",
       [](FlushScene* t) {
         t->AddFog({-1, -1, -1}, {0, 1, 1}, 0.1f);
       },
       AddSky,
       [](FlushScene* t, float gap) {
         t->AddFog({gap, -1, -1}, {1, 1, 1}, 1);
       }},
      {"a medium that fills a vessel", AddVessel, AddSky,
       [](FlushScene* t, float gap) {
         t->AddFog({gap - 1, gap - 1, gap - 1}, {1 - gap, 1 - gap, 1 - gap}, 0.2f);
       }},
      {"a liquid in its vessel",
       [](FlushScene* t) {
         AddVessel(t);
         AddFloor(t);
       },
       AddSky,
       [](FlushScene* t, float gap) {
         t->Add(t->Box({gap - 1, gap - 1, gap - 1}, {1 - gap, 0.3f, 1 - gap}), t->Glass(1.33f));
       }},
      {"a decal on a wall", red_wall, AddSky,
       [](FlushScene* t, float gap) {
         t->Add(t->Square(gap, 1.5f), t->Diffuse({0.2f, 0.2f, 0.8f}));
       }},
      {"a decal that faces the wall", red_wall, AddSky,
       [](FlushScene* t, float gap) {
         t->Add(t->Square(gap, 1.5f, /*faces_up=*/false), t->Diffuse({0.2f, 0.2f, 0.8f}));
       }},
      {"a decal with holes", red_wall, AddSky,
       [](FlushScene* t, float gap) {
         ShapeDescription& decal = t->Add(t->Square(gap, 1.5f), t->Diffuse({0.2f, 0.2f, 0.8f}));
         decal.has_alpha = true;
         decal.alpha = {0.5f, kNone};
       }},
      {"a lamp in a ceiling", AddCeiling, AddFloor,
       [](FlushScene* t, float gap) { t->AddLamp(2 - gap, 0.7f, 4); }, kAllTechniques},
      {"a round lamp in a ceiling", AddCeiling, AddFloor,
       [](FlushScene* t, float gap) {
         ShapeDescription& lamp = t->AddDisk(2 - gap, 0.7f, t->Diffuse({}));
         lamp.area_light = t->AreaLight(Rgb::Gray(4));
       },
       kAllTechniques},
      {"a lamp in the plane of a larger one", [](FlushScene* t) { t->AddLamp(2, 2, 1); }, AddFloor,
       [](FlushScene* t, float gap) { t->AddLamp(2 - gap, 0.7f, 4); }, kAllTechniques},
      {"a medium below a lamp in a ceiling",
       [](FlushScene* t) {
         AddCeiling(t);
         t->AddLamp(2, 0.7f, 4);
       },
       AddFloor,
       [](FlushScene* t, float gap) {
         t->AddFog({-2, -0.9f, -2}, {2, 2 - gap, 2}, 0.1f);
       },
       kAllTechniques},
  };
}

BothFilms Render(const FlushPair& pair, float gap, bool reversed, const Matrix4& turn,
                 TechniqueSet techniques) {
  FlushScene t(turn);
  if (reversed) {
    pair.rest(&t);
    pair.other(&t, gap);
    pair.one(&t);
  } else {
    pair.one(&t);
    pair.other(&t, gap);
    pair.rest(&t);
  }
  const auto samples = static_cast<uint64_t>(DrawCount(64, 1024));
  FrameSettings settings = SquareSettings(12, samples, 12);
  settings.techniques = techniques;
  return RenderBothFilms(*Compile(t.scene, settings));
}

// G17: what touches is lit as what nearly touches, by every technique, whatever the order of the
// file and the direction.
TEST(ContactStability, G17TouchingIsTheLimitOfAGap) {
  double largest = 0;
  for (const FlushPair& pair : Pairs()) {
    SCOPED_TRACE(pair.name);
    const BothFilms apart = Render(pair, kGap, false, {}, TechniqueSet::kCamera);
    for (const TechniqueSet techniques : pair.techniques) {
      SCOPED_TRACE(techniques.Name());
      for (const bool reversed : {false, true}) {
        for (const Matrix4& turn : {Matrix4{}, RotateMatrix(37.3, {0.3, 0.7, -0.4})}) {
          const BothFilms touching = Render(pair, 0, reversed, turn, techniques);
          for (size_t c = 0; c < 3; ++c) {
            const ComponentMean expected = MeanOverPixels(apart, c),
                                measured = MeanOverPixels(touching, c);
            const double error = std::hypot(expected.standard_error, measured.standard_error);
            EXPECT_NEAR(measured.value, expected.value, 5 * error + 1e-3 * expected.value)
                << "channel " << c << (reversed ? ", reversed" : "");
            largest = std::max(largest, std::fabs(measured.value / expected.value - 1) -
                                            5 * error / expected.value);
          }
        }
      }
    }
  }
  ExpectHardCase({.row = "G17",
                  .figure = "largest relative change by closing a gap of 1e-4, beyond its error",
                  .expected = 0,
                  .measured = std::max(0.0, largest),
                  .tolerance = 1e-3});
}

void AddSun(const Matrix4& turn, TestScene* t) {
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(3);
  sun.from = {1, 2, -1};
  sun.to = {0, 0, 0};
  t->scene.lights.push_back({sun, {}, turn, {}});
}

// A floor of the given size, tilted, under a sun; once or twice.
enum class Twin {
  kNone,
  kSame,
  kBack,
  kOtherDiagonal,
  kFiner,
  kOneMesh,
  kMiddle,
  kPlaced,
  kMoving
};
// Adds a twin of the middle of the floor: as its own shape, or, in an instance, with the plane of
// its object known exactly.
void AddMiddle(Twin twin, float half, int32_t material, const Matrix4& turn, TestScene* t) {
  const int32_t mesh =
      t->Quad({-half, 0, -half}, {-half, 0, half}, {half, 0, half}, {half, 0, -half});
  if (twin == Twin::kMiddle) {
    t->AddShape(MeshShape{mesh}, material, turn);
    return;
  }
  if (twin == Twin::kMoving) {
    t->AddShape(MeshShape{mesh}, material, turn).world_from_object.end =
        turn * TranslateMatrix({0.3 * static_cast<double>(half), 0, 0});
    return;
  }
  t->AddLooseShape(MeshShape{mesh}, material);
  t->scene.objects.push_back({"middle", {static_cast<int32_t>(t->scene.shapes.size()) - 1}, {}});
  ObjectInstance instance;
  instance.object = 0;
  instance.world_from_instance.start = instance.world_from_instance.end = turn;
  t->scene.instances.push_back(instance);
}

double FloorUnderSun(float half, Twin twin) {
  const Matrix4 turn = RotateMatrix(37.3, {0.3, 0.7, -0.4});
  TestScene t({0, 0, 0}, {0, 0, 1}, 30);
  Matrix4 upright;
  EXPECT_TRUE(LookAtMatrix({0, 3, -5}, {0, 0, 0}, {0, 1, 0}, &upright));
  t.scene.camera.world_from_camera.start = t.scene.camera.world_from_camera.end = turn * upright;
  const int32_t gray = t.Diffuse(Rgb::Gray(0.5f));
  const std::vector<Vec3f> corners{
      {-half, 0, -half}, {-half, 0, half}, {half, 0, half}, {half, 0, -half}};
  std::vector<uint32_t> indices{0, 1, 2, 0, 2, 3};
  if (twin == Twin::kOneMesh) indices.insert(indices.end(), {0, 1, 2, 0, 2, 3});
  t.AddShape(MeshShape{t.AddMesh(corners, indices)}, gray, turn);
  if (twin == Twin::kSame)
    t.AddShape(MeshShape{t.AddMesh(corners, {0, 1, 2, 0, 2, 3})}, gray, turn);
  if (twin == Twin::kBack)
    t.AddShape(MeshShape{t.AddMesh(corners, {0, 2, 1, 0, 3, 2})}, gray, turn);
  if (twin == Twin::kOtherDiagonal) {
    t.AddShape(MeshShape{t.AddMesh(corners, {0, 1, 3, 1, 2, 3})}, gray, turn);
  }
  if (twin == Twin::kFiner) {
    constexpr uint32_t kSteps = 7;
    std::vector<Vec3f> finer;
    std::vector<uint32_t> faces;
    for (uint32_t i = 0; i <= kSteps; ++i) {
      for (uint32_t k = 0; k <= kSteps; ++k) {
        finer.push_back({half * (2.0f * static_cast<float>(i) / kSteps - 1), 0,
                         half * (2.0f * static_cast<float>(k) / kSteps - 1)});
        if (i == kSteps || k == kSteps) continue;
        const uint32_t a = i * (kSteps + 1) + k, b = a + kSteps + 1;
        faces.insert(faces.end(), {a, a + 1, b + 1, a, b + 1, b});
      }
    }
    t.AddShape(MeshShape{t.AddMesh(finer, faces)}, gray, turn);
  }
  if (twin == Twin::kMiddle || twin == Twin::kPlaced || twin == Twin::kMoving) {
    AddMiddle(twin, std::min(0.5f * half, 1.0f), gray, turn, &t);
  }
  if (twin == Twin::kMoving) t.scene.camera.shutter_close = 1;
  AddSun(turn, &t);
  return static_cast<double>(RenderMean(t.scene, SquareSettings(16, 16, 3)).mean.g);
}

// G17: a face that exists twice is lit as one, at every size.
TEST(ContactStability, G17FacesGivenTwiceAreOne) {
  double lost = 0;
  for (const float half : {0.5f, 10.0f, 1e3f, 1e6f}) {
    const double once = FloorUnderSun(half, Twin::kNone);
    ASSERT_GT(once, 0);
    for (const Twin twin : {Twin::kSame, Twin::kBack, Twin::kOtherDiagonal, Twin::kFiner,
                            Twin::kOneMesh, Twin::kMiddle, Twin::kPlaced, Twin::kMoving}) {
      // Barycentric coordinates are floats: on a triangle of 1e6 a point is off by .1 along it, so
      // that points beside the edge of a small face may lie on it.
      if (twin >= Twin::kMiddle && half > 1e3f) continue;
      const double twice = FloorUnderSun(half, twin);
      EXPECT_NEAR(twice, once, 1e-3 * once) << half << " " << static_cast<int>(twin);
      lost = std::max(lost, std::fabs(1 - twice / once));
    }
  }
  ExpectHardCase({.row = "G17",
                  .figure = "largest part of the sun's light that a face given twice loses",
                  .expected = 0,
                  .measured = lost,
                  .tolerance = 1e-3});
}

// Turns under which the rounding of a plane's vertices moves it to either side.
std::vector<Matrix4> OddTurns() {
  std::vector<Matrix4> turns;
  for (const double angle : {10.0, 37.3, 61.0, 83.0, 140.0, 200.0}) {
    turns.push_back(RotateMatrix(angle, {0.3, 0.7, -0.4}));
  }
  return turns;
}

// G17: cards of the world lie on a floor that is an instance, with its plane known exactly. Cards
// and floor do not shadow each other.
TEST(ContactStability, G17CardsOnAnInstancedFloor) {
  const auto floor = [](bool has_card, const Matrix4& turn) {
    TestScene t({0, 0, 0}, {0, 0, 1}, 30);
    Matrix4 upright;
    EXPECT_TRUE(LookAtMatrix({0, 3, -5}, {0, 0, 0}, {0, 1, 0}, &upright));
    t.scene.camera.world_from_camera.start = t.scene.camera.world_from_camera.end = turn * upright;
    const int32_t gray = t.Diffuse(Rgb::Gray(0.5f));
    AddMiddle(Twin::kPlaced, 4, gray, turn, &t);
    if (has_card) AddMiddle(Twin::kMiddle, 1.5f, gray, turn, &t);
    AddSun(turn, &t);
    return static_cast<double>(RenderMean(t.scene, SquareSettings(16, 16, 3)).mean.g);
  };
  for (const Matrix4& turn : OddTurns()) {
    const double bare = floor(false, turn);
    EXPECT_NEAR(floor(true, turn), bare, 1e-4 * bare);
  }
}

// G17: a lamp is let into a ceiling that is an instance, with its plane known exactly. In the file
// the lamp is far away, so its plane is rounded. The ceiling hides no part of it from a shelf
// below.
TEST(ContactStability, G17LampInAnInstancedCeiling) {
  const auto shelf = [](bool has_ceiling, float far, const Matrix4& turn) {
    TestScene t({0, 0, 0}, {0, 0, 1}, 20);
    Matrix4 level;
    EXPECT_TRUE(LookAtMatrix({0, -0.005, -0.5}, {0, -0.02, 0}, {0, 1, 0}, &level));
    t.scene.camera.world_from_camera.start = t.scene.camera.world_from_camera.end = turn * level;
    const int32_t gray = t.Diffuse(Rgb::Gray(0.5f));
    t.AddShape(
        MeshShape{t.Quad({-1, -0.02f, -1}, {-1, -0.02f, 1}, {1, -0.02f, 1}, {1, -0.02f, -1})}, gray,
        turn);
    const Matrix4 back = TranslateMatrix({0, -std::round(static_cast<double>(far) * 10) / 10, 0});
    t.AddShape(MeshShape{t.Quad({-1, far, -1}, {1, far, -1}, {1, far, 1}, {-1, far, 1})},
               t.Diffuse({}), turn * back)
        .area_light = t.AreaLight(Rgb::Gray(2));
    if (has_ceiling) AddMiddle(Twin::kPlaced, 3, gray, turn, &t);
    return MeanOverPixels(RenderBothFilms(*Compile(t.scene, SquareSettings(12, 64, 2))), 0);
  };
  for (const float far : {1000.1f, 1000.2f, 1000.3f, 1000.4f}) {
    for (const Matrix4& turn : OddTurns()) {
      const ComponentMean expected = shelf(false, far, turn), measured = shelf(true, far, turn);
      EXPECT_GT(expected.value, 0);
      EXPECT_NEAR(measured.value, expected.value,
                  5 * std::hypot(measured.standard_error, expected.standard_error));
    }
  }
}

// G17: a lamp in a plane of coordinate 0, where the rounding of its points is 0, shines by every
// technique. Render space begins at the camera, which is at the lamp's height.
TEST(ContactStability, G17LampAtTheHeightOfTheCamera) {
  const auto render = [](double height, TechniqueSet techniques) {
    TestScene t({0, height, -5}, {0, 1, 0}, 40);
    t.AddShape(MeshShape{t.Quad({-3, 0, -3}, {-3, 0, 3}, {3, 0, 3}, {3, 0, -3})},
               t.Diffuse(Rgb::Gray(0.5f)));
    t.AddShape(MeshShape{t.Quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1})}, t.Diffuse({}))
        .area_light = t.AreaLight(Rgb::Gray(2));
    FrameSettings settings = SquareSettings(12, 256, 4);
    settings.techniques = techniques;
    return MeanOverPixels(RenderBothFilms(*Compile(t.scene, settings)), 0);
  };
  const ComponentMean expected = render(2, TechniqueSet::kCamera);
  for (const TechniqueSet techniques : {TechniqueSet::kLight, TechniqueSet::kCameraAndLight}) {
    const ComponentMean measured = render(2, techniques);
    EXPECT_NEAR(measured.value, expected.value,
                5 * std::hypot(measured.standard_error, expected.standard_error));
    EXPECT_GT(measured.standard_error, 0);
  }
}

}  // namespace
}  // namespace sheaf::render
