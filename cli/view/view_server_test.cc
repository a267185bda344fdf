// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/view/view_server.h"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf::cli {
namespace {

// A camera of 64 x 48 pixels, times `scale`, with these samples; more: its parameters.
std::string CameraText(int samples, const std::string& from = "0 0 -4",
                       const std::string& more = "\"float fov\" 40", int scale = 1) {
  return absl::StrCat("Film \"rgb\" \"integer xresolution\" ", 64 * scale,
                      " \"integer yresolution\" ", 48 * scale,
                      "\nSampler \"zsobol\" \"integer pixelsamples\" ", samples, "\nLookAt ", from,
                      "  0 0 0  0 1 0\nCamera \"perspective\" ", more);
}

std::string WriteScene(const std::string& name, const std::string& world) {
  const std::string path = ::testing::TempDir() + "/" + name;
  std::ofstream(path) << CameraText(4) << "\nWorldBegin\n" << world;
  return path;
}

std::string BallScene() {
  return WriteScene("ball.pbrt",
                    "LightSource \"infinite\" \"rgb L\" [ .2 .3 .4 ]\n"
                    "LightSource \"point\" \"point3 from\" [ 3 3 -3 ] \"rgb I\" [ 9 9 9 ]\n"
                    "Material \"diffuse\" \"rgb reflectance\" [ .8 .4 .2 ]\n"
                    "Shape \"sphere\" \"float radius\" 1\n");
}

// A server whose events are kept.
class Viewer {
 public:
  explicit Viewer(int threads = 2)
      : server_({}, threads,
                {[this](const ViewFrame& frame) {
                   frames.push_back(frame);
                   return goes_on;
                 },
                 [this](int64_t id, const ViewedScene&, double) {
                   loaded.push_back(id);
                   return true;
                 },
                 [this](int64_t id, const absl::Status& status) {
                   failed.push_back(id);
                   failure = status;
                   return true;
                 }}) {}

  // The last image of a request.
  ViewFrame See(const ViewRequest& request) {
    server_.Ask(request);
    server_.Wait();
    return frames.empty() ? ViewFrame() : frames.back();
  }
  ViewServer& server() { return server_; }

  std::vector<ViewFrame> frames;
  std::vector<int64_t> loaded, failed;
  absl::Status failure;
  bool goes_on = true;

 private:
  ViewServer server_;  // Ends first.
};

std::array<double, 4> Means(const ViewFrame& frame) {
  std::array<double, 4> means{};
  for (size_t i = 0; i < frame.pixels.size(); ++i) {
    means[i % 4] +=
        4.0 * static_cast<double>(frame.pixels[i]) / static_cast<double>(frame.pixels.size());
  }
  return means;
}

TEST(ViewServerTest, GivesCoarseImagesThenFinerOnes) {
  Viewer viewer;
  viewer.See({5, BallScene(), CameraText(64, "0 0 -4", "\"float fov\" 40", 4)});
  ASSERT_TRUE(viewer.failed.empty()) << viewer.failure;
  EXPECT_EQ(viewer.loaded, std::vector<int64_t>{5});
  ASSERT_GE(viewer.frames.size(), 4u);
  EXPECT_GT(viewer.frames.front().divisor, 1);
  for (size_t i = 0; i < viewer.frames.size(); ++i) {
    const ViewFrame& frame = viewer.frames[i];
    EXPECT_EQ(frame.id, 5);
    EXPECT_EQ(frame.pixels.size(), 4 * static_cast<size_t>(frame.window.PixelCount()));
    EXPECT_EQ(frame.is_complete, i + 1 == viewer.frames.size());
    if (i == 0) continue;
    const ViewFrame& before = viewer.frames[i - 1];
    EXPECT_TRUE(frame.divisor < before.divisor ||
                (frame.divisor == before.divisor && frame.samples > before.samples));
  }
  EXPECT_EQ(viewer.frames.back().samples, 64u);
  // All show the same.
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(Means(viewer.frames.front())[c], Means(viewer.frames.back())[c], 0.05) << c;
  }
}

