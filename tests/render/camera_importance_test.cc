// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the importance of every camera against the rays that the camera itself makes. A connection
// leads back to the film point and the lens point of the ray that meets the point. Its importance
// is the inverse of the area that neighboring rays cover, by differences. Within a white sphere,
// the image that points of the sphere splat is white. On a small patch, seen out of focus by moving
// cameras, rays of the camera and connections of the patch's points agree block by block, weighted
// and counted. Estimates have 16 replicates and are compared within six standard errors; the seeds
// are fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/film/film_tile.h"
#include "common/math/elementary.h"
#include "common/math/transform.h"
#include "tests/support/lenses.h"
#include "tests/support/long_tests.h"
#include "worker/render/camera/camera.h"
#include "worker/render/sampling/sampler.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

using Kind = CameraDescription::Kind;

constexpr int32_t kWidth = 48, kHeight = 32;
// Blocks of pixels of which images are compared.
constexpr int kBlocksX = 6, kBlocksY = 4, kBlocks = kBlocksX * kBlocksY;
constexpr double kPixelsOfBlock = double{kWidth} * kHeight / kBlocks;

struct CameraSetup {
  std::string name;
  SceneDescription scene;
};

// Every camera at the origin, looking along +z; the last ones move, or are stretched.
std::vector<CameraSetup> CameraSetups() {
  std::vector<CameraSetup> setups;
  const auto add = [&](const std::string& name, Kind kind) -> CameraDescription& {
    CameraSetup setup;
    setup.name = name;
    setup.scene.files = {"room.pbrt"};
    setup.scene.camera.kind = kind;
    setup.scene.camera.fov_degrees = 50;
    setup.scene.camera.screen_window[0] = -1.5;
    setup.scene.camera.screen_window[1] = 1.5;
    setups.push_back(setup);
    return setups.back().scene.camera;
  };
  const auto add_lens = [](CameraDescription* camera, int blades) {
    camera->lens_radius = 0.4f;
    camera->focal_distance = 3;
    camera->blade_count = blades;
    camera->blade_rotation_degrees = 20;
  };
  const auto move = [](CameraDescription* camera) {
    camera->world_from_camera.end =
        TranslateMatrix({0.3, -0.2, 0.4}) * RotateMatrix(12, {0.2, 1, 0.1});
    camera->shutter_shape = {{0, 0}, {0.25f, 1}, {1, 0.5f}};
  };
  add("pinhole", Kind::kPerspective);
  add_lens(&add("thin lens", Kind::kPerspective), 0);
  add_lens(&add("blades", Kind::kPerspective), 5);
  add("orthographic", Kind::kOrthographic);
  add_lens(&add("orthographic lens", Kind::kOrthographic), 6);
  add("equirectangular", Kind::kEquirectangular);
  add("equal-area", Kind::kEqualArea);
  for (const Kind kind : {Kind::kPerspective, Kind::kOrthographic, Kind::kEquirectangular}) {
    CameraDescription& moving = add("moving " + std::to_string(static_cast<int>(kind)), kind);
    if (kind != Kind::kEquirectangular) add_lens(&moving, 0);
    move(&moving);
    CameraDescription& stretched = add("stretched " + std::to_string(static_cast<int>(kind)), kind);
    stretched.world_from_camera.start = stretched.world_from_camera.end =
        RotateMatrix(20, {1, 0.3, 0.2}) * ScaleMatrix({1.25, 0.75, 0.5}) *
        RotateMatrix(15, {0.1, 1, 0});
  }
  return setups;
}
CameraSetup RealisticSetup(bool moves) {
  CameraSetup setup;
  setup.name = moves ? "moving realistic" : "realistic";
  setup.scene.files = {"room.pbrt"};
  CameraDescription& camera = setup.scene.camera;
  camera.kind = Kind::kRealistic;
  camera.lens = sheaf::testing::DoubleGauss();
  camera.lens.aperture_diameter_mm = 25;
  camera.lens.aperture =
      moves ? LensDescription::Aperture::kStar : LensDescription::Aperture::kDisk;
  camera.lens.film_diagonal_mm = 40;
  camera.lens.focus_distance_m = 3;
  if (moves) camera.world_from_camera.end = TranslateMatrix({0.05, -0.02, 0});
  return setup;
}

Camera Make(const CameraSetup& setup) {
  const auto camera = Camera::Make(setup.scene, kWidth, kHeight, {});
  EXPECT_TRUE(camera.ok()) << camera.status();
  return camera.ok() ? *camera : Camera{};
}

