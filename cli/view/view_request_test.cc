// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/view/view_request.h"

#include <gtest/gtest.h>

#include <string>

namespace sheaf::cli {
namespace {

TEST(ViewRequestTest, ReadsSceneAndCamera) {
  const absl::StatusOr<ViewRequest> request =
      ParseViewRequest(R"({"id": 7, "scene": "a.pbrt", "camera": "Camera \"perspective\""})");
  ASSERT_TRUE(request.ok()) << request.status();
  EXPECT_EQ(request->id, 7);
  EXPECT_EQ(request->scene, "a.pbrt");
  EXPECT_EQ(request->camera, "Camera \"perspective\"");
}

TEST(ViewRequestTest, RefusesWhatIsNoRequest) {
  for (const char* line :
       {"", "{", "[]", "7", "{}", R"({"id": 1})", R"({"scene": 3})", R"({"id": "x", "scene": "a"})",
        R"({"id": 1.5, "scene": "a"})", R"({"scene": "a", "camera": []})"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseViewRequest(line).status())) << line;
  }
}

TEST(ViewRequestTest, ReadsTheDirectivesOfASceneFile) {
  const absl::StatusOr<SampledView> view = ReadView(
      "Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 50\n"
      "  \"integer pixelbounds\" [ 10 90 5 45 ]\n"
      "Sampler \"zsobol\" \"integer pixelsamples\" 24\n"
      "LookAt 0 0 -5  0 0 0  0 1 0\n"
      "Camera \"perspective\" \"float fov\" 30",
      {});
  ASSERT_TRUE(view.ok()) << view.status();
  EXPECT_EQ(view->view.width_px, 100);
  EXPECT_EQ(view->view.height_px, 50);
  EXPECT_EQ(view->view.window, (PixelRect{10, 5, 90, 45}));
  EXPECT_EQ(view->samples, 24u);
  EXPECT_FLOAT_EQ(view->view.camera.fov_degrees, 30);
  EXPECT_DOUBLE_EQ(view->view.camera.world_from_camera.start.m[2][3], -5);
}

TEST(ViewRequestTest, SaysWhereATextIsWrong) {
  const absl::Status status = ReadView("Camera \"none\"", {}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_NE(status.message().find("camera:1:1"), std::string::npos) << status;
}

TEST(ViewRequestTest, CoarseViewsCoverTheSameScreen) {
  render::SceneView view;
  view.width_px = 101;
  view.height_px = 50;
  view.window = {10, 5, 91, 45};
  view.camera.screen_window[0] = -2.02;
  view.camera.screen_window[1] = 2.02;
  const render::SceneView coarse = Coarse(view, 4);
  EXPECT_EQ(coarse.width_px, 26);
  EXPECT_EQ(coarse.height_px, 13);
  EXPECT_EQ(coarse.window, (PixelRect{2, 1, 23, 12}));
  // A pixel of the coarse film is four of the film, from the top left on.
  const auto step = [](const render::SceneView& of, int first, int32_t count) {
    const double* screen = of.camera.screen_window;
    return (screen[first + 1] - screen[first]) / count;
  };
  EXPECT_NEAR(step(coarse, 0, 26), 4 * step(view, 0, 101), 1e-12);
  EXPECT_NEAR(step(coarse, 2, 13), 4 * step(view, 2, 50), 1e-12);
  EXPECT_DOUBLE_EQ(coarse.camera.screen_window[0], view.camera.screen_window[0]);
  EXPECT_DOUBLE_EQ(coarse.camera.screen_window[3], view.camera.screen_window[3]);
  EXPECT_EQ(Coarse(view, 1).window, view.window);
}

}  // namespace
}  // namespace sheaf::cli
