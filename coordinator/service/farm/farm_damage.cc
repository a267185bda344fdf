// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that deals with files that were altered on disk. Lost blobs hold the frames that
// need them, by name, until somebody submits them again. Delivered pictures are made again: from
// their parts, and by rendering what is not kept of those.
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/film/exr/exr_codec.h"
#include "common/rpc/manifest_codec.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::Duration kLostBlobsInterval = absl::Seconds(1);

std::string PictureName(const FrameId& id) {
  return absl::StrCat("jobs/", id.job_id, "/frames/", id.frame_number);
}

}  // namespace

std::string Farm::LostFileOf(const BlobDigest& scene) const {
  const auto text = [](const std::string& file, const BlobDigest& blob) {
    return absl::StrCat(file, " (blob ", blob.sha256_hex,
                        ") is damaged or lost in the coordinator's store; submit the scene again "
                        "to continue this job");
  };
  if (lost_blobs_.contains(scene.sha256_hex)) return text("the list of the scene's files", scene);
  const absl::StatusOr<std::string> bytes = blobs_->ReadChunk(scene, 0, kManifestBytesMax);
  if (!bytes.ok()) return text("the list of the scene's files", scene);
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*bytes);
  if (!manifest.ok()) return "";  // A worker says so.
  for (const ManifestFile& file : manifest->files) {
    if (lost_blobs_.contains(file.digest.sha256_hex)) {
      return text(absl::StrCat("file ", file.name), file.digest);
    }
  }
  return "";
}

void Farm::HoldLostScenes() {
  if (SteadyTime::Now() < next_lost_blobs_time_) return;
  next_lost_blobs_time_ = SteadyTime::Now() + kLostBlobsInterval;
  bool changed = false;
  for (BlobDigest& digest : blobs_->TakeLost()) {
    changed = true;
    std::string hex = digest.sha256_hex;
    lost_blobs_.insert_or_assign(std::move(hex), std::move(digest));
  }
  changed |= std::erase_if(lost_blobs_, [&](const auto& blob) {
               return blobs_->PathOf(blob.second).ok();  // It was brought again.
             }) > 0;
  if (!changed) return;
  std::map<std::string, BlobDigest> scenes;
  {
    const MutexLock lock(&mutex_);
    for (const auto& [id, job] : scheduler_.jobs()) {
      if (job.phase != JobPhase::kLive) continue;
      for (const FrameRecord& frame : job.frames) {
        if (frame.phase == FrameRecord::Phase::kDelivered) continue;
        const FrameSpec spec = frame.Spec();
        scenes.emplace(spec.scene.sha256_hex, spec.scene);
      }
    }
  }
  std::map<std::string, std::string> lost;
  for (const auto& [hex, scene] : scenes) {
    if (std::string file = LostFileOf(scene); !file.empty()) lost[hex] = std::move(file);
  }
  if (lost.empty()) lost_blobs_.clear();  // Nobody needs them.
  {
    const MutexLock lock(&mutex_);
    for (const auto& [hex, why] : lost) {
      if (scheduler_.held_scenes().contains(hex)) continue;
      LogError(why);
      ++scheduler_.counters().scenes_lost;
    }
    scheduler_.HoldScenes(std::move(lost));
  }
  Changed();
}

absl::Status Farm::CheckPicture(const FrameId& id, const std::string& path) const {
  const std::optional<FileState> state = StateOfFile(path);
  if (state && pictures_.Contains(path, *state)) return absl::OkStatus();
  std::string expected;
  {
    const MutexLock lock(&mutex_);
    const auto& delivered = accounts_.at(id.job_id).delivered;
    const auto frame = delivered.find(id.frame_number);
    if (frame == delivered.end()) return absl::OkStatus();  // It is being made.
    expected = frame->second.picture_digest;
  }
  if (state) {
    const absl::StatusOr<FramePicture> picture = ReadPicture(path);
    if (picture.ok() && PictureDigest(*picture) == expected && StateOfFile(path) == state) {
      pictures_.Remember(path, *state);
      return absl::OkStatus();
    }
    MoveAside(path, options_.state_directory + "/damaged",
              absl::StrCat("job-", id.job_id, "-frame-", id.frame_number, ".exr"));
  }
  {
    const MutexLock lock(&mutex_);
    if (damaged_pictures_.insert(id).second) {
      ++pictures_damaged_;
      LogError(absl::StrCat(PictureName(id), ": the delivered image is ",
                            state ? "damaged" : "gone", "; it is being recreated"));
    }
  }
  return absl::FailedPreconditionError(
      absl::StrCat(PictureName(id), ": the delivered image was ", state ? "damaged" : "removed",
                   " on the coordinator's disk and is being recreated; try again later"));
}

void Farm::HealPictures() {
  std::map<uint64_t, std::set<int32_t>> damaged;
  {
    const MutexLock lock(&mutex_);
    for (auto it = damaged_pictures_.begin(); it != damaged_pictures_.end();) {
      const JobPhase phase = scheduler_.jobs().at(it->job_id).phase;
      if (phase == JobPhase::kLive) {  // Once it has ended.
        ++it;
        continue;
      }
      if (phase == JobPhase::kSucceeded) {
        damaged[it->job_id].insert(it->frame_number);
      } else {
        LogError(
            absl::StrCat(PictureName(*it), ": is not recreated, because its job did not succeed"));
      }
      it = damaged_pictures_.erase(it);
    }
  }
  for (const auto& [job_id, numbers] : damaged) {
    const absl::Status status = RemakeFrames(job_id, numbers);
    if (status.ok()) continue;
    LogError(absl::StrCat("making pictures of jobs/", job_id, " again: ", status.message()));
    const MutexLock lock(&mutex_);
    for (const int32_t number : numbers) damaged_pictures_.insert({job_id, number});
  }
}

absl::Status Farm::RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers) {
  const MutexLock settling(&settle_mutex_);
  StoredJob job;
  {
    const MutexLock lock(&mutex_);
    const absl::StatusOr<const JobRecord*> found = FindRecord(job_id);
    if (!found.ok()) return found.status();
    if ((*found)->phase != JobPhase::kSucceeded) return absl::OkStatus();  // Refined meanwhile.
    job = StoredJobOf(**found);
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!numbers.contains(frame.frame_number)) continue;
    reopened.push_back({frame, std::move((*rounds)[frame.frame_number])});
  }
  return ReopenFrames(std::move(job), reopened);
}

}  // namespace sheaf::coordinator
