// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TileRenderer: renders some tiles of the frame with one setting of a study, using all threads.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "cli/study/light_passes.h"
#include "common/film/film.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {

// Samples per pixel of one block: one of each replicate.
inline constexpr uint64_t kStudyBlockSamples = kReplicateCount;

// Calls work(i) for all i below count on this many threads. Returns the first error.
absl::Status ForEachTile(int threads, size_t count,
                         const std::function<absl::Status(size_t)>& work);

// Tiles of the window, evenly spaced if there are more than count.
inline constexpr int32_t kStudyTilePx = 16;
std::vector<PixelRect> ChooseTiles(const PixelRect& window, size_t count);

// Pixels of a tile, row-major: R, G, B and their standard errors, which are 0 with one sequence.
struct TilePixels {
  std::vector<std::array<float, 3>> value, deviation;
};
// The pixels of an image of a tile.
TilePixels PixelsOf(const FrameImage& image);
// Adds independent light, of the same tile.
void AddPixels(const TilePixels& light, TilePixels* pixels);

class TileRenderer {
 public:
  // light: null, or the light passes that the tiles show too; there are as many as the tile with
  // most samples has. They must outlive this.
  TileRenderer(const render::CompiledScene& scene, const std::vector<PixelRect>& tiles, int threads,
               LightPasses* light = nullptr);

  // Renders the next block of every tile or, with wanted, of each tile that has fewer than
  // wanted[tile] samples, and then light passes. on_part (may be empty) receives every part of a
  // tile and is called from several threads.
  using OnPart = std::function<void(size_t tile, const FilmTile& part)>;
  absl::Status RenderBlock(const std::vector<uint64_t>* wanted = nullptr,
                           const OnPart& on_part = {});

  uint64_t samples(size_t tile) const { return trees_[tile].SampleCount(); }
  // CPU seconds spent on a tile so far on this machine, and on all of them, without light passes.
  double cpu_seconds(size_t tile) const { return cpu_seconds_[tile]; }
  double CpuSeconds() const;
  // Requires: the tile has samples.
  TilePixels Develop(size_t tile) const;
  // All tiles, one below the other, separated by as many empty rows as error estimates reach, so
  // that the image's size does not depend on the frame's. *rects: where each tile is.
  FrameImage Pack(std::vector<PixelRect>* rects) const;
  // The tiles at their own places, in an image of this window. Requires: the window contains them,
  // all have samples, and there are no light passes.
  FrameImage Join(const PixelRect& window) const;

 private:
  FrameImage DevelopImage(size_t tile) const;

  const render::CompiledScene& scene_;
  const std::vector<PixelRect>& tiles_;
  int threads_;
  LightPasses* light_;
  std::vector<TileTree> trees_;
  std::vector<double> cpu_seconds_;
};

}  // namespace sheaf::cli