struct Draw {
  std::array<float, 4> a{}, b{};
};
Draw DrawOf(uint64_t i, uint64_t seed) {
  const Sampler sampler(seed, 7, 9, i);
  return {sampler.Get4(1), sampler.Get4(2)};
}
Vec2d FilmOf(const Draw& draw) { return {double{draw.a[0]} * kWidth, double{draw.a[1]} * kHeight}; }

bool IsInFrame(Vec2d film) {
  return film.x >= 0 && film.x < kWidth && film.y >= 0 && film.y < kHeight;
}
size_t BlockOf(Vec2d film) {
  return static_cast<size_t>(film.y * kBlocksY / kHeight) * kBlocksX +
         static_cast<size_t>(film.x * kBlocksX / kWidth);
}

// --- Single rays -------------------------------------------------------------------------------

TEST(CameraImportanceTest, ConnectionsInvertRays) {
  for (const CameraSetup& setup : CameraSetups()) {
    SCOPED_TRACE(setup.name);
    const Camera camera = Make(setup);
    for (uint64_t i = 0; i < 2000; ++i) {
      const Draw draw = DrawOf(i, 1);
      const Vec2d film = FilmOf(draw);
      const Vec2f lens{draw.a[2], draw.a[3]};
      const float time = camera.ShutterFraction(draw.b[0]);
      const Ray ray = camera.MakeRay<kAllTraits>(film, lens, time);
      const Vec3f p = ToFloat(ToDouble(ray.o) + (0.5 + 9 * double{draw.b[1]}) * ToDouble(ray.d));
      const auto seen = camera.SampleWi(p, lens, time);
      ASSERT_TRUE(seen.has_value());
      ASSERT_NEAR(seen->film.x, film.x, 2e-4);
      ASSERT_NEAR(seen->film.y, film.y, 2e-4);
      ASSERT_LT(Length(seen->p_lens - ray.o), 4e-6f);
      ASSERT_LT(Length(seen->wi + ray.d), 4e-6f);
      ASSERT_EQ(seen->importance, seen->ray_density);
      ASSERT_NEAR(camera.PdfWe(ray, p) / seen->ray_density, 1, 3e-5);
    }
  }
}

// One pixel covers this area that faces the ray: the parallelogram of the rays a part of a pixel to
// the right and below, from the same point of the lens, where they meet the plane through p.
TEST(CameraImportanceTest, ImportanceIsTheInverseOfThePixelsArea) {
  for (const CameraSetup& setup : CameraSetups()) {
    SCOPED_TRACE(setup.name);
    const Camera camera = Make(setup);
    for (uint64_t i = 0; i < 500; ++i) {
      const Draw draw = DrawOf(i, 2);
      const Vec2d film = FilmOf(draw);
      const Vec2f lens{draw.a[2], draw.a[3]};
      const float time = camera.ShutterFraction(draw.b[0]);
      const Ray ray = camera.MakeRay<kAllTraits>(film, lens, time);
      const Vec3d d = ToDouble(ray.d);
      const Vec3d p = ToDouble(ray.o) + (1 + 9 * double{draw.b[1]}) * d;
      constexpr double kPart = 1.0 / 16;
      const auto on_plane = [&](Vec2d at) {
        const Ray next = camera.MakeRay<kAllTraits>(at, lens, time);
        const Vec3d o = ToDouble(next.o), w = ToDouble(next.d);
        return o + w * (Dot(p - o, d) / Dot(w, d));
      };
      const Vec3d right = on_plane({film.x + kPart, film.y}) - on_plane({film.x - kPart, film.y});
      const Vec3d down = on_plane({film.x, film.y + kPart}) - on_plane({film.x, film.y - kPart});
      const double pixel_area = Length(Cross(right, down)) / (4 * kPart * kPart);
      const auto seen = camera.SampleWi(ToFloat(p), lens, time);
      ASSERT_TRUE(seen.has_value());
      // Near the folds of the equal-area map the pixels are bent.
      const bool at_fold =
          setup.name == "equal-area" &&
          (std::fabs(std::fabs(film.x / kWidth - 0.5) + std::fabs(film.y / kHeight - 0.5) - 0.5) <
               0.02 ||
           std::fabs(film.x / kWidth - 0.5) < 0.02 || std::fabs(film.y / kHeight - 0.5) < 0.02);
      if (at_fold) continue;
      ASSERT_NEAR(seen->importance * pixel_area, 1, 5e-3) << film.x << " " << film.y;
    }
  }
}

