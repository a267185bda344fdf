// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/farm_size.h"

namespace sheaf::cli {

bool TakesWork(const v1::Worker& worker) {
  return worker.state() == v1::Worker::STATE_IDLE || worker.state() == v1::Worker::STATE_BUSY;
}

FarmSize SizeOf(const std::vector<v1::Worker>& workers, const std::vector<v1::Job>& jobs) {
  FarmSize size;
  for (const v1::Worker& worker : workers) {
    if (!TakesWork(worker)) continue;
    ++size.worker_count;
    size.thread_count += worker.thread_count();
  }
  for (const v1::Job& job : jobs) {
    if (!HasEnded(job) && job.state() != v1::Job::STATE_PAUSED) ++size.other_job_count;
  }
  return size;
}

absl::StatusOr<FarmSize> SizeOfFarm(FarmClient* client) {
  const absl::StatusOr<std::vector<v1::Worker>> workers = client->ListWorkers();
  if (!workers.ok()) return workers.status();
  const absl::StatusOr<std::vector<v1::Job>> jobs = client->ListJobs(kLoadJobsMax);
  if (!jobs.ok()) return jobs.status();
  return SizeOf(*workers, *jobs);
}

}  // namespace sheaf::cli
