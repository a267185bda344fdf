// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/delivery/denoise_frame.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/film/denoise/denoise.h"
#include "common/film/denoise/replicate_halves.h"
#include "common/film/exr/exr_codec.h"

namespace sheaf::coordinator {
namespace {

int ThreadCount() {
  const auto processors = static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(processors / 2, 1, kDenoiseThreadsMax);
}

// The sums of a tile from its parts on disk; none if parts were lost.
absl::StatusOr<std::optional<FilmTile>> ReadTile(const FrameId& id, uint32_t tile,
                                                 const FrameMerge& merge, JobStore* store,
                                                 TileBuilder* tiles) {
  const CellGrid& grid = merge.grid();
  const absl::StatusOr<std::vector<PartRow>> rows =
      store->FindTileParts(id, grid.RectOf(tile), grid.KindOf(tile));
  if (!rows.ok()) return rows.status();
  const std::unique_ptr<CellTrees> trees = merge.MakeTrees(tile);
  bool lost = false;
  for (const PartRow& row : *rows) {
    const absl::StatusOr<std::string> bytes = store->ReadPart(row);
    absl::StatusOr<DecodedPart> part =
        bytes.ok() ? DecodePart(*bytes, row.key.tile.PixelCount()) : bytes.status();
    if (!part.ok()) {
      tiles->RevokePart(row, part.status());
      lost = true;
      continue;
    }
    const absl::Status inserted =
        trees->Insert(std::move(part->tile), *grid.MaskOf(tile, row.key.cells));
    if (!inserted.ok()) return inserted;
  }
  if (lost) return std::nullopt;
  if (grid.KindOf(tile) == TaskKind::kCamera) {
    const std::vector<uint64_t> samples = merge.SamplesOfCells();
    for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
      if (trees->SampleCount(i) == samples[grid.first_cell(tile) + i]) continue;
      return absl::FailedPreconditionError(
          absl::StrCat("denoising: the parts of tile ", tile,
                       " on disk do not have the samples of the image; trying again"));
    }
  }
  return trees->Root();
}

}  // namespace

absl::StatusOr<bool> DenoiseFrame(const FrameId& id, JobStore* store, TileBuilder* tiles,
                                  OpenFrame* frame) {
  FrameImage* image = frame->merge.mutable_image();
  ReplicateHalves camera(image->window), light(image->window);
  for (uint32_t tile = 0; tile < frame->merge.tile_count(); ++tile) {
    const absl::StatusOr<std::optional<FilmTile>> sums =
        ReadTile(id, tile, frame->merge, store, tiles);
    if (!sums.ok()) return sums.status();
    if (!sums->has_value()) {
      frame->merge.MarkOnDisk(tile);  // Complete again when those are rendered.
      return false;
    }
    const bool is_light = frame->merge.grid().KindOf(tile) == TaskKind::kLight;
    (is_light ? light : camera).DevelopTile(**sums, image->color);
  }
  if (!light.empty()) camera.Add(light);
  DenoisedLight denoised = Denoise(*image, camera, ThreadCount());
  image->metadata["denoisedMse"] = absl::StrFormat("%.6g", denoised.mse);
  SetDenoised(std::move(denoised), image);
  return true;
}

}  // namespace sheaf::coordinator