TEST(ViewServerTest, KeepsTheSceneWhereTheCameraMoves) {
  const std::string scene = BallScene(), near = CameraText(16, "0 0 -4", "\"float fov\" 20");
  const std::string side = CameraText(16, "3 1 -2");
  Viewer moved;
  moved.See({1, scene, CameraText(4)});
  const ViewFrame zoomed = moved.See({2, "", near});
  const ViewFrame beside = moved.See({3, "", side});
  EXPECT_EQ(moved.loaded, std::vector<int64_t>{1});
  ASSERT_TRUE(moved.failed.empty()) << moved.failure;
  Viewer fresh;
  const ViewFrame zoomed_fresh = fresh.See({2, scene, near});
  EXPECT_EQ(zoomed.pixels, zoomed_fresh.pixels) << "the place of the camera is the same";
  Viewer fresh_beside;
  const ViewFrame beside_fresh = fresh_beside.See({3, scene, side});
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(Means(beside)[c], Means(beside_fresh)[c], 1e-3) << c;
  }
  EXPECT_NE(Means(beside), Means(zoomed));
}

TEST(ViewServerTest, CompilesAgainForALens) {
  Viewer viewer;
  viewer.See({1, BallScene(), CameraText(4)});
  const ViewFrame sharp = viewer.See({2, "", CameraText(64)});
  const ViewFrame blurred = viewer.See(
      {3, "",
       CameraText(64, "0 0 -4",
                  "\"float fov\" 40 \"float lensradius\" 0.4 \"float focaldistance\" 1")});
  ASSERT_TRUE(viewer.failed.empty()) << viewer.failure;
  EXPECT_TRUE(blurred.is_complete);
  // Pixels that the ball covers in part.
  const auto edges = [](const ViewFrame& frame) {
    int count = 0;
    for (size_t i = 3; i < frame.pixels.size(); i += 4) {
      count += static_cast<int>(frame.pixels[i] > 0.05f && frame.pixels[i] < 0.95f);
    }
    return count;
  };
  EXPECT_GT(edges(blurred), 2 * edges(sharp));
  EXPECT_EQ(viewer.See({4, "", CameraText(64)}).pixels.size(), sharp.pixels.size());
}

TEST(ViewServerTest, TheNewestRequestHolds) {
  Viewer viewer;
  for (int64_t id = 1; id <= 20; ++id) {
    viewer.server().Ask({id, id == 1 ? BallScene() : "",
                         CameraText(id < 20 ? 1 << 16 : 4, absl::StrCat(id, " 0 -4"))});
  }
  viewer.server().Wait();
  ASSERT_FALSE(viewer.frames.empty()) << viewer.failure;
  EXPECT_EQ(viewer.frames.back().id, 20);
  EXPECT_TRUE(viewer.frames.back().is_complete);
  for (const ViewFrame& frame : viewer.frames) {
    EXPECT_TRUE(frame.id == 20 || !frame.is_complete);
  }
}

TEST(ViewServerTest, ErrorsLeaveItUsable) {
  Viewer viewer;
  viewer.See({1, "", CameraText(4)});
  EXPECT_TRUE(absl::IsFailedPrecondition(viewer.failure)) << viewer.failure;
  viewer.See({2, ::testing::TempDir() + "/missing.pbrt", ""});
  EXPECT_TRUE(absl::IsNotFound(viewer.failure)) << viewer.failure;
  viewer.See({3, WriteScene("wrong.pbrt", "Shape \"sphere\" \"float radius\" \"wide\"\n"), ""});
  viewer.See({4, BallScene(), ""});
  viewer.See({5, "", "Camera \"none\""});
  EXPECT_EQ(viewer.failed, (std::vector<int64_t>{1, 2, 3, 5}));
  EXPECT_TRUE(viewer.See({6, "", CameraText(4)}).is_complete);
}

TEST(ViewServerTest, EndsWhileItRenders) {
  Viewer viewer;
  viewer.server().Ask({1, BallScene(), CameraText(1 << 20)});
}

TEST(ViewServerTest, EndsWhereNobodyLooks) {
  Viewer viewer;
  viewer.goes_on = false;
  viewer.See({1, BallScene(), CameraText(1 << 20)});
  EXPECT_EQ(viewer.frames.size(), 1u);
}

}  // namespace
}  // namespace sheaf::cli
