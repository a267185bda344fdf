// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/light_passes.h"

#include <algorithm>
#include <utility>

#include "cli/study/study_tiles.h"
#include "common/base/memory_room.h"
#include "common/base/mutex.h"
#include "worker/render/light_pass.h"

namespace sheaf::cli {
namespace {

// Light passes may take this fraction of the free memory.
constexpr uint64_t kMemoryDivisor = 2;

int ThreadsInMemory(const render::CompiledScene& scene, int threads) {
  const FrameSettings& settings = SettingsOf(scene);
  const uint64_t bytes =
      render::LightPassMemoryBytes(settings.window, {0, 1}, LightOutputsOf(settings));
  const uint64_t passes = FindMemoryRoom().bytes / kMemoryDivisor / std::max<uint64_t>(bytes, 1);
  return static_cast<int>(std::clamp<uint64_t>(passes, 1, static_cast<uint64_t>(threads)));
}

// The pixel among `small` pixels that lies where `at` lies among `full` ones.
int32_t PlaceOf(int32_t at, int32_t full, int32_t small, int32_t begin, int32_t end) {
  const int64_t place = (2 * int64_t{at} + 1) * small / (2 * int64_t{full});
  return static_cast<int32_t>(std::clamp<int64_t>(place, begin, end - 1));
}

}  // namespace

size_t IndexInPlace(const PixelRect& window, int32_t small_width_px, int32_t small_height_px,
                    int32_t x, int32_t y, int32_t width_px, int32_t height_px) {
  return window.IndexOf(PlaceOf(x, width_px, small_width_px, window.x0, window.x1),
                        PlaceOf(y, height_px, small_height_px, window.y0, window.y1));
}

FrameImage LightOf(const FrameImage& light, const PixelRect& rect, int32_t frame_width_px,
                   int32_t frame_height_px) {
  FrameImage image = MakeFrameImage(rect, frame_width_px, frame_height_px, light.outputs);
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      const size_t from = IndexInPlace(light.window, light.frame_width_px, light.frame_height_px, x,
                                       y, frame_width_px, frame_height_px);
      const size_t to = rect.IndexOf(x, y);
      for (size_t plane = 0; plane < image.planes.size(); ++plane) {
        image.planes[plane][to] = light.planes[plane][from];
      }
    }
  }
  return image;
}

LightPasses::LightPasses(const render::CompiledScene& scene, int threads)
    : scene_(scene), threads_(ThreadsInMemory(scene, threads)), tree_(SettingsOf(scene).window) {}

absl::Status LightPasses::RenderUntil(uint64_t count) {
  if (count <= count_) return absl::OkStatus();
  Mutex mutex;  // For the tree and the time.
  absl::Status status = ForEachTile(threads_, count - count_, [&](size_t i) -> absl::Status {
    render::RenderStats stats;
    absl::StatusOr<FilmTile> pass =
        RenderLightPass(scene_, SettingsOf(scene_).window, {count_ + i, 1}, {}, &stats);
    if (!pass.ok()) return pass.status();
    const MutexLock lock(&mutex);
    cpu_seconds_ += stats.cpu_seconds;
    return tree_.Insert(*std::move(pass));
  });
  if (!status.ok()) return status;
  count_ = count;
  image_.reset();
  return absl::OkStatus();
}

double LightPasses::CpuSeconds(int64_t frame_pixels) const {
  const FrameSettings& settings = SettingsOf(scene_);
  const double pixels = static_cast<double>(settings.width_px) * settings.height_px;
  return cpu_seconds_ * static_cast<double>(frame_pixels) / pixels;
}

const FrameImage& LightPasses::Image() {
  if (!image_) {
    const FrameSettings& settings = SettingsOf(scene_);
    image_ = MakeFrameImage(settings.window, settings.width_px, settings.height_px,
                            LightOutputsOf(settings));
    DevelopTile(tree_.Root(), &*image_);
  }
  return *image_;
}

}  // namespace sheaf::cli
