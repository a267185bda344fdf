// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that runs in the background: previews, delivery, lost workers.
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/cpu_clock.h"
#include "common/base/log.h"
#include "common/film/cryptomatte.h"
#include "common/film/error/error_estimate.h"
#include "common/film/error/rare_layers.h"
#include "common/film/exr/exr_codec.h"
#include "coordinator/forecast/one_sequence.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::Duration kBackgroundInterval = absl::Milliseconds(100);
constexpr absl::Duration kDeliveryRetryInterval = absl::Seconds(5);
// A preview may take at most this share of one core.
constexpr double kPreviewShareMax = 0.1;

// What it takes to render the picture again. No date and no host: equal pictures are equal files.
std::map<std::string, std::string> PictureMetadata(const FrameSpec& spec,
                                                   const std::string& numeric_profile,
                                                   const Partition& partition) {
  const FrameSettings& s = spec.settings;
  std::map<std::string, std::string> metadata{
      {"sceneDigest", spec.scene.sha256_hex},
      {kFrameDigestKey, spec.frame_digest},
      {"frameNumber", absl::StrCat(spec.frame_number)},
      {"numericProfile", numeric_profile},
      {spec.stop.IsActive() ? "samplesPerPixelMax" : "samplesPerPixel", absl::StrCat(s.samples)},
      {"depthMax", absl::StrCat(s.max_depth)},
      {"seed", absl::StrCat(s.seed)},
      {"size", absl::StrCat(s.width_px, "x", s.height_px)},
      {"window", absl::StrCat(s.window.x0, ",", s.window.y0, ",", s.window.x1, ",", s.window.y1)}};
  // Samples went to cells of tiles; equal counts do not tell how large those were.
  if (spec.stop.IsActive()) {
    metadata["tileSizePx"] = absl::StrCat(partition.tile_size_px);
    metadata["cellSizePx"] = absl::StrCat(CellSizeOf(spec, partition));
  }
  if (!spec.resumed.sha256_hex.empty()) metadata["resumedFrom"] = spec.resumed.sha256_hex;
  if (s.one_sequence) metadata["sampling"] = "one-sequence";
  if (s.similarity_after != 0) {
    metadata["similarityAfter"] = absl::StrCat(s.similarity_after);
    metadata["bias"] = "similarity";
  }
  if (s.max_component_value != 0) {
    metadata["maxComponentValue"] = absl::StrCat(s.max_component_value);
    std::string& bias = metadata["bias"];
    absl::StrAppend(&bias, bias.empty() ? "" : ", ", "clamped samples");
  }
  if (!s.sensor.empty()) metadata["sensor"] = s.sensor;
  if (s.primaries != Primaries::kSrgb) metadata["primaries"] = PrimariesName(s.primaries);
  if (s.white_balance_k != 0) metadata["whiteBalanceK"] = absl::StrCat(s.white_balance_k);
  return metadata;
}

// What is found when it is delivered. Estimates that cannot be told are left out.
void AddFindings(const DeliveredFrame& delivered, const FrameMerge& merge, FramePicture* picture) {
  picture->metadata[kPictureDigestKey] = delivered.picture_digest;
  if (merge.signed_weights()) picture->metadata[kSampleWeightKey] = "signed";
  if (delivered.relative_mse > 0) {
    picture->metadata["relativeMse"] = absl::StrFormat("%.6g", delivered.relative_mse);
  }
  if (delivered.flip > 0) picture->metadata["flip"] = absl::StrFormat("%.6g", delivered.flip);
}

}  // namespace

void Farm::RunBackground() {
  SteadyTime next_delivery = SteadyTime::InfinitePast();
  while (true) {
    {
      const MutexLock lock(&background_mutex_);
      const auto has_reason = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(background_mutex_) {
        return stopping_ || wake_;
      };
      background_wake_.WaitFor(&background_mutex_, kBackgroundInterval, has_reason);
      if (stopping_) return;
      wake_ = false;
    }
    bool changed = false;
    bool disk_fine = true;
    {
      const MutexLock lock(&mutex_);
      changed = scheduler_.Tick(SteadyTime::Now());
      CancelForgottenPilots();
      NoteEndedJobs();
      disk_fine = disk_status_.ok();
    }
    if (changed) Changed();
    if (disk_fine || SteadyTime::Now() >= next_delivery) {
      next_delivery = SteadyTime::Now() + kDeliveryRetryInterval;
      SettleEndedJobs();
      // Nobody else may write meanwhile, and so notice that there is space again.
      if (!disk_fine) NoteDisk(store_->Probe());
      HealPictures();
      DeliverFrames();
    }
    HoldLostScenes();
    RefreshFrames();
  }
}

