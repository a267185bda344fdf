// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/delivery/delivered_images.h"

#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/shrink_image.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {
namespace {

std::string ImageName(const FrameId& id) {
  return absl::StrCat("jobs/", id.job_id, "/frames/", id.frame_number);
}

absl::Status Removed(const FrameId& id) {
  return absl::NotFoundError(ImageName(id) + ": the job was removed");
}

}  // namespace

absl::StatusOr<std::string> DeliveredImages::Find(uint64_t job_id, int32_t frame_number) const {
  const std::string name = absl::StrCat("jobs/", job_id, "/frames/", frame_number);
  {
    const MutexLock lock(&tables_.mutex);
    const FrameRecord* frame = tables_.scheduler.FindFrame({job_id, frame_number});
    if (frame == nullptr) return absl::NotFoundError(name + ": there is no such frame");
    if (frame->phase != FrameRecord::Phase::kDelivered) {
      return absl::FailedPreconditionError(name + ": the image is not complete yet");
    }
  }
  return FindDelivered({job_id, frame_number});
}

absl::StatusOr<std::string> DeliveredImages::FindDelivered(const FrameId& id) const {
  absl::StatusOr<std::string> path = store_.OutputPath(id);
  if (!path.ok()) return path;
  if (absl::Status s = Check(id, *path); !s.ok()) return s;
  return path;
}

absl::StatusOr<uint64_t> DeliveredImages::Verify(const FrameId& id) const {
  const absl::StatusOr<std::string> path = store_.OutputPath(id);
  if (!path.ok()) return path.status();
  verified_.Forget(*path);
  if (absl::Status s = Check(id, *path); !s.ok()) return s;
  const std::optional<FileState> state = StateOfFile(*path);
  return state ? state->size_bytes : 0;
}

absl::Status DeliveredImages::Write(const FrameId& id, const FrameImage& image) {
  const absl::StatusOr<std::string> path = store_.OutputPath(id);
  if (!path.ok()) return path.status();
  if (absl::Status s = WriteSecretAtomically(*path, EncodeFrameImage(image)); !s.ok()) return s;
  if (const auto state = StateOfFile(*path)) verified_.Remember(*path, *state);
  KeepThumbnail(id, image);
  return absl::OkStatus();
}

absl::StatusOr<std::string> DeliveredImages::ThumbnailPath(const FrameId& id) const {
  absl::StatusOr<std::string> path = store_.OutputPath(id);
  if (!path.ok()) return path.status();
  const size_t extension = path->rfind('.');
  return absl::StrCat(path->substr(0, extension), ".thumbnail.exr");
}

void DeliveredImages::KeepThumbnail(const FrameId& id, const FrameImage& image) const {
  const absl::StatusOr<FrameImage> small =
      ShrinkImage(image, {"R", "G", "B"}, kThumbnailPixelCountMax);
  absl::Status status = small.status();
  if (status.ok()) {
    const absl::StatusOr<std::string> path = ThumbnailPath(id);
    status = path.ok() ? WriteSecretAtomically(*path, EncodeFrameImage(*small)) : path.status();
  }
  if (!status.ok()) LogWarning(absl::StrCat("storing a thumbnail: ", status.message()));
}

absl::Status DeliveredImages::Check(const FrameId& id, const std::string& path) const {
  const std::optional<FileState> state = StateOfFile(path);
  if (state && verified_.Contains(path, *state)) return absl::OkStatus();
  std::string expected;
  {
    const MutexLock lock(&tables_.mutex);
    const auto account = tables_.accounts.find(id.job_id);
    if (account == tables_.accounts.end()) return Removed(id);
    const auto frame = account->second.delivered.find(id.frame_number);
    if (frame == account->second.delivered.end()) return absl::OkStatus();  // It is being made.
    expected = frame->second.image_digest;
  }
  if (state) {
    const absl::StatusOr<FrameImage> image = ReadFrameImage(path);
    if (image.ok() && ImageDigest(*image) == expected && StateOfFile(path) == state) {
      verified_.Remember(path, *state);
      return absl::OkStatus();
    }
    MoveAside(path, state_directory_ + "/damaged",
              absl::StrCat("job-", id.job_id, "-frame-", id.frame_number, ".exr"));
  }
  {
    const MutexLock tables_lock(&tables_.mutex);
    // False if it is being recreated, possibly since the file was read.
    const auto account = tables_.accounts.find(id.job_id);
    if (account == tables_.accounts.end()) return Removed(id);
    const bool is_delivered = account->second.delivered.contains(id.frame_number);
    const MutexLock lock(&mutex_);
    if (is_delivered && damaged_.insert(id).second) {
      ++damaged_count_;
      LogError(absl::StrCat(ImageName(id), ": the delivered image is ", state ? "damaged" : "gone",
                            "; it is being recreated"));
    }
  }
  return absl::FailedPreconditionError(
      absl::StrCat(ImageName(id), ": the delivered image was ", state ? "damaged" : "removed",
                   " on the coordinator's disk and is being recreated; try again later"));
}

void DeliveredImages::Heal(JobContinuation* jobs) {
  std::set<FrameId> damaged;
  {
    const MutexLock lock(&mutex_);
    damaged = damaged_;
  }
  if (damaged.empty()) return;
  std::map<uint64_t, std::set<int32_t>> remade;
  std::set<FrameId> settled;
  {
    const MutexLock lock(&tables_.mutex);
    for (const FrameId& id : damaged) {
      const auto job = tables_.scheduler.jobs().find(id.job_id);
      if (job == tables_.scheduler.jobs().end()) {
        settled.insert(id);  // It was removed.
        continue;
      }
      const JobPhase phase = job->second.phase;
      if (phase == JobPhase::kLive) continue;  // Once it has ended.
      if (phase == JobPhase::kSucceeded) {
        remade[id.job_id].insert(id.frame_number);
        continue;
      }
      LogError(absl::StrCat(ImageName(id), ": is not recreated, because its job did not succeed"));
      settled.insert(id);
    }
  }
  for (const auto& [job_id, numbers] : remade) {
    const absl::Status status = jobs->RemakeFrames(job_id, numbers);
    if (status.ok()) {
      for (const int32_t number : numbers) settled.insert({job_id, number});
    } else {
      LogError(absl::StrCat("recreating images of jobs/", job_id, ": ", status.message()));
    }
  }
  // Only now: until its frame is open again, each check of the image would find the damage again.
  const MutexLock lock(&mutex_);
  for (const FrameId& id : settled) damaged_.erase(id);
}

uint64_t DeliveredImages::DamagedCount() const {
  const MutexLock lock(&mutex_);
  return damaged_count_;
}

}  // namespace sheaf::coordinator
