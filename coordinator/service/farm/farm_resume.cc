// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that goes on from delivered pictures (resumed_picture.h). A picture's samples
// count as done from the start; its tiles are built from it whenever they are built from disk.
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/film/exr/exr_codec.h"
#include "coordinator/forecast/picture_start.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {

absl::StatusOr<ResumedPicture> Farm::OpenResumed(const FrameSpec& spec,
                                                 const CellGrid& grid) const {
  const std::string about =
      absl::StrCat("frame ", spec.frame_number, " cannot continue from the image");
  const absl::StatusOr<std::string> path = blobs_->PathOf(spec.resumed);
  if (!path.ok()) return Annotate(path.status(), about);
  absl::StatusOr<FramePicture> picture = ReadPicture(*path);
  if (!picture.ok()) return Annotate(picture.status(), about);
  absl::StatusOr<ResumedPicture> resumed =
      ResumePicture(*std::move(picture), spec, numeric_profile_);
  if (!resumed.ok()) return Annotate(resumed.status(), about);
  for (const PixelRect& cell : grid.cells()) {
    absl::StatusOr<uint64_t> samples = resumed->SamplesOf(cell);
    if (samples.ok() && *samples > spec.settings.samples) {
      samples = absl::InvalidArgumentError(
          absl::StrCat("it has ", *samples, " samples per pixel already, but the job requests ",
                       spec.settings.samples, "; request more with --samples"));
    }
    if (!samples.ok()) return Annotate(samples.status(), about);
  }
  return resumed;
}

absl::StatusOr<Farm::ResumedCounts> Farm::CountResumed(const std::vector<FrameSpec>& frames,
                                                       const Partition& partition) const {
  ResumedCounts counts;
  for (const FrameSpec& spec : frames) {
    if (spec.resumed.sha256_hex.empty()) continue;
    const CellGrid grid(spec, partition);
    const absl::StatusOr<ResumedPicture> resumed = OpenResumed(spec, grid);
    if (!resumed.ok()) return resumed.status();
    std::vector<uint64_t>& of_frame = counts[spec.frame_number];
    for (const PixelRect& cell : grid.cells()) of_frame.push_back(*resumed->SamplesOf(cell));
  }
  return counts;
}

void Farm::RestoreResumed(uint64_t job_id, const ResumedCounts& resumed) {
  for (const auto& [number, counts] : resumed) {
    scheduler_.RestoreRound({job_id, number}, counts);
  }
}

Farm::TilesOnDisk Farm::RestoreResumedParts(uint64_t job_id, const ResumedCounts& resumed) {
  TilesOnDisk on_disk;
  for (const auto& [number, counts] : resumed) {
    const FrameId id{job_id, number};
    const CellGrid& grid = scheduler_.FindFrame(id)->tasks->grid();
    for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
      for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
        const TileCells cell = grid.CellsOf(tile, uint64_t{1} << i);
        for (const SampleBlock& block : PrefixBlocks(counts[grid.first_cell(tile) + i])) {
          scheduler_.RestorePart(id, grid.tiles()[tile], block, cell, {});
        }
      }
      on_disk[id].insert(tile);
    }
  }
  return on_disk;
}

absl::StatusOr<std::vector<CellPart>> Farm::ResumedParts(OpenFrame* frame, uint32_t tile) const {
  std::vector<CellPart> parts;
  if (frame->spec.resumed.sha256_hex.empty()) return parts;
  const CellGrid& grid = frame->merge.grid();
  if (!frame->resumed) {
    absl::StatusOr<ResumedPicture> resumed = OpenResumed(frame->spec, grid);
    if (!resumed.ok()) return resumed.status();
    frame->resumed = *std::move(resumed);
  }
  for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
    for (FilmTile& part : frame->resumed->PartsOf(grid.cells()[grid.first_cell(tile) + i])) {
      parts.push_back({std::move(part), uint64_t{1} << i});
    }
  }
  return parts;
}

}  // namespace sheaf::coordinator
