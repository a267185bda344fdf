// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/resumed_frames.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/frame_image.h"
#include "coordinator/forecast/image_start.h"

namespace sheaf::coordinator {
namespace {

// An image may have more channels than the frame that resumes it, by this factor.
constexpr int64_t kChannelFactorMax = 4;

// The memory that the image of a frame may take.
int64_t ImageBytesMax(const FrameSettings& settings) {
  const auto pixel_bytes =
      static_cast<int64_t>(ImageChannelCount(settings.outputs) * sizeof(float));
  return kChannelFactorMax * pixel_bytes * settings.window.PixelCount();
}

}  // namespace

absl::StatusOr<ResumedImage> ResumedFrames::Open(const FrameSpec& spec,
                                                 const CellGrid& grid) const {
  const std::string about =
      absl::StrCat("frame ", spec.frame_number, " cannot continue from the image");
  const absl::StatusOr<std::string> path = blobs_.PathOf(spec.resumed);
  if (!path.ok()) return Annotate(path.status(), about);
  absl::StatusOr<FrameImage> image = ReadFrameImage(*path, ImageBytesMax(spec.settings));
  if (!image.ok()) return Annotate(image.status(), about);
  absl::StatusOr<ResumedImage> resumed = ResumeImage(*std::move(image), spec, numeric_profile_);
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

absl::Status ResumedFrames::ContinueFrom(const std::string& path, const Partition& partition,
                                         FrameSpec* spec) const {
  const absl::StatusOr<std::string> bytes =
      ReadWholeFile(path, static_cast<uint64_t>(ImageBytesMax(spec->settings)));
  if (!bytes.ok()) return bytes.status();
  const absl::StatusOr<BlobDigest> image = blobs_.Put(*bytes);
  if (!image.ok()) return image.status();
  FrameSpec continued = *spec;
  continued.resumed = *image;
  const absl::Status opened = Open(continued, CellGrid(continued, partition)).status();
  if (opened.ok()) *spec = std::move(continued);
  return opened;
}

absl::StatusOr<ResumedCounts> ResumedFrames::Count(const std::vector<FrameSpec>& frames,
                                                   const Partition& partition) const {
  ResumedCounts counts;
  for (const FrameSpec& spec : frames) {
    if (spec.resumed.sha256_hex.empty()) continue;
    const CellGrid grid(spec, partition);
    const absl::StatusOr<ResumedImage> resumed = Open(spec, grid);
    if (!resumed.ok()) return resumed.status();
    std::vector<uint64_t>& of_frame = counts[spec.frame_number];
    for (const PixelRect& cell : grid.cells()) of_frame.push_back(*resumed->SamplesOf(cell));
  }
  return counts;
}

}  // namespace sheaf::coordinator
