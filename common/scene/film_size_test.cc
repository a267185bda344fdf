// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/film_size.h"

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/support/scene_text.h"

namespace sheaf {
namespace {

SceneDescription SceneOf(const std::string& film, const std::string& camera = "") {
  return testing::ReadSceneText("Camera \"perspective\" " + camera + "\nFilm \"rgb\" " + film +
                                "\nWorldBegin\n");
}

std::string Size(int width, int height) {
  return "\"integer xresolution\" " + std::to_string(width) + " \"integer yresolution\" " +
         std::to_string(height);
}

void ExpectSameView(const SceneDescription& a, const SceneDescription& b) {
  EXPECT_EQ(a.film.width_px, b.film.width_px);
  EXPECT_EQ(a.film.height_px, b.film.height_px);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(a.camera.screen_window[i], b.camera.screen_window[i]) << i;
    EXPECT_EQ(a.film.crop_window[i], b.film.crop_window[i]) << i;
  }
}

TEST(FilmSizeTest, IsAsIfTheSceneStatedIt) {
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{
           {320, 180}, {100, 100}, {90, 160}, {1, 1}, {3840, 2160}, {17, 31}}) {
    SCOPED_TRACE(width);
    for (const std::string& before : {Size(640, 360), Size(50, 70), Size(33, 33)}) {
      SceneDescription scene = SceneOf(before);
      ResizeFilm(width, height, &scene);
      ExpectSameView(scene, SceneOf(Size(width, height)));
    }
  }
}

TEST(FilmSizeTest, IsAPartOfTheScenes) {
  for (const auto& [percent, width, height] : std::vector<std::tuple<double, int, int>>{
           {50, 320, 180}, {100, 640, 360}, {25, 160, 90}, {300, 1920, 1080}, {.01, 1, 1}}) {
    SceneDescription scene = SceneOf(Size(640, 360));
    ResizeFilm({.fraction = percent / 100}, &scene);
    ExpectSameView(scene, SceneOf(Size(width, height)));
  }
}

TEST(FilmSizeTest, NoneIsNoChange) {
  SceneDescription scene = SceneOf(Size(640, 360), "\"float screenwindow\" [-1 1 -1 1]");
  ResizeFilm(FilmSize{}, &scene);
  ExpectSameView(scene, SceneOf(Size(640, 360), "\"float screenwindow\" [-1 1 -1 1]"));
}

// A window of the film's aspect beside the axis keeps its center and its shorter side; one of
// another aspect is kept, so that the same part of the scene is seen.
TEST(FilmSizeTest, ScreenWindowsKeepTheirCenter) {
  SceneDescription beside = SceneOf(Size(200, 100), "\"float screenwindow\" [1 5 -1 1]");
  ResizeFilm(100, 300, &beside);
  ExpectSameView(beside, SceneOf(Size(100, 300), "\"float screenwindow\" [2 4 -3 3]"));
  SceneDescription stretched = SceneOf(Size(200, 100), "\"float screenwindow\" [-1 1 -1 1]");
  ResizeFilm(100, 300, &stretched);
  ExpectSameView(stretched, SceneOf(Size(100, 300), "\"float screenwindow\" [-1 1 -1 1]"));
}

TEST(FilmSizeTest, CropsStayTheSamePart) {
  SceneDescription scene = SceneOf(Size(200, 100) + " \"integer pixelbounds\" [50 150 0 25]");
  ResizeFilm({.fraction = 2}, &scene);
  EXPECT_FALSE(scene.film.has_pixel_bounds);
  ExpectSameView(scene, SceneOf(Size(400, 200) + " \"float cropwindow\" [.25 .75 0 .25]"));
}

}  // namespace
}  // namespace sheaf