TEST(CameraImportanceTest, PointsBehindTheCameraAreNotSeen) {
  for (const Kind kind : {Kind::kPerspective, Kind::kOrthographic}) {
    CameraSetup setup = CameraSetups().front();
    setup.scene.camera.kind = kind;
    const Camera camera = Make(setup);
    EXPECT_TRUE(camera.SampleWi({0, 0, 1}, {}, 0).has_value());
    EXPECT_FALSE(camera.SampleWi({0, 0, -1}, {}, 0).has_value());
    EXPECT_FALSE(camera.SampleWi({0.5f, 0, 0}, {}, 0).has_value());
    EXPECT_EQ(camera.PdfWe(camera.MakeRay<kAllTraits>({1, 1}, {}, 0), {0, 0, -1}), 0);
  }
  CameraSetup setup = CameraSetups().front();
  setup.scene.camera.kind = Kind::kEqualArea;
  EXPECT_FALSE(Make(setup).SampleWi({0, 0, 0}, {}, 0).has_value());
}

// Lengths scaled by powers of two change exponents only.
TEST(CameraImportanceTest, ConnectionsAreScaleInvariant) {
  for (const double scale : {0x1p-20, 0x1p20}) {
    for (CameraSetup setup : CameraSetups()) {
      SCOPED_TRACE(setup.name);
      const Camera unit = Make(setup);
      CameraDescription& camera = setup.scene.camera;
      const bool is_flat = camera.kind == Kind::kOrthographic;
      camera.lens_radius *= static_cast<float>(scale);
      camera.focal_distance *= static_cast<float>(scale);
      for (Matrix4* matrix : {&camera.world_from_camera.start, &camera.world_from_camera.end}) {
        for (size_t row = 0; row < 3; ++row) matrix->m[row][3] *= scale;
      }
      if (is_flat) {
        for (double& side : camera.screen_window) side *= scale;
      }
      const Camera scaled = Make(setup);
      int seen_count = 0;
      for (uint64_t i = 0; i < 300; ++i) {
        const Draw draw = DrawOf(i, 3);
        const Vec3f p{2 * draw.a[0] - 1, 2 * draw.a[1] - 1, 1 + 3 * draw.b[1]};
        const Vec2f lens{draw.a[2], draw.a[3]};
        const auto a = unit.SampleWi(p, lens, draw.b[0]);
        const auto b = scaled.SampleWi(p * static_cast<float>(scale), lens, draw.b[0]);
        ASSERT_EQ(a.has_value(), b.has_value());
        if (!a) continue;
        ++seen_count;
        ASSERT_EQ(a->wi, b->wi);
        ASSERT_EQ(a->film, b->film);
        ASSERT_EQ(a->p_lens * static_cast<float>(scale), b->p_lens);
        ASSERT_EQ(a->importance, b->importance * scale * scale);
      }
      EXPECT_GT(seen_count, 150);
    }
  }
}

// --- Images ------------------------------------------------------------------------------------

// Sums by block, with standard errors from the replicates.
class BlockImage {
 public:
  void Add(uint64_t i, Vec2d film, double value) {
    if (IsInFrame(film)) sums_[ReplicateOf(i)][BlockOf(film)] += value;
  }
  struct Value {
    double mean = 0, standard_error = 0;
  };
  // The mean of `count` draws, per pixel of the block.
  Value At(size_t block, uint64_t count) const {
    const double scale = kReplicateCount / (static_cast<double>(count) * kPixelsOfBlock);
    Value value;
    for (const auto& sum : sums_) value.mean += sum[block] * scale / kReplicateCount;
    for (const auto& sum : sums_) {
      const double off = sum[block] * scale - value.mean;
      value.standard_error += off * off;
    }
    value.standard_error =
        std::sqrt(value.standard_error / (kReplicateCount * (kReplicateCount - 1)));
    return value;
  }

 private:
  std::array<std::array<double, kBlocks>, kReplicateCount> sums_{};
};

uint64_t ImageDraws() {
  return static_cast<uint64_t>(DrawCount(1 << 14, 1 << 20)) * kReplicateCount;
}

