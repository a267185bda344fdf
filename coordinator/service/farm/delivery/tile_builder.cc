// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/delivery/tile_builder.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/film/exr/exr_codec.h"

namespace sheaf::coordinator {

absl::Status TileBuilder::Rebuild(OpenFrame* frame, const FrameId& id, uint32_t tile) {
  const CellGrid& grid = frame->merge.grid();
  const PartKeys left = removals_.Left();
  const absl::StatusOr<std::vector<PartRow>> rows =
      store_.FindTileParts(id, grid.RectOf(tile), grid.KindOf(tile));
  if (!rows.ok()) return rows.status();
  // Part by part: together, the light tile's parts are many times its size.
  std::unique_ptr<CellTrees> trees = frame->merge.MakeTrees(tile);
  if (absl::Status s = InsertResumed(frame, tile, trees.get()); !s.ok()) return s;
  absl::Status merged;
  bool lost = false;
  for (const PartRow& row : *rows) {
    if (left.contains(row.key)) continue;
    absl::StatusOr<std::string> bytes = store_.ReadPart(row);
    absl::Status status = bytes.status();
    if (bytes.ok()) {
      absl::StatusOr<DecodedPart> part = DecodePart(*bytes, row.key.tile.PixelCount());
      status = part.status();
      if (part.ok()) {
        merged.Update(trees->Insert(std::move(part->tile), *grid.MaskOf(tile, row.key.cells)));
      }
    }
    if (status.ok()) continue;
    RevokePart(row, status);
    lost = true;
  }
  if (lost) {
    frame->merge.MarkOnDisk(tile);  // Complete again when those are rendered.
    return absl::OkStatus();
  }
  if (!merged.ok()) return merged;
  return frame->merge.Rebuild(tile, std::move(trees));
}

void TileBuilder::RevokePart(const PartRow& row, const absl::Status& why) {
  LogWarning(absl::StrCat("a part is lost and will be rendered again: ", why.message()));
  removals_.Remove({row});
  store_.NoteUsage({row.key.frame.job_id},
                   {.lost_count = 1, .lost_cpu_duration = row.cost.cpu_duration});
  const MutexLock lock(&tables_.mutex);
  const FrameRecord* frame = tables_.scheduler.FindFrame(row.key.frame);
  if (frame == nullptr || frame->tasks == nullptr) return;
  const std::optional<Task> task =
      frame->tasks->Find(row.key.tile, row.key.block, row.key.cells, row.key.kind);
  const bool is_done = task && frame->tasks->FitOf(*task) == FrameTasks::Fit::kCovered;
  if (is_done) tables_.scheduler.Revoke(row.key.frame, *task);
}

absl::Status TileBuilder::InsertResumed(OpenFrame* frame, uint32_t tile, CellTrees* trees) const {
  if (frame->spec.resumed.sha256_hex.empty()) return absl::OkStatus();
  const CellGrid& grid = frame->merge.grid();
  if (!frame->resumed) {
    absl::StatusOr<ResumedImage> resumed = resumed_.Open(frame->spec, grid);
    if (!resumed.ok()) return resumed.status();
    frame->resumed = *std::move(resumed);
  }
  absl::Status inserted;
  if (grid.KindOf(tile) == TaskKind::kLight) {
    for (const SampleBlock& block : PrefixBlocks(frame->resumed->light_pass_count())) {
      inserted.Update(trees->Insert(frame->resumed->LightPartOf(block), grid.AllOf(tile)));
    }
    return inserted;
  }
  for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
    for (FilmTile& part : frame->resumed->PartsOf(grid.cells()[grid.first_cell(tile) + i])) {
      inserted.Update(trees->Insert(std::move(part), uint64_t{1} << i));
    }
  }
  return inserted;
}

}  // namespace sheaf::coordinator
