// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/checks.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/film/exr/exr_codec.h"
#include "tests/sim/synthetic_film.h"

namespace sheaf::sim {
namespace {

using coordinator::Farm;
using coordinator::FrameId;
using coordinator::FrameRecord;
using coordinator::JobPhase;
using coordinator::JobRecord;
using coordinator::Lease;
using coordinator::Scheduler;
using coordinator::TaskId;
using coordinator::WorkerRecord;

// A worker that fell silent is noticed by the background thread.
constexpr absl::Duration kNoticeMax = absl::Seconds(1);

std::string NameOf(const FrameId& id) {
  return absl::StrCat("frame ", id.frame_number, " of job ", id.job_id);
}

}  // namespace

void Checks::Check(Farm& farm, const coordinator::FarmOptions& options) {
  const MutexLock lock(&farm.tables().mutex);
  const Scheduler& scheduler = farm.tables().scheduler;
  CheckLeases(scheduler);
  CheckJobs(farm);
  CheckWorkers(scheduler, options.limits);
  CheckVerdicts();
  CheckLimits(farm, options);
}

void Checks::CheckLeases(const Scheduler& scheduler) {
  size_t lease_count = 0;
  std::map<FrameId, std::set<TaskId>> leased;
  for (const auto& [worker_id, worker] : scheduler.workers().workers()) {
    std::set<TaskId> of_worker;
    for (const uint64_t id : worker.leases) {
      ++lease_count;
      const Lease* lease = scheduler.leases().Find(id);
      if (lease == nullptr || lease->worker_id != worker_id) {
        world_.Broken(absl::StrCat(worker_id, " holds lease ", id, ", which is not its own"));
        return;
      }
      const auto job = scheduler.jobs().find(lease->frame.job_id);
      if (job == scheduler.jobs().end() || job->second.phase != JobPhase::kLive) {
        world_.Broken(absl::StrCat("lease ", id, " is of a job that has ended"));
        return;
      }
      const TaskId task = MakeTaskId(lease->frame, lease->task);
      if (lease->is_check) CheckHolderOfCheck(scheduler, *lease);
      if (!lease->is_check) leased[lease->frame].insert(task);
      if (!of_worker.insert(task).second) {
        world_.Broken(absl::StrCat(worker_id, " holds two leases of one task: ", id));
      }
    }
  }
  if (lease_count != scheduler.leases().size()) {
    world_.Broken(
        absl::StrCat(scheduler.leases().size(), " leases, of which workers hold ", lease_count));
  }
  for (const auto& [job_id, job] : scheduler.jobs()) {
    for (const FrameRecord& frame : job.frames) {
      const FrameId id{job_id, frame.number()};
      uint64_t samples = 0;
      for (const TaskId& task : leased[id]) {
        samples +=
            frame.tasks == nullptr
                ? 0
                : frame.tasks->PixelSamples({task.tile, {task.first, task.count}, task.cells});
      }
      CheckFrame(scheduler, id, frame, samples);
    }
  }
}

// A worker that has delivered nothing gets checks only where no worker that has may do them.
void Checks::CheckHolderOfCheck(const Scheduler& scheduler, const Lease& lease) {
  if (!known_checks_.insert(lease.lease_id).second) return;
  const coordinator::WorkerTable& workers = scheduler.workers();
  if (workers.ResultCount(lease.identity) > 0) return;
  const coordinator::ResultCheck* check =
      scheduler.checks().Find(MakeTaskId(lease.frame, lease.task));
  const JobRecord& job = scheduler.jobs().at(lease.frame.job_id);
  if (check == nullptr || !job.cache_refusals.empty()) return;
  for (const auto& [worker_id, worker] : workers.workers()) {
    // A stranger may have reported another profile in its name.
    const bool may = worker.Live() && worker.numeric_profile == job.spec.numeric_profile &&
                     workers.ResultCount(worker.identity) > 0 &&
                     check->MayBeDoneBy(worker.identity);
    if (!may) continue;
    world_.Broken(absl::StrCat(lease.worker_id, " has delivered nothing and gets check ",
                               lease.lease_id, ", which ", worker_id, " may do"));
  }
}

void Checks::CheckFrame(const Scheduler& scheduler, const FrameId& id, const FrameRecord& frame,
                        uint64_t leased) {
  using Phase = FrameRecord::Phase;
  if (frame.tasks == nullptr) {
    const bool has_tasks = frame.phase == Phase::kOpen || frame.phase == Phase::kRendered;
    if (has_tasks) world_.Broken(absl::StrCat(NameOf(id), " is open without tasks"));
    return;
  }
  const coordinator::FrameTasks& tasks = *frame.tasks;
  const uint64_t known =
      tasks.sample_count_done() + tasks.sample_count_ready() + tasks.sample_count_aside() + leased;
  if (known != tasks.sample_count_total()) {
    world_.Broken(absl::StrCat(NameOf(id), ": of ", tasks.sample_count_total(), " samples ",
                               tasks.sample_count_done(), " are done, ", tasks.sample_count_ready(),
                               " ready, ", tasks.sample_count_aside(), " set aside and ", leased,
                               " leased"));
  }
  if (frame.sample_count_done != tasks.sample_count_done()) {
    world_.Broken(absl::StrCat(NameOf(id), " counts ", frame.sample_count_done,
                               " samples as done, its tasks ", tasks.sample_count_done()));
  }
  if ((frame.phase == Phase::kRendered) != tasks.Complete()) {
    world_.Broken(absl::StrCat(NameOf(id), " is not in the phase of its tasks"));
  }
  const std::string other = promises_.PartOfOtherField(id, tasks.field().sha256_hex);
  if (!other.empty()) {
    world_.Broken(absl::StrCat(NameOf(id), ": ", other, " has another guiding field"));
  }
  const JobRecord& job = scheduler.jobs().at(id.job_id);
  const bool is_ready = job.ready.contains(job.IndexOf(id.frame_number));
  if (is_ready != (frame.phase == Phase::kOpen && tasks.HasReady())) {
    world_.Broken(absl::StrCat(NameOf(id), is_ready ? " is" : " is not", " offered to workers"));
  }
}

void Checks::CheckJobs(Farm& farm) {
  const auto& tables = farm.tables();
  for (const auto& [id, job] : tables.scheduler.jobs()) {
    int32_t delivered = 0;
    for (const FrameRecord& frame : job.frames) {
      delivered += frame.phase == FrameRecord::Phase::kDelivered ? 1 : 0;
    }
    if (delivered != job.delivered_count) {
      world_.Broken(absl::StrCat("job ", id, " counts ", job.delivered_count,
                                 " delivered frames and has ", delivered));
    }
    const bool all = delivered == static_cast<int32_t>(job.frames.size());
    if ((job.phase == JobPhase::kSucceeded) != all && job.phase != JobPhase::kCancelled &&
        job.phase != JobPhase::kFailed) {
      world_.Broken(absl::StrCat("job ", id, " has ", delivered, " delivered frames in phase ",
                                 static_cast<int>(job.phase)));
    }
    const auto promised = promises_.jobs().find(id);
    if (promised == promises_.jobs().end()) {
      world_.Broken(absl::StrCat("job ", id, " is known, but not durable"));
      continue;
    }
    if (!promised->second.paused.MayBe(job.Paused()) && job.phase == JobPhase::kLive) {
      world_.Broken(absl::StrCat("job ", id, job.Paused() ? " is paused, which was never promised"
                                                          : " is not paused, as was promised"));
    }
    if (!promised->second.priority.MayBe(job.spec.priority)) {
      world_.Broken(absl::StrCat("job ", id, " has another priority than promised"));
    }
    for (const auto& [number, frame] : tables.accounts.at(id).delivered) {
      const auto shown = promised->second.shown.find(number);
      if (shown != promised->second.shown.end() && shown->second == frame.image_digest) continue;
      world_.Broken(absl::StrCat(NameOf({id, number}), " is shown as delivered, but not durable"));
    }
  }
}

void Checks::CheckWorkers(const Scheduler& scheduler, const coordinator::Limits& limits) {
  for (const auto& [id, worker] : scheduler.workers().workers()) {
    const auto heard = world_.heard.find(id);
    if (heard == world_.heard.end()) continue;
    const absl::Duration silent = world_.now() - heard->second;
    if (worker.lost && silent < limits.lease_duration) {
      world_.Broken(
          absl::StrCat(id, " is lost, but was heard ", absl::FormatDuration(silent), " ago"));
    }
    const bool may_hold = silent <= limits.lease_duration + kNoticeMax && !worker.Quarantined();
    if (!may_hold && !worker.leases.empty()) {
      world_.Broken(absl::StrCat(id, " was silent for ", absl::FormatDuration(silent),
                                 " or is quarantined, and holds leases"));
    }
  }
}

void Checks::CheckVerdicts() {
  const auto& results = world_.false_results;
  const bool some_agree =
      std::ranges::any_of(results, [](const auto& result) { return result.second.size() > 1; });
  if (some_agree) return;  // They are believed.
  for (const std::string& liar : promises_.Liars()) {
    const bool made_one = std::ranges::any_of(
        results, [&](const auto& result) { return result.second.contains(liar); });
    if (made_one) continue;
    world_.Broken(absl::StrCat(liar, " is said to make false results, but is honest"));
  }
}

void Checks::CheckLimits(Farm& farm, const coordinator::FarmOptions& options) {
  const auto& tables = farm.tables();
  const coordinator::Limits& limits = options.limits;
  const auto expect = [&](bool holds, const char* what) {
    if (!holds) world_.Broken(absl::StrCat("beyond its limit: ", what));
  };
  int64_t open_frames = 0;
  for (const auto& [id, worker] : tables.scheduler.workers().workers()) {
    expect(static_cast<int>(worker.leases.size()) <= limits.leases_per_worker_max,
           "leases of a worker");
  }
  for (const auto& [id, job] : tables.scheduler.jobs()) {
    expect(job.failures.last.size() <= static_cast<size_t>(limits.failures_kept_max),
           "failures kept of a job");
    for (const FrameRecord& frame : job.frames) {
      open_frames += frame.tasks == nullptr ? 0 : 1;
      for (const auto& [task, failures] : frame.failures) {
        const bool is_aside = !failures.trouble.set_aside.empty();
        if (is_aside || !failures.IsPoison(limits) || of_strangers_.contains(task)) continue;
        const auto has_results = [&](const std::string& identity) {
          return tables.scheduler.workers().ResultCount(identity) > 0;
        };
        expect(std::ranges::none_of(failures.Identities(), has_results), "failures of a task");
        of_strangers_.insert(task);
      }
    }
  }
  int64_t in_memory = 0;
  for (const auto& [id, frame] : tables.open_frames) {
    // Until its end is written down, a job that has ended keeps its frames.
    const auto& unsettled = tables.unsettled_jobs;
    const bool ends = std::find(unsettled.begin(), unsettled.end(), id.job_id) != unsettled.end();
    in_memory += ends ? 0 : 1;
  }
  expect(in_memory <= open_frames, "frames in memory");
}

bool Checks::CheckEnd(Farm& farm) {
  std::vector<uint64_t> succeeded;
  {
    const MutexLock lock(&farm.tables().mutex);
    const Scheduler& scheduler = farm.tables().scheduler;
    for (const auto& [id, job] : scheduler.jobs()) {
      if (job.phase == JobPhase::kLive) return false;
      if (job.phase == JobPhase::kSucceeded) succeeded.push_back(id);
    }
    if (scheduler.leases().size() != 0) world_.Broken("leases are left when all jobs have ended");
    if (!farm.tables().unsettled_jobs.empty() || !farm.tables().liars.empty()) return false;
    if (!farm.tables().open_frames.empty()) world_.Broken("frames are open when jobs have ended");
  }
  const std::string liar = promises_.LiarWithParts();
  if (!liar.empty()) {
    world_.Broken(absl::StrCat("parts of ", liar, " are left, which made false results"));
  }
  false_image_count_ = 0;
  for (const uint64_t id : succeeded) {
    if (!CheckImages(farm, id)) return false;
  }
  return true;
}

bool Checks::CheckImages(Farm& farm, uint64_t job_id) {
  std::vector<std::pair<coordinator::FrameSpec, std::string>> frames;
  coordinator::Partition partition;
  {
    const MutexLock lock(&farm.tables().mutex);
    const JobRecord& job = farm.tables().scheduler.jobs().at(job_id);
    partition = job.spec.partition;
    for (const FrameRecord& frame : job.frames) {
      const auto& delivered = farm.tables().accounts.at(job_id).delivered.at(frame.number());
      frames.emplace_back(frame.Spec(), delivered.image_digest);
    }
  }
  for (const auto& [spec, digest] : frames) {
    const FrameId id{job_id, spec.frame_number};
    const absl::StatusOr<std::string> path = farm.images().Find(job_id, spec.frame_number);
    if (absl::IsFailedPrecondition(path.status())) return false;
    const absl::StatusOr<FrameImage> image =
        path.ok() ? ReadFrameImage(*path) : absl::StatusOr<FrameImage>(path.status());
    if (!image.ok() || ImageDigest(*image) != digest) {
      world_.Broken(absl::StrCat(NameOf(id), ": the file is not the image that was delivered"));
      return true;
    }
    if (digest == OneProcessImage(spec, partition)) continue;
    if (promises_.MayBeFalse(id, spec.stop.IsActive(), world_.false_parts)) {
      ++false_image_count_;
    } else {
      world_.Broken(absl::StrCat(NameOf(id), " is another image than that of one process"));
    }
  }
  return true;
}

}  // namespace sheaf::sim
