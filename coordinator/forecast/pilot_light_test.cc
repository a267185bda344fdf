// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_light.h"

#include <cmath>
#include <random>
#include <string>

#include "common/film/light/light_image.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr PixelRect kLightWindow{0, 0, 320, 256};
constexpr int32_t kLightShrink = 4;
constexpr PilotLevel kLevel{{}, kPilotPasses, kLightShrink, true};

// Camera paths find 1 in each pixel, with `camera_variance`; light paths find `light(x)`, with the
// variance `variance(x)`, by the pixel's column in the frame. Variances are estimated with 7
// degrees of freedom.
template <typename Light, typename Variance>
PilotImage MakeLightImage(double camera_variance, const Light& light, const Variance& variance) {
  const PixelRect window{0, 0, kLightWindow.x1 / kLightShrink, kLightWindow.y1 / kLightShrink};
  FrameImage camera = MakeFrameImage(window, window.x1, window.y1), of_light = camera;
  std::mt19937_64 random(1);
  std::chi_squared_distribution<double> chi_squared(7);
  size_t p = 0;
  for (int32_t y = 0; y < window.y1; ++y) {
    for (int32_t x = 0; x < window.x1; ++x, ++p) {
      const int32_t column = x * kLightShrink;
      const auto set = [&](FrameImage* image, double value, double square) {
        const auto error = static_cast<float>(std::sqrt(square * chi_squared(random) / 7));
        for (const std::string color : {"R", "G", "B"}) {
          (*image->Find(color))[p] = static_cast<float>(value);
          (*image->Find("stderr." + color))[p] = error;
        }
        (*image->Find("samples"))[p] = static_cast<float>(kPilotPasses);
      };
      set(&camera, 1, camera_variance);
      set(&of_light, light(column), variance(column));
    }
  }
  PilotImage pilot{kLevel, camera, {}, 0.5};
  AddLight(camera, of_light, window, &pilot.image);
  SetLightLayer(of_light, &pilot.image);
  return pilot;
}

const CellGrid kLightGrid(kLightWindow, 32, 32);

LightModel Fit(const PilotImage& image) {
  const auto cell_of = [](int32_t x, int32_t y) {
    return static_cast<size_t>(y / 32 * (kLightWindow.x1 / 32) + x / 32);
  };
  return FitLight(kLightGrid, image, /*mean=*/2, cell_of, kLightWindow.x1 * kLightWindow.y1);
}

// The light of both kinds of path is 2; the floor of relative errors is 0.1 of the mean.
constexpr double kSquare = 2 * 2 + 0.2 * 0.2;

TEST(PilotLightTest, ErrorsAreThoseOfLightPassesAlone) {
  for (const double camera_variance : {0.0, 0.04, 0.4}) {
    const LightModel model = Fit(MakeLightImage(
        camera_variance, [](int32_t) { return 1; }, [](int32_t) { return 0.1; }));
    ASSERT_EQ(model.errors.size(), kLightGrid.cells().size());
    EXPECT_EQ(model.passes, kPilotPasses);
    ErrorSums sum;
    for (const ErrorSums& error : model.errors) sum.Add(error);
    EXPECT_EQ(sum.pixel_count, kLightWindow.PixelCount());
    EXPECT_NEAR(sum.RelativeMse(), 0.1 / kSquare, 0.1 * 0.1 / kSquare) << camera_variance;
    EXPECT_LT(model.log_error_deviation, 0.1);
  }
}

TEST(PilotLightTest, CellsDiffer) {
  const LightModel model = Fit(MakeLightImage(
      0.01, [](int32_t) { return 1; }, [](int32_t x) { return x < 160 ? 0.001 : 0.1; }));
  for (size_t i = 0; i < kLightGrid.cells().size(); ++i) {
    if (kLightGrid.cells()[i].x1 <= 160) {
      EXPECT_LT(model.errors[i].RelativeMse(), 0.2 * 0.1 / kSquare) << i;
    } else {
      EXPECT_NEAR(model.errors[i].RelativeMse(), 0.1 / kSquare, 0.4 * 0.1 / kSquare) << i;
    }
  }
}

// The light image has one path for 16 of the frame's, and took half a second for its passes.
TEST(PilotLightTest, PassesCostByTheirPaths) {
  const LightModel model = Fit(MakeLightImage(
      0.01, [](int32_t) { return 1; }, [](int32_t) { return 0.1; }));
  EXPECT_NEAR(model.cpu_seconds_per_pass, 0.5 / kPilotPasses * 16, 1e-9);
}

TEST(PilotLightTest, PassesThatFindNothingHaveNoErrors) {
  const LightModel model = Fit(MakeLightImage(
      0.01, [](int32_t) { return 0; }, [](int32_t) { return 0; }));
  for (const ErrorSums& error : model.errors) EXPECT_EQ(error.sum, 0);
}

TEST(PilotLightTest, SparsePixelsGetTheLightOfTheirPlace) {
  const PilotImage light = MakeLightImage(
      0.01, [](int32_t x) { return x < 160 ? 3 : 5; }, [](int32_t) { return 0.1; });
  FrameImage sparse = MakeFrameImage(kLightWindow, kLightWindow.x1, kLightWindow.y1);
  for (const int32_t x : {20, 300}) (*sparse.Find("samples"))[kLightWindow.IndexOf(x, 100)] = 8;
  std::array<std::vector<float>, 3> values;
  for (size_t i = 0; i < 3; ++i) values[i].assign(sparse.planes.front().size(), 1);
  AddLightOf(light, sparse, &values);
  for (const std::vector<float>& plane : values) {
    EXPECT_FLOAT_EQ(plane[kLightWindow.IndexOf(20, 100)], 4);
    EXPECT_FLOAT_EQ(plane[kLightWindow.IndexOf(300, 100)], 6);
    EXPECT_EQ(plane[kLightWindow.IndexOf(21, 100)], 1);  // Without samples.
  }
}

TEST(PilotLightTest, TheLargestLightImageCounts) {
  std::vector<PilotImage> pilot(3);
  pilot[0].level.shrink = 2;  // The small image.
  EXPECT_EQ(FindLightImage(pilot), nullptr);
  for (const size_t i : {1, 2}) pilot[i].level = {{}, kPilotPasses, i == 1 ? 9 : 5, true};
  EXPECT_EQ(FindLightImage(pilot), &pilot[2]);
}

}  // namespace
}  // namespace sheaf::coordinator
