// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Each object has a short text of its visible fields. Only these texts are compared, and JSON is
// generated only for objects whose text has changed.
#include "coordinator/service/http/api/http_watch.h"

#include <algorithm>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/cpu_clock.h"
#include "common/base/steady_time.h"
#include "coordinator/service/http/api/http_json.h"

namespace sheaf::coordinator {
namespace {

std::string Mark(const JobView& job) {
  const PreviewFrame preview_frame = job.preview_frame.value_or(PreviewFrame());
  return absl::StrCat(
      static_cast<int>(job.state), " ", job.priority, " ", job.progress.sample_count_done, " ",
      job.frame_complete_count, " ", job.frame_incomplete_count, " ", job.training_frame_count, " ",
      preview_frame.name, " ", preview_frame.preview_version, " ", job.progress.nonfinite_count,
      " ", job.waiting_reason, " ", job.warning, " ", job.failure, job.pinned ? " pinned" : "",
      job.parts_removed_time ? " without parts" : "");
}

std::string Mark(const FrameView& frame) {
  return absl::StrCat(frame.preview_version, " ", frame.progress.sample_count_done, " ",
                      frame.complete ? 1 : 0, frame.is_training ? " training" : "", " ",
                      frame.set_aside_count, frame.incomplete);
}

std::string Mark(const WorkerView& worker) {
  std::string leases;
  for (const LeaseView& lease : worker.leases) {
    absl::StrAppend(&leases, " ", lease.frame.job_id, "/", lease.frame.frame_number, "/",
                    TaskKindName(lease.kind), "/", lease.tile.x0, "/", lease.tile.y0, "/",
                    static_cast<int>(lease.phase));
  }
  return absl::StrCat(static_cast<int>(worker.state), " ", worker.lease_count, " ",
                      worker.result_count, " ", absl::ToUnixSeconds(worker.last_seen_time), " ",
                      worker.warm_scene_count, " ", worker.scene_memory_bytes.value_or(0), leases,
                      " ", worker.reason);
}

// Stores the mark; returns whether it differs from the stored one.
bool Differs(std::map<std::string, std::string>* marks, const std::string& key, std::string mark) {
  std::string& noted = (*marks)[key];
  if (noted == mark) return false;
  noted = std::move(mark);
  return true;
}

}  // namespace

void FarmDifference::Publish(const FarmView& farm) {
  const bool watched = hub_->ReaderCount() > 0;
  // Frames are compared only while there are viewers. Later viewers fetch them after subscribing.
  if (!watched) {
    frames_.clear();
    seen_.clear();
  }
  const std::vector<JobView> jobs = farm.ListJobs();
  for (const JobView& job : jobs) {
    if (!Differs(&jobs_, job.job_id, Mark(job)) || !watched) continue;
    PublishFrames(farm, job.job_id);
    hub_->Publish({"job", absl::StrCat("jobs/", job.job_id), JobJson(job, JsonFields::kHttp)});
    // A failed job may be retried; its frames then lose state that viewers have seen.
    if (HasEnded(job.state) && job.state != JobState::kFailed) {
      frames_.erase(job.job_id);
      seen_.erase(job.job_id);
    }
  }
  const std::vector<WorkerView> workers = farm.ListWorkers();
  for (const WorkerView& worker : workers) {
    if (!Differs(&workers_, worker.worker_id, Mark(worker)) || !watched) continue;
    hub_->Publish({"worker", absl::StrCat("workers/", worker.worker_id),
                   WorkerJson(worker, JsonFields::kHttp)});
  }
  if (jobs_.size() > jobs.size()) PublishRemoved("job", jobs, &JobView::job_id, &jobs_);
  if (workers_.size() > workers.size()) {
    PublishRemoved("worker", workers, &WorkerView::worker_id, &workers_);
  }
}

template <typename View>
void FarmDifference::PublishRemoved(const std::string& kind, const std::vector<View>& present,
                                    std::string View::*id, Marks* marks) {
  std::set<std::string> ids;
  for (const View& view : present) ids.insert(view.*id);
  std::erase_if(*marks, [&](const auto& mark) {
    if (ids.contains(mark.first)) return false;
    const std::string name = absl::StrCat(kind, "s/", mark.first);
    hub_->Publish({kind + "_removed", name, NameJson(name)});
    frames_.erase(mark.first);
    seen_.erase(mark.first);
    return true;
  });
}

void FarmDifference::PublishFrames(const FarmView& farm, const std::string& job_id) {
  const absl::StatusOr<JobView> job = farm.FindJobChanges(job_id, &seen_[job_id]);
  if (!job.ok()) return;  // Deleted since it was listed: there is no change to publish.
  Marks& marks = frames_[job_id];
  const std::string untouched = Mark(FrameView());
  for (const FrameView& frame : job->frames) {
    const std::string key = absl::StrCat("jobs/", job_id, "/frames/", frame.frame_number);
    std::string mark = Mark(frame);
    // Untouched frames have no mark, because there may be many.
    const bool changed =
        mark == untouched ? marks.erase(key) > 0 : Differs(&marks, key, std::move(mark));
    if (!changed) continue;
    hub_->Publish({"frame", key, FrameJson(job_id, frame, JsonFields::kHttp)});
  }
}

FarmWatcher::FarmWatcher(const FarmView& farm, EventHub* hub)
    : farm_(farm), difference_(hub), thread_([this] { Run(); }) {}

FarmWatcher::~FarmWatcher() {
  stopping_ = true;
  thread_.join();
}

void FarmWatcher::Run() {
  uint64_t seen = farm_.ChangeCount();
  difference_.Publish(farm_);
  while (!stopping_) {
    const uint64_t now = farm_.WaitForChange(seen, absl::FromChrono(kWatchWait));
    if (now == seen) continue;
    // Read before the comparison, so that a change during it leads to another one.
    seen = now;
    const double start_seconds = ThreadCpuSeconds();
    difference_.Publish(farm_);
    const absl::Duration took = absl::Seconds(ThreadCpuSeconds() - start_seconds);
    const absl::Duration rest = std::max(absl::FromChrono(kWatchInterval), took * kWatchRestFactor);
    const SteadyTime wake = SteadyTime::Now() + rest;
    while (!stopping_ && SteadyTime::Now() < wake) {
      absl::SleepFor(std::min(wake - SteadyTime::Now(), absl::FromChrono(kWatchWait)));
    }
  }
}

}  // namespace sheaf::coordinator