void Farm::RefreshFrames() {
  std::vector<std::pair<FrameId, std::shared_ptr<OpenFrame>>> frames;
  {
    const MutexLock lock(&mutex_);
    for (const auto& [id, open] : open_frames_) frames.emplace_back(id, open.frame);
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
      frame->error.Update(frame->merge.picture(), changed);
      relative_mse = frame->error.RelativeMse();
      const absl::Duration cost = absl::Seconds(ThreadCpuSeconds() - start_cpu_seconds);
      frame->next_refresh_time =
          start + std::max(options_.preview_interval_min, cost / kPreviewShareMax);
      if (!frame->spec.stop.IsActive()) NotePoint(frame.get(), id, /*ended=*/false);
    }
    {
      const MutexLock lock(&mutex_);
      const auto open = open_frames_.find(id);
      if (open == open_frames_.end() || open->second.frame != frame) continue;  // It has ended.
      open->second.relative_mse = relative_mse;
      ++open->second.preview_version;
    }
    Changed();
  }
}

void Farm::DeliverFrames() {
  std::deque<FrameId> frames;
  {
    const MutexLock lock(&mutex_);
    frames = std::exchange(to_deliver_, {});
  }
  for (const FrameId& id : frames) {
    const absl::Status status = DeliverFrame(id);
    if (status.ok()) continue;
    LogError(absl::StrCat("delivering frame ", id.frame_number, " of job ", id.job_id, ": ",
                          status.message()));
    NoteDisk(status);
    const MutexLock lock(&mutex_);
    to_deliver_.push_back(id);
  }
}

void Farm::RevokePart(const PartRow& row, const absl::Status& why) {
  LogWarning(absl::StrCat("a part is lost and will be rendered again: ", why.message()));
  NoteDisk(store_->RemovePart(row));
  const MutexLock lock(&mutex_);
  const FrameRecord* frame = scheduler_.FindFrame(row.key.frame);
  if (frame == nullptr || frame->tasks == nullptr) return;
  const std::optional<Task> task = frame->tasks->Find(row.key.tile, row.key.block, row.key.cells);
  if (task) scheduler_.Revoke(row.key.frame, *task);
}

absl::Status Farm::RebuildTile(OpenFrame* frame, const FrameId& id, uint32_t tile) {
  const CellGrid& grid = frame->merge.grid();
  const absl::StatusOr<std::vector<PartRow>> rows = store_->FindTileParts(id, grid.tiles()[tile]);
  if (!rows.ok()) return rows.status();
  absl::StatusOr<std::vector<CellPart>> resumed = ResumedParts(frame, tile);
  if (!resumed.ok()) return resumed.status();
  std::vector<CellPart> parts = *std::move(resumed);
  bool lost = false;
  for (const PartRow& row : *rows) {
    absl::StatusOr<std::string> bytes = store_->ReadPart(row);
    absl::Status status = bytes.status();
    if (bytes.ok()) {
      absl::StatusOr<DecodedPart> part = DecodePart(*bytes, row.key.tile.PixelCount());
      status = part.status();
      if (part.ok()) parts.push_back({std::move(part->tile), *grid.MaskOf(tile, row.key.cells)});
    }
    if (status.ok()) continue;
    RevokePart(row, status);
    lost = true;
  }
  if (lost) {
    frame->merge.MarkOnDisk(tile);  // Complete again when those are rendered.
    return absl::OkStatus();
  }
  return frame->merge.Rebuild(tile, std::move(parts));
}

double Farm::PriceOfErrorBars(const FrameId& id, const FrameSpec& spec) const {
  if (spec.stop.IsActive() || spec.settings.one_sequence) return 0;
  const absl::StatusOr<std::vector<RoundRecord>> points = store_->LoadFrameRounds(id);
  if (points.ok()) return OneSequenceGain(*points);
  LogWarning(
      absl::StrCat("reading the points of a frame's error curve: ", points.status().message()));
  return 0;
}

