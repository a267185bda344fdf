// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/job_watches.h"

#include <algorithm>
#include <utility>

#include "common/base/cpu_clock.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {

absl::StatusOr<std::optional<v1::Job>> JobWatch::Next(uint64_t* version, bool changes_only) {
  const MutexLock lock(&mutex_);
  const SteadyTime now = SteadyTime::Now();
  const bool is_due = now >= next_look_ && changes_seen_ != farm_.view().ChangeCount();
  if (version_ == 0 || is_due) {
    if (absl::Status looked = Look(); !looked.ok()) return looked;
  }
  if (*version == version_) return std::optional<v1::Job>();
  v1::Job job = job_;
  const uint64_t since = changes_only ? *version : 0;
  job.set_frames_are_changes(since != 0);
  for (const auto& [number, known] : frames_) {
    if (known.version <= since) continue;
    *job.add_frames() = known.frame;
    for (const v1::FrameTrouble& trouble : known.troubles) *job.add_troubles() = trouble;
  }
  *version = version_;
  return std::optional<v1::Job>(std::move(job));
}

absl::Status JobWatch::Look() {
  ++look_count_;
  const double start_seconds = ThreadCpuSeconds();
  changes_seen_ =
      farm_.view().ChangeCount();  // First, so that a change during the update causes another one.
  const absl::StatusOr<JobView> view = farm_.view().FindJobChanges(job_id_, &marks_);
  if (!view.ok()) return view.status();
  v1::Job job = ToWire(*view);
  const uint64_t next = version_ + 1;
  const bool some_changed = job.frames_size() > 0;
  for (v1::Frame& frame : *job.mutable_frames()) {
    KnownFrame& known = frames_[frame.spec().frame_number()];
    known = {std::move(frame), {}, next};
  }
  for (v1::FrameTrouble& trouble : *job.mutable_troubles()) {
    frames_[trouble.frame_number()].troubles.push_back(std::move(trouble));
  }
  job.clear_frames();
  job.clear_troubles();
  if (some_changed || job.SerializeAsString() != job_.SerializeAsString()) version_ = next;
  job_ = std::move(job);
  const absl::Duration took = absl::Seconds(ThreadCpuSeconds() - start_seconds);
  next_look_ = SteadyTime::Now() + std::max(kWatchIntervalMin, took * kLookFraction);
  return absl::OkStatus();
}

std::shared_ptr<JobWatch> JobWatches::Of(const std::string& job_id) {
  const MutexLock lock(&mutex_);
  std::erase_if(watches_, [](const auto& watch) { return watch.second.expired(); });
  std::weak_ptr<JobWatch>& known = watches_[job_id];
  std::shared_ptr<JobWatch> watch = known.lock();
  if (watch == nullptr) known = watch = std::make_shared<JobWatch>(farm_, job_id);
  return watch;
}

}  // namespace sheaf::coordinator
