// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TileRenderer: renders some tiles of the frame with one setting of a study, using all threads.
// StudyReference: the image that its result is compared with.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {

// Samples per pixel of one block: one of each replicate.
inline constexpr uint64_t kStudyBlockSamples = kReplicateCount;

// Calls work(i) for all i below count on this many threads. Returns the first error.
absl::Status ForEachTile(int threads, size_t count,
                         const std::function<absl::Status(size_t)>& work);

// Pixels of a tile, row-major: R, G, B and their standard errors, which are 0 with one sequence.
struct TilePixels {
  std::vector<std::array<float, 3>> value, deviation;
};

class TileRenderer {
 public:
  TileRenderer(const render::CompiledScene& scene, const std::vector<PixelRect>& tiles,
               int threads);

  // Renders the next block of every tile or, with wanted, of each tile that has fewer than
  // wanted[tile] samples. on_part (may be empty) receives every part and is called from several
  // threads.
  using OnPart = std::function<void(size_t tile, const FilmTile& part)>;
  absl::Status RenderBlock(const std::vector<uint64_t>* wanted = nullptr,
                           const OnPart& on_part = {});

  uint64_t samples(size_t tile) const { return trees_[tile].SampleCount(); }
  // CPU seconds spent on a tile so far on this machine.
  double cpu_seconds(size_t tile) const { return cpu_seconds_[tile]; }
  double CpuSeconds() const;
  // Requires: the tile has samples.
  TilePixels Develop(size_t tile) const;
  // All tiles, one below the other, separated by as many empty rows as error estimates reach, so
  // that the image's size does not depend on the frame's. *rects: where each tile is.
  FrameImage Pack(std::vector<PixelRect>* rects) const;
  // The tiles at their own places, in an image of this window. Requires: the window contains them,
  // and all have samples.
  FrameImage Join(const PixelRect& window) const;

 private:
  FrameImage DevelopImage(size_t tile) const;

  const render::CompiledScene& scene_;
  const std::vector<PixelRect>& tiles_;
  int threads_;
  std::vector<TileTree> trees_;
  std::vector<double> cpu_seconds_;
};

// The reference that a study compares with, as accurate as its time allows.
struct StudyReference {
  uint64_t samples = 0;
  double cpu_seconds = 0;
  double mean = 0;  // Over R, G, B of all pixels of the tiles.
  std::vector<TilePixels> tiles;

  // Sum over the pixels of a tile of a squared error e(channel, pixel) of R, G and B, relative to
  // the reference: relMSE as `sheaf compare` defines it, times the number of pixels.
  template <typename SquaredError>
  double RelativeSum(size_t tile, const SquaredError& squared_error) const {
    const double floor = 0.1 * mean;
    double sum = 0;
    for (size_t p = 0; p < tiles[tile].value.size(); ++p) {
      for (size_t c = 0; c < 3; ++c) {
        const double r = tiles[tile].value[p][c];
        const double divisor = r * r + floor * floor;
        if (divisor > 0) sum += squared_error(c, p) / divisor / 3;
      }
    }
    return sum;
  }
};

// Renders blocks until there are this many or may_go_on returns false; returns the image.
absl::StatusOr<StudyReference> RenderReference(TileRenderer* renderer, size_t tile_count,
                                               uint64_t blocks,
                                               const std::function<bool()>& may_go_on);

}  // namespace sheaf::cli