DeliveredFrame Farm::Account(const FrameId& id, const OpenFrame& frame) const {
  const FrameMerge& merge = frame.merge;
  const FramePicture& picture = merge.picture();
  DeliveredFrame delivered;
  delivered.tile_count = merge.tile_count();
  delivered.unreliable_tile_count = merge.unreliable_count();
  delivered.unreliable_layers = RareLayers(picture, merge.UnreliableTiles());
  delivered.picture_digest = PictureDigest(picture);
  delivered.relative_mse = EstimateError(picture).relative_mse;
  delivered.one_sequence_gain = PriceOfErrorBars(id, frame.spec);
  if (merge.error_sample() != nullptr) {
    delivered.flip = EstimateFlip(picture, *merge.error_sample()).value_or(0);
  }
  const MutexLock lock(&mutex_);
  const FrameRecord& record = *scheduler_.FindFrame(id);
  delivered.sample_count = record.sample_count_done;
  delivered.cost = record.cost;
  delivered.wall_duration = WallOf(id, SteadyTime::Now());
  if (const RoundRecord* last = LastRoundOf(id)) {
    delivered.relative_mse_upper = last->relative_mse_upper;
    delivered.stop_reason = last->stop_reason;
  }
  return delivered;
}

std::string Farm::TileCpuSeconds(const FrameId& id) const {
  const MutexLock lock(&mutex_);
  const FrameTasks& tasks = *scheduler_.FindFrame(id)->tasks;
  std::string text;
  for (uint32_t tile = 0; tile < tasks.grid().tiles().size(); ++tile) {
    absl::StrAppendFormat(&text, "%s%.6g", tile == 0 ? "" : " ",
                          absl::ToDoubleSeconds(tasks.CpuOfTile(tile)));
  }
  return text;
}

absl::Status Farm::DeliverFrame(const FrameId& id) {
  std::shared_ptr<OpenFrame> frame;
  std::string numeric_profile;
  Partition partition;
  {
    const MutexLock lock(&mutex_);
    const FrameRecord* record = scheduler_.FindFrame(id);
    if (record->phase != FrameRecord::Phase::kRendered) return absl::OkStatus();  // Job ended.
    frame = OpenFrameOf(id);
    const JobSpec& job = scheduler_.jobs().at(id.job_id).spec;
    numeric_profile = job.numeric_profile;
    partition = job.partition;
  }
  DeliveredFrame delivered;
  {
    const MutexLock lock(&frame->mutex);
    for (uint32_t tile = 0; tile < frame->merge.tile_count(); ++tile) {
      if (frame->merge.Developed(tile)) continue;
      if (absl::Status s = RebuildTile(frame.get(), id, tile); !s.ok()) return s;
    }
    if (!frame->merge.AllDeveloped()) return absl::OkStatus();  // Parts were lost; see RevokePart.
    if (frame->spec.stop.IsActive()) {
      const absl::StatusOr<bool> done = FinishRound(frame.get(), id);
      if (!done.ok()) return done.status();
      if (!*done) return absl::OkStatus();
    } else {
      NotePoint(frame.get(), id, /*ended=*/true);
    }
    FramePicture* picture = frame->merge.mutable_picture();
    picture->metadata = PictureMetadata(frame->spec, numeric_profile, partition);
    if (frame->spec.settings.lattice.All()) {
      AddRoundMetadata(id, picture);
    } else {
      // Whoever asks for few pixels asks for their price.
      picture->metadata["tileCpuSeconds"] = TileCpuSeconds(id);
    }
    picture->attributes = CryptomatteAttributes(*picture);
    delivered = Account(id, *frame);
    AddFindings(delivered, frame->merge, picture);
    const absl::StatusOr<std::string> path = store_->OutputPath(id);
    if (!path.ok()) return path.status();
    if (absl::Status s = WritePicture(*picture, *path); !s.ok()) return s;
    if (const auto state = StateOfFile(*path)) pictures_.Remember(*path, *state);
    KeepThumbnail(id, *picture);
  }
  if (absl::Status s = store_->DeliverFrame(id, delivered); !s.ok()) return s;
  {
    const MutexLock lock(&mutex_);
    if (scheduler_.FindFrame(id)->phase != FrameRecord::Phase::kRendered) return absl::OkStatus();
    accounts_[id.job_id].delivered[id.frame_number] = delivered;
    scheduler_.Deliver(id);
    NoteEndedJobs();
    open_frames_.erase(id);
  }
  LogInfo(absl::StrCat("job ", id.job_id, ": frame ", id.frame_number, " is delivered, image ",
                       delivered.picture_digest.substr(0, 12)));
  LimitKeptParts();
  SettleEndedJobs();
  Changed();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