// A white sphere of radiance 1 about the camera is white in every pixel, up to the weights of the
// rays.
TEST(CameraImportanceTest, AWhiteSphereIsWhiteByConnections) {
  std::vector<CameraSetup> setups = CameraSetups();
  setups.push_back(RealisticSetup(false));
  for (const CameraSetup& setup : setups) {
    SCOPED_TRACE(setup.name);
    const Camera camera = Make(setup);
    const bool is_realistic = setup.scene.camera.IsRealistic();
    const double radius = is_realistic ? 10 : 2.6;
    BlockImage connected, rays;
    for (uint64_t i = 0; i < ImageDraws(); ++i) {
      const Draw draw = DrawOf(i, 4);
      // The realistic lens sees a small part of the sphere: its cap within 14 degrees of the axis.
      const double height = is_realistic ? 1 - Cos(14 * kPi / 180) : 2;
      const double z = 1 - height * double{draw.b[1]}, r = std::sqrt(1 - z * z);
      const SinCosPair<double> phi = SinCos(2 * kPi * double{draw.b[2]});
      const Vec3d n{-r * phi.cos, -r * phi.sin, -z};
      const double area = 2 * kPi * height * radius * radius;
      const Vec2f lens{draw.a[2], draw.a[3]};
      const auto seen =
          camera.SampleWi(ToFloat(-radius * n), lens, camera.ShutterFraction(draw.b[0]));
      if (seen && IsInFrame(seen->film)) {
        const double cosine = Dot(n, ToDouble(seen->wi));
        ASSERT_GT(cosine, 0);
        connected.Add(i, seen->film, seen->importance * cosine * area);
      }
      if (is_realistic) {
        float weight = 1;
        camera.MakeRay<kAllTraits>(FilmOf(draw), lens, 0, &weight);
        rays.Add(i, FilmOf(draw), double{weight} * kWidth * kHeight);
      }
    }
    for (size_t block = 0; block < kBlocks; ++block) {
      const BlockImage::Value value = connected.At(block, ImageDraws());
      const BlockImage::Value expected =
          is_realistic ? rays.At(block, ImageDraws()) : BlockImage::Value{1, 0};
      const double error = std::hypot(value.standard_error, expected.standard_error);
      EXPECT_NEAR(value.mean, expected.mean, 6 * error + 1e-4 * expected.mean) << block;
      EXPECT_LT(error, 0.08 * expected.mean) << block;
    }
  }
}

// A patch in front of the focal plane, facing the camera at an angle.
TEST(CameraImportanceTest, APatchIsSeenAlikeByRaysAndConnections) {
  std::vector<CameraSetup> setups = CameraSetups();
  for (const bool moves : {false, true}) setups.push_back(RealisticSetup(moves));
  for (const CameraSetup& setup : setups) {
    SCOPED_TRACE(setup.name);
    const Camera camera = Make(setup);
    const double size = setup.scene.camera.IsRealistic() ? 0.25 : 1;
    const Vec3d corner = Vec3d{-0.7, -0.4, 2.2} * size + Vec3d{0, 0, 2.2 * (1 - size)};
    const Vec3d edge_x = Vec3d{1.1, 0.1, 0.3} * size, edge_y = Vec3d{-0.1, 0.8, 0.1} * size;
    const Vec3d across = Cross(edge_x, edge_y);
    BlockImage weighted_rays, counted_rays, weighted_points, counted_points;
    for (uint64_t i = 0; i < ImageDraws(); ++i) {
      const Draw draw = DrawOf(i, 5);
      const Vec2d film = FilmOf(draw);
      const Vec2f lens{draw.a[2], draw.a[3]};
      const float time = camera.ShutterFraction(draw.b[0]);
      float weight = 1;
      const Ray ray = camera.MakeRay<kAllTraits>(film, lens, time, &weight);
      if (weight != 0) {
        const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
        const double t = Dot(corner - o, across) / Dot(d, across);
        const Vec3d off = o + t * d - corner;
        // Coordinates along the edges, which are not orthogonal.
        const double square = LengthSquared(across);
        const double x = Dot(Cross(off, edge_y), across) / square;
        const double y = Dot(Cross(edge_x, off), across) / square;
        if (t > 0 && x >= 0 && x < 1 && y >= 0 && y < 1) {
          weighted_rays.Add(i, film, double{weight} * kWidth * kHeight);
          // A ray counts if its weight is positive.
          counted_rays.Add(i, film, kWidth * kHeight);
        }
      }
      const Vec3d p = corner + double{draw.b[1]} * edge_x + double{draw.b[2]} * edge_y;
      const auto seen = camera.SampleWi(ToFloat(p), lens, time);
      if (!seen) continue;
      const double area = std::fabs(Dot(across, ToDouble(seen->wi)));
      weighted_points.Add(i, seen->film, seen->importance * area);
      counted_points.Add(i, seen->film, seen->ray_density * area);
    }
    int lit = 0;
    for (size_t block = 0; block < kBlocks; ++block) {
      const auto expect_same = [&](const BlockImage& a, const BlockImage& b) {
        const BlockImage::Value rays = a.At(block, ImageDraws());
        const BlockImage::Value points = b.At(block, ImageDraws());
        const double error = std::hypot(rays.standard_error, points.standard_error);
        EXPECT_NEAR(rays.mean, points.mean, 6 * error + 1e-4 * rays.mean) << block;
        lit += rays.mean > 0 && error < 0.1 * rays.mean;
      };
      expect_same(weighted_rays, weighted_points);
      expect_same(counted_rays, counted_points);
    }
    EXPECT_GE(lit, 2);
  }
}

}  // namespace
}  // namespace sheaf::render
