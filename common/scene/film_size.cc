// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/film_size.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sheaf {
namespace {

// Relative difference of two aspect ratios that count as one: files state windows as floats.
constexpr double kAspectTolerance = 1e-5;

bool HasSquarePixels(const double (&window)[4], double aspect) {
  const double width = window[1] - window[0], height = window[3] - window[2];
  return std::fabs(width - aspect * height) <= kAspectTolerance * std::fabs(width);
}

void ChangeAspect(double aspect, double (&window)[4]) {
  const double center_x = 0.5 * (window[0] + window[1]), center_y = 0.5 * (window[2] + window[3]);
  const double half_width = 0.5 * (window[1] - window[0]);
  const double half_height = 0.5 * (window[3] - window[2]);
  const double shorter = std::min(half_width, half_height);
  const double x = aspect > 1 ? shorter * aspect : shorter;
  const double y = aspect > 1 ? shorter : shorter / aspect;
  window[0] = center_x - x;
  window[1] = center_x + x;
  window[2] = center_y - y;
  window[3] = center_y + y;
}

int32_t ScaledPixels(int32_t pixels, double factor) {
  return static_cast<int32_t>(std::clamp(std::round(pixels * factor), 1.0,
                                         double{std::numeric_limits<int32_t>::max()}));
}

}  // namespace

void ResizeFilm(int32_t width_px, int32_t height_px, SceneDescription* scene) {
  FilmDescription& film = scene->film;
  if (width_px == film.width_px && height_px == film.height_px) return;
  const double before = static_cast<double>(film.width_px) / film.height_px;
  const double after = static_cast<double>(width_px) / height_px;
  if (HasSquarePixels(scene->camera.screen_window, before)) {
    ChangeAspect(after, scene->camera.screen_window);
  }
  if (film.has_pixel_bounds) {
    for (size_t i = 0; i < 4; ++i) {
      film.crop_window[i] =
          static_cast<double>(film.pixel_bounds[i]) / (i < 2 ? film.width_px : film.height_px);
    }
    film.has_pixel_bounds = false;
  }
  film.width_px = width_px;
  film.height_px = height_px;
}

void ResizeFilm(const FilmSize& size, SceneDescription* scene) {
  const FilmDescription& film = scene->film;
  if (size.IsInPixels()) {
    ResizeFilm(size.width_px, size.height_px, scene);
  } else if (size.fraction > 0 && film.width_px > 0 && film.height_px > 0) {
    ResizeFilm(ScaledPixels(film.width_px, size.fraction),
               ScaledPixels(film.height_px, size.fraction), scene);
  }
}

}  // namespace sheaf
