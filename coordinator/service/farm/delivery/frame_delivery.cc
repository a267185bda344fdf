// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/delivery/frame_delivery.h"

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/base/cpu_clock.h"
#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "common/film/cryptomatte.h"
#include "common/film/denoised_output.h"
#include "common/film/error/eye_errors.h"
#include "common/film/error/rare_layers.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/stereo_views.h"
#include "common/scene/settings/frame_settings_fields.h"
#include "coordinator/forecast/one_sequence.h"
#include "coordinator/service/farm/delivery/denoise_frame.h"

namespace sheaf::coordinator {
namespace {

// A preview may take at most this share of one core.
constexpr double kPreviewFractionMax = 0.1;

// The values from which the image can be rendered again. Without date and host, so that equal
// images are equal files.
std::map<std::string, std::string> ImageMetadata(const FrameSpec& spec,
                                                 const std::string& numeric_profile,
                                                 const Partition& partition) {
  const FrameSettings& s = spec.settings;
  std::map<std::string, std::string> metadata{
      {"sceneDigest", spec.scene.sha256_hex},
      {kFrameDigestKey, spec.frame_digest},
      {"frameNumber", absl::StrCat(spec.frame_number)},
      {"numericProfile", numeric_profile},
      {spec.stop.IsActive() ? "samplesPerPixelMax" : "samplesPerPixel", absl::StrCat(s.samples)},
      {"size", absl::StrCat(s.width_px, "x", s.height_px)},
      {"window", absl::StrCat(s.window.x0, ",", s.window.y0, ",", s.window.x1, ",", s.window.y1)}};
  // Cells of tiles got their own samples; equal counts do not tell the cells' size.
  if (spec.stop.IsActive()) {
    metadata["tileSizePx"] = absl::StrCat(TileSizeOf(spec, partition));
    metadata["cellSizePx"] = absl::StrCat(CellSizeOf(spec, partition));
  }
  if (!spec.resumed.sha256_hex.empty()) metadata["resumedFrom"] = spec.resumed.sha256_hex;
  std::vector<std::string> biases;
  VisitFrameSettings(s, [&]<typename T>(const SettingField& field, const T& value) {
    const SettingName& key = field.metadata;
    const bool is_default = IsDefaultSetting(value);
    if (*key.name != '\0' && (key.always || !is_default)) {
      metadata[key.name] = SettingText(field, value);
    }
    if (*field.bias != '\0' && !is_default) biases.emplace_back(field.bias);
    if constexpr (std::is_same_v<T, TechniqueSet>) {
      if (MergesLightPaths(value)) biases.emplace_back("merging");
    }
  });
  if (!biases.empty()) metadata["bias"] = absl::StrJoin(biases, ", ");
  if (s.IsStereo()) metadata[kViewsKey] = kStereoViews;
  return metadata;
}

// Adds the values computed at delivery. Omits estimates that do not exist.
void AddFindings(const DeliveredFrame& delivered, const FrameMerge& merge, FrameImage* image) {
  image->metadata[kImageDigestKey] = delivered.image_digest;
  if (merge.signed_weights()) image->metadata[kSampleWeightKey] = "signed";
  for (const auto& [key, value] :
       {std::pair{"relativeMse", delivered.relative_mse},
        std::pair{kLeftEyeErrorKey, delivered.left_eye_relative_mse},
        std::pair{kRightEyeErrorKey, delivered.right_eye_relative_mse},
        std::pair{kEyeDifferenceErrorKey, delivered.eye_difference_relative_mse}}) {
    if (value > 0) image->metadata[key] = absl::StrFormat("%.6g", value);
  }
  if (delivered.flip > 0) image->metadata["flip"] = absl::StrFormat("%.6g", delivered.flip);
}

}  // namespace

void FrameDelivery::RefreshFrames() {
  std::vector<std::pair<FrameId, std::shared_ptr<OpenFrame>>> frames;
  {
    const MutexLock lock(&tables_.mutex);
    for (const auto& [id, open] : tables_.open_frames) frames.emplace_back(id, open.frame);
  }
  for (const auto& [id, frame] : frames) {
    const SteadyTime start = SteadyTime::Now();
    const double start_cpu_seconds = ThreadCpuSeconds();
    double relative_mse = 0;
    {
      const MutexLock lock(&frame->mutex);
      if (start < frame->next_refresh_time) continue;
      const std::vector<uint32_t> changed = frame->merge.Refresh();
      if (changed.empty()) continue;
      frame->error.Update(frame->merge.image(), changed);
      relative_mse = frame->error.RelativeMse();
      const absl::Duration cost = absl::Seconds(ThreadCpuSeconds() - start_cpu_seconds);
      frame->next_refresh_time =
          start + std::max(preview_interval_min_, cost / kPreviewFractionMax);
      if (!frame->spec.stop.IsActive()) rounds_.NotePoint(frame.get(), id, /*ended=*/false);
    }
    {
      const MutexLock lock(&tables_.mutex);
      const auto open = tables_.open_frames.find(id);
      const bool has_ended = open == tables_.open_frames.end() || open->second.frame != frame;
      if (has_ended) continue;
      open->second.relative_mse = relative_mse;
      ++open->second.preview_version;
    }
    signals_.Changed();
  }
}

void FrameDelivery::DeliverFrames() {
  for (const FrameId& id : queue_.TakeAll()) {
    const absl::Status status = Deliver(id);
    if (status.ok()) continue;
    LogError(absl::StrCat("delivering frame ", id.frame_number, " of job ", id.job_id, ": ",
                          status.message()));
    disk_.Note(status);
    queue_.Add(id);
  }
}

absl::Status FrameDelivery::Deliver(const FrameId& id) {
  std::shared_ptr<OpenFrame> frame;
  bool is_disputed = false;
  {
    const MutexLock lock(&tables_.mutex);
    const FrameRecord* record = tables_.scheduler.FindFrame(id);
    const bool is_wanted = record != nullptr && record->phase == FrameRecord::Phase::kRendered;
    if (!is_wanted) return absl::OkStatus();      // Its job has ended.
    const bool waits = !tables_.liars.empty() ||  // Their results go first.
                       tables_.stale_fields.contains(id) ||
                       tables_.scheduler.AwaitsChecks(id, SteadyTime::Now());
    if (waits) {
      queue_.Add(id);  // Retried after the next result of a check, or soon.
      return absl::OkStatus();
    }
    is_disputed = tables_.scheduler.checks().HasDispute(id);
    frame = tables_.Open(id);
  }
  DeliveredFrame delivered;
  const absl::StatusOr<bool> done = Finish(frame.get(), id, &delivered);
  if (!done.ok()) return done.status();
  if (!*done) return absl::OkStatus();
  if (is_disputed) {
    absl::Status warned = ends_.SetWarning(
        id.job_id, absl::StrCat("frame ", id.frame_number,
                                " is disputed: workers delivered different results for a part of "
                                "it, and no other identity could decide; the first one is kept"));
    if (!warned.ok()) return warned;
  }
  if (absl::Status s = store_.DeliverFrame(id, delivered); !s.ok()) return s;
  {
    const MutexLock lock(&tables_.mutex);
    const FrameRecord* record = tables_.scheduler.FindFrame(id);
    const bool is_wanted = record != nullptr && record->phase == FrameRecord::Phase::kRendered;
    if (!is_wanted) return absl::OkStatus();
    tables_.accounts[id.job_id].delivered[id.frame_number] = delivered;
    tables_.scheduler.Deliver(id);
    tables_.NoteEndedJobs();
    tables_.open_frames.erase(id);
  }
  LogInfo(absl::StrCat("job ", id.job_id, ": frame ", id.frame_number, " is delivered, image ",
                       delivered.image_digest.substr(0, 12)));
  ends_.NoteDelivered(id, delivered);
  ends_.LimitKeptParts();
  ends_.SettleEnded();
  signals_.Changed();
  return absl::OkStatus();
}

absl::StatusOr<bool> FrameDelivery::Finish(OpenFrame* frame, const FrameId& id,
                                           DeliveredFrame* delivered) {
  const PhaseTimer timer(LoadPhase::kDelivery);
  const MutexLock lock(&frame->mutex);
  for (uint32_t tile = 0; tile < frame->merge.tile_count(); ++tile) {
    if (frame->merge.Developed(tile)) continue;
    if (absl::Status s = tiles_.Rebuild(frame, id, tile); !s.ok()) return s;
  }
  if (!frame->merge.AllDeveloped()) return false;  // Parts were lost; see TileBuilder.
  if (frame->spec.stop.IsActive()) {
    const absl::StatusOr<bool> done = rounds_.Finish(frame, id);
    if (!done.ok() || !*done) return done;
  } else {
    rounds_.NotePoint(frame, id, /*ended=*/true);
  }
  FrameImage* image = frame->merge.mutable_image();
  image->metadata = MetadataOf(id, frame->spec);
  frame->merge.AddLightLayer();
  // A job with few pixels is a pilot, and needs their cost.
  const bool is_sparse = !frame->spec.settings.lattice.All();
  if (!is_sparse) rounds_.AddMetadata(id, image);
  if (is_sparse || IsPilot(id.job_id)) AddPilotFindings(id, frame);
  if (HasDenoised(image->outputs) && !is_sparse) {
    const absl::StatusOr<bool> denoised = DenoiseFrame(id, &store_, &tiles_, frame);
    if (!denoised.ok() || !*denoised) return denoised;
  }
  image->attributes = CryptomatteAttributes(*image);
  image->attributes.merge(attributes_.Of(frame->spec.scene));
  *delivered = Account(id, *frame);
  AddFindings(*delivered, frame->merge, image);
  // Its size was unknown until now. The database has priority for space.
  if (absl::Status s = disk_.CheckRoom(0); !s.ok()) return s;
  if (absl::Status s = images_.Write(id, *image); !s.ok()) return s;
  return true;
}

std::map<std::string, std::string> FrameDelivery::MetadataOf(const FrameId& id,
                                                             const FrameSpec& spec) const {
  const MutexLock lock(&tables_.mutex);
  const JobSpec& job = tables_.scheduler.jobs().at(id.job_id).spec;
  return ImageMetadata(spec, job.numeric_profile, job.partition);
}

DeliveredFrame FrameDelivery::Account(const FrameId& id, const OpenFrame& frame) const {
  const FrameMerge& merge = frame.merge;
  const FrameImage& image = merge.image();
  DeliveredFrame delivered;
  const std::vector<PixelRect> unreliable = merge.UnreliableTiles();
  delivered.tile_count = static_cast<uint32_t>(merge.grid().tiles().size());
  delivered.unreliable_tile_count = static_cast<uint32_t>(unreliable.size());
  delivered.unreliable_layers = RareLayers(image, unreliable);
  delivered.image_digest = ImageDigest(image);
  if (HasEyeDifference(image)) {
    const EyeErrors eyes = EstimateEyeErrors(image);
    delivered.relative_mse = eyes.OfWorse().RelativeMse();
    delivered.left_eye_relative_mse = eyes.left.RelativeMse();
    delivered.right_eye_relative_mse = eyes.right.RelativeMse();
    delivered.eye_difference_relative_mse = eyes.difference.RelativeMse();
  } else {
    delivered.relative_mse = EstimateError(image).relative_mse;
  }
  delivered.one_sequence_gain = PriceOfErrorBars(id, frame.spec);
  delivered.flip = merge.Flip().value_or(0);
  const MutexLock lock(&tables_.mutex);
  const FrameRecord& record = *tables_.scheduler.FindFrame(id);
  delivered.sample_count = record.sample_count_done;
  delivered.cost = record.cost;
  delivered.wall_duration = tables_.WallOf(id, SteadyTime::Now());
  if (const RoundRecord* last = tables_.LastRoundOf(id)) {
    delivered.relative_mse_upper = last->relative_mse_upper;
    delivered.stop_reason = last->stop_reason;
  }
  return delivered;
}

double FrameDelivery::PriceOfErrorBars(const FrameId& id, const FrameSpec& spec) const {
  if (spec.stop.IsActive() || spec.settings.one_sequence) return 0;
  const absl::StatusOr<std::vector<RoundRecord>> points = store_.LoadFrameRounds(id);
  if (points.ok()) return OneSequenceGain(*points);
  LogWarning(
      absl::StrCat("reading the points of a frame's error curve: ", points.status().message()));
  return 0;
}

void FrameDelivery::AddPilotFindings(const FrameId& id, OpenFrame* frame) const {
  std::map<std::string, std::string>& metadata = frame->merge.mutable_image()->metadata;
  const MutexLock lock(&tables_.mutex);
  const FrameTasks& tasks = *tables_.scheduler.FindFrame(id)->tasks;
  const auto seconds_of = [&tasks](uint32_t tile) {
    return absl::StrFormat("%.6g", absl::ToDoubleSeconds(tasks.CpuOfTile(tile)));
  };
  const CellGrid& grid = tasks.grid();
  if (!frame->spec.settings.lattice.All()) {
    std::vector<std::string> of_tiles;
    for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
      of_tiles.push_back(seconds_of(tile));
    }
    metadata["tileCpuSeconds"] = absl::StrJoin(of_tiles, " ");
  }
  if (grid.light_tile()) metadata["lightCpuSeconds"] = seconds_of(*grid.light_tile());
  if (grid.training_tile()) metadata["trainingCpuSeconds"] = seconds_of(*grid.training_tile());
}

}  // namespace sheaf::coordinator
