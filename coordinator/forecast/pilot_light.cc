// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_light.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "common/base/check.h"
#include "common/film/error/error_planes.h"
#include "common/film/light/light_image.h"
#include "coordinator/forecast/pilot_errors.h"

namespace sheaf::coordinator {
namespace {

constexpr std::array kColors = {"R", "G", "B"};
// Pixels around one whose mean is its light, in each direction; and the edge of a block.
constexpr int32_t kAboutPx = 1, kBlockPx = 3;

const std::vector<float>& PlaneOf(const FrameImage& image, std::string_view channel) {
  const std::vector<float>* plane = image.Find(std::string(channel));
  SHEAF_CHECK(plane != nullptr);
  return *plane;
}

PixelRect Around(int32_t x, int32_t y, const PixelRect& window) {
  const int32_t u = std::clamp(x, window.x0, window.x1 - 1);
  const int32_t v = std::clamp(y, window.y0, window.y1 - 1);
  return Intersect({u - kAboutPx, v - kAboutPx, u + kAboutPx + 1, v + kAboutPx + 1}, window);
}

float MeanOf(const std::vector<float>& plane, const PixelRect& rect, const PixelRect& window) {
  double sum = 0;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) sum += plane[window.IndexOf(x, y)];
  }
  return static_cast<float>(sum / static_cast<double>(rect.PixelCount()));
}

// The errors of the image's light passes alone.
std::vector<PilotBlock> LightBlocksOf(const PilotImage& light, double mean,
                                      const std::function<size_t(int32_t x, int32_t y)>& cell_of) {
  const FrameImage& image = light.image;
  const PixelRect& window = image.window;
  const ErrorPlanes planes(image);
  const std::vector<double> fractions = LightFractions(image);
  const int32_t shrink = light.level.shrink;
  std::vector<PilotBlock> blocks;
  for (int32_t y0 = window.y0; y0 < window.y1; y0 += kBlockPx) {
    for (int32_t x0 = window.x0; x0 < window.x1; x0 += kBlockPx) {
      const PixelRect rect = Intersect({x0, y0, x0 + kBlockPx, y0 + kBlockPx}, window);
      const std::vector<PixelError> errors = PixelErrors(planes, image, rect, mean);
      PilotBlock& block = blocks.emplace_back();
      block.cell = cell_of((rect.x0 + rect.x1) * shrink / 2, (rect.y0 + rect.y1) * shrink / 2);
      size_t next = 0;
      for (int32_t y = rect.y0; y < rect.y1; ++y) {
        for (int32_t x = rect.x0; x < rect.x1; ++x) {
          const double error = errors[next++].value * fractions[window.IndexOf(x, y)];
          block.error.Add({1, error, error * error});
        }
      }
    }
  }
  return blocks;
}

}  // namespace

std::vector<double> LightFractions(const FrameImage& image) {
  std::vector<double> light(image.planes.front().size()), all(light.size());
  for (const std::string color : kColors) {
    const std::vector<float>& of_light = PlaneOf(image, LightErrorChannel(color));
    const std::vector<float>& of_all = PlaneOf(image, "stderr." + color);
    for (size_t p = 0; p < light.size(); ++p) {
      light[p] += double{of_light[p]} * of_light[p];
      all[p] += double{of_all[p]} * of_all[p];
    }
  }
  for (size_t p = 0; p < light.size(); ++p) {
    light[p] = all[p] > 0 ? std::min(1.0, light[p] / all[p]) : 0;
  }
  return light;
}

const PilotImage* FindLightImage(std::span<const PilotImage> pilot) {
  const PilotImage* found = nullptr;
  for (const PilotImage& image : pilot) {
    if (!image.level.is_light_image) continue;
    if (found == nullptr || image.level.shrink < found->level.shrink) found = &image;
  }
  return found;
}

void AddLightOf(const PilotImage& light, const FrameImage& sparse,
                std::array<std::vector<float>, 3>* planes) {
  const PixelRect& window = sparse.window;
  const int32_t shrink = light.level.shrink;
  const std::vector<float>& samples = *sparse.Find("samples");
  for (size_t i = 0; i < kColors.size(); ++i) {
    const std::vector<float>& of_light = PlaneOf(light.image, LightMeanChannel(kColors[i]));
    for (int32_t y = window.y0; y < window.y1; ++y) {
      for (int32_t x = window.x0; x < window.x1; ++x) {
        const size_t p = window.IndexOf(x, y);
        if (samples[p] == 0) continue;
        const PixelRect about = Around(x / shrink, y / shrink, light.image.window);
        (*planes)[i][p] += MeanOf(of_light, about, light.image.window);
      }
    }
  }
}

LightModel FitLight(const CellGrid& grid, const PilotImage& light, double mean,
                    const std::function<size_t(int32_t x, int32_t y)>& cell_of,
                    double frame_paths) {
  const std::vector<PilotBlock> blocks = LightBlocksOf(light, mean, cell_of);
  const PilotErrors errors = FitCellErrors(grid, blocks);
  LightModel model;
  model.passes = light.level.samples;
  model.log_error_deviation = LogDeviationOf(blocks);
  // As for the errors of camera samples (FitErrorModel).
  const double skew = std::exp(model.log_error_deviation * model.log_error_deviation / 2);
  for (size_t i = 0; i < grid.cells().size(); ++i) {
    const auto count = static_cast<double>(grid.cells()[i].PixelCount());
    const double error = skew * errors.of_cells[i];
    model.errors.push_back(
        {grid.cells()[i].PixelCount(), count * error, count * errors.square_ratio * error * error});
  }
  const FrameImage& image = light.image;
  const double paths = static_cast<double>(image.frame_width_px) * image.frame_height_px;
  model.cpu_seconds_per_pass =
      light.light_cpu_seconds / static_cast<double>(model.passes) * frame_paths / paths;
  return model;
}

}  // namespace sheaf::coordinator
