// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that goes on from delivered pictures (resumed_picture.h). A picture's samples
// count as done from the start; its tiles are built from it whenever they are built from disk.
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/film/exr_codec.h"
#include "common/scene/primaries.h"
#include "coordinator/service/farm.h"

namespace sheaf::coordinator {
namespace {

// What a picture says of itself, and what it would say if it were of the frame.
struct Claim {
  const char* key;
  std::string wanted;
  const char* what;
};

// Empty where it is a picture of the frame.
std::string WhyNotOf(const FrameSpec& spec, const std::string& numeric_profile,
                     const FramePicture& picture) {
  const auto text_of = [&](const char* key) {
    const auto found = picture.metadata.find(key);
    return found == picture.metadata.end() ? std::string() : found->second;
  };
  if (text_of(kFrameDigestKey) == spec.frame_digest) return "";
  const FrameSettings& s = spec.settings;
  const PixelRect& w = s.window;
  const Claim claims[] = {
      {"numericProfile", numeric_profile, "by another build of Sheaf"},
      {"size", absl::StrCat(s.width_px, "x", s.height_px), "at another size"},
      {"window", absl::StrCat(w.x0, ",", w.y0, ",", w.x1, ",", w.y1), "with another crop"},
      {"seed", absl::StrCat(s.seed), "with another seed"},
      {"depthMax", absl::StrCat(s.max_depth), "with another --max-depth"},
      {"sceneDigest", spec.scene.sha256_hex, "from another scene, or its files have changed"},
  };
  for (const Claim& claim : claims) {
    const std::string text = text_of(claim.key);
    if (text == claim.wanted) continue;
    return absl::StrCat("it was rendered ", claim.what, " (it has ", claim.key, " \"", text,
                        "\", the job \"", claim.wanted, "\")");
  }
  return "it was rendered with other settings (outputs, color, primaries or sampling)";
}

}  // namespace

absl::StatusOr<ResumedPicture> Farm::OpenResumed(const FrameSpec& spec,
                                                 const CellGrid& grid) const {
  const std::string about =
      absl::StrCat("frame ", spec.frame_number, " cannot go on from the picture");
  const FrameSettings& s = spec.settings;
  const absl::StatusOr<std::string> path = blobs_->PathOf(spec.resumed);
  if (!path.ok()) return Annotate(path.status(), about);
  absl::StatusOr<FramePicture> picture = ReadPicture(*path);
  if (!picture.ok()) return Annotate(picture.status(), about);
  if (!s.lattice.All()) {
    return absl::InvalidArgumentError(absl::StrCat(about, ": not all of its pixels are rendered"));
  }
  const std::string why_not = WhyNotOf(spec, numeric_profile_, *picture);
  absl::StatusOr<ResumedPicture> resumed = ResumedPicture::Make(
      *std::move(picture), s.outputs, PictureColorOf(s.primaries, s.white_balance_k));
  if (!why_not.empty() && resumed.ok()) resumed = absl::InvalidArgumentError(why_not);
  if (!resumed.ok()) return Annotate(resumed.status(), about);
  for (const PixelRect& cell : grid.cells()) {
    absl::StatusOr<uint64_t> samples = resumed->SamplesOf(cell);
    if (samples.ok() && *samples > s.samples) {
      samples = absl::InvalidArgumentError(
          absl::StrCat("it has ", *samples, " samples in a pixel already, and the job asks for ",
                       s.samples, "; ask for more with --samples"));
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

void Farm::RestoreResumedParts(uint64_t job_id, const ResumedCounts& resumed) {
  for (const auto& [number, counts] : resumed) {
    const FrameId id{job_id, number};
    const std::shared_ptr<OpenFrame> open = OpenFrameOf(id);
    const CellGrid& grid = open->merge.grid();
    for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
      for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
        const TileCells cell = grid.CellsOf(tile, uint64_t{1} << i);
        for (const SampleBlock& block : PrefixBlocks(counts[grid.first_cell(tile) + i])) {
          scheduler_.RestorePart(id, grid.tiles()[tile], block, cell, {});
        }
      }
      open->merge.MarkOnDisk(tile);
    }
  }
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
