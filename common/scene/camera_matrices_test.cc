// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/camera_matrices.h"

#include <gtest/gtest.h>

#include <array>

#include "common/math/transform.h"

namespace sheaf {
namespace {

// As programs read the attributes: the point is a row.
std::array<double, 4> Multiply(std::array<double, 4> point, const std::vector<float>& rows) {
  std::array<double, 4> result{};
  for (size_t k = 0; k < 4; ++k) {
    for (size_t i = 0; i < 4; ++i) result[k] += point[i] * static_cast<double>(rows[4 * i + k]);
  }
  return result;
}

CameraDescription CameraAt(double x) {
  CameraDescription camera;
  camera.world_from_camera.start = camera.world_from_camera.end = TranslateMatrix({x, 0, 0});
  camera.screen_window[0] = -2;
  camera.screen_window[1] = 2;
  return camera;
}

TEST(CameraMatricesTest, PerspectiveMapsTheFrameToItsCorners) {
  const CameraMatrices matrices = CameraMatricesOf(CameraAt(10));
  ASSERT_EQ(matrices.world_to_camera.size(), 16u);
  ASSERT_EQ(matrices.world_to_ndc.size(), 16u);
  EXPECT_DOUBLE_EQ(Multiply({13, 2, 5, 1}, matrices.world_to_camera)[0], 3);
  // 90 degrees along the shorter side: at a depth of 5 the frame is 20 wide and 10 high.
  for (const auto& [x, y, u, v] : {std::array<double, 4>{0, 5, 0, 0},
                                   {20, -5, 1, 1},
                                   {10, 0, 0.5, 0.5},
                                   {15, 2.5, 0.75, 0.25}}) {
    const std::array<double, 4> ndc = Multiply({x, y, 5, 1}, matrices.world_to_ndc);
    EXPECT_NEAR(ndc[0] / ndc[3], u, 1e-6);
    EXPECT_NEAR(ndc[1] / ndc[3], v, 1e-6);
  }
}

TEST(CameraMatricesTest, OrthographicDoesNotDependOnDepth) {
  CameraDescription camera = CameraAt(0);
  camera.kind = CameraDescription::Kind::kOrthographic;
  const CameraMatrices matrices = CameraMatricesOf(camera);
  for (const double depth : {1.0, 70.0}) {
    const std::array<double, 4> ndc = Multiply({2, -1, depth, 1}, matrices.world_to_ndc);
    EXPECT_NEAR(ndc[0], 1, 1e-6);
    EXPECT_NEAR(ndc[1], 1, 1e-6);
    EXPECT_DOUBLE_EQ(ndc[3], 1);
  }
}

TEST(CameraMatricesTest, OtherCamerasHaveNoPlane) {
  CameraDescription camera = CameraAt(0);
  camera.kind = CameraDescription::Kind::kEquirectangular;
  EXPECT_EQ(CameraMatricesOf(camera).world_to_camera.size(), 16u);
  EXPECT_TRUE(CameraMatricesOf(camera).world_to_ndc.empty());
  camera.world_from_camera.start.m[0][0] = 0;
  EXPECT_TRUE(CameraMatricesOf(camera).world_to_camera.empty());
}

}  // namespace
}  // namespace sheaf
