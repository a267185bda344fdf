// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/upkeep/worker_drains.h"

#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::Duration kLookForOldInterval = absl::Minutes(1);

}  // namespace

absl::Status WorkerDrains::Load() {
  const absl::StatusOr<std::vector<DrainRecord>> records = store_.LoadDrains();
  if (!records.ok()) return records.status();
  const MutexLock lock(&mutex_);
  const MutexLock of_tables(&tables_.mutex);
  for (const DrainRecord& record : *records) {
    drains_[record.worker_id] = {record.then_exit, SteadyTime::Now()};
    tables_.scheduler.Drain(record.worker_id, record.then_exit);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> WorkerDrains::Choose(const ChosenWorkers& chosen) const {
  if (chosen.worker_ids.empty() && chosen.host.empty()) {
    return absl::InvalidArgumentError("name workers, or a host; sheaf workers lists them");
  }
  std::set<std::string> ids;
  const MutexLock lock(&tables_.mutex);
  const std::map<std::string, WorkerRecord>& workers = tables_.scheduler.workers().workers();
  for (const std::string& id : chosen.worker_ids) {
    if (!workers.contains(id) && !drains_.contains(id)) {
      return absl::NotFoundError(
          absl::StrCat("workers/", id, ": there is no such worker; sheaf workers lists them"));
    }
    ids.insert(id);
  }
  const size_t named = ids.size();
  for (const auto& [id, worker] : workers) {
    const bool is_there = !worker.lost && !worker.Stopped();
    if (!chosen.host.empty() && worker.host == chosen.host && is_there) ids.insert(id);
  }
  if (!chosen.host.empty() && ids.size() == named) {
    return absl::NotFoundError(absl::StrCat("no worker of the host ", chosen.host,
                                            " is connected; sheaf workers lists them"));
  }
  return std::vector<std::string>(ids.begin(), ids.end());
}

absl::StatusOr<std::vector<std::string>> WorkerDrains::Drain(const ChosenWorkers& chosen,
                                                             bool then_exit) {
  const MutexLock lock(&mutex_);
  absl::StatusOr<std::vector<std::string>> ids = Choose(chosen);
  if (!ids.ok()) return ids;
  std::vector<DrainRecord> records;
  size_t new_count = 0;
  for (const std::string& id : *ids) {
    records.push_back({id, then_exit, absl::Now()});
    new_count += drains_.contains(id) ? 0 : 1;
  }
  if (drains_.size() + new_count > limits_.drains_max) {
    return absl::ResourceExhaustedError(absl::StrCat(drains_.size(), " workers are drained, and ",
                                                     limits_.drains_max, " is the limit; end ",
                                                     "some of them, or undrain them"));
  }
  absl::Status written = store_.WriteDrains(records);
  disk_.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock of_tables(&tables_.mutex);
    for (const std::string& id : *ids) {
      drains_[id] = {then_exit, SteadyTime::Now()};
      tables_.scheduler.Drain(id, then_exit);
    }
  }
  for (const std::string& id : *ids) {
    LogInfo(absl::StrCat("worker ", id, " is drained", then_exit ? " and will then exit" : ""));
  }
  signals_.Changed();
  return ids;
}

absl::StatusOr<std::vector<std::string>> WorkerDrains::Undrain(const ChosenWorkers& chosen) {
  const MutexLock lock(&mutex_);
  absl::StatusOr<std::vector<std::string>> ids = Choose(chosen);
  if (!ids.ok()) return ids;
  absl::Status written = store_.RemoveDrains(*ids);
  disk_.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock of_tables(&tables_.mutex);
    for (const std::string& id : *ids) {
      drains_.erase(id);
      tables_.scheduler.Undrain(id);
    }
  }
  for (const std::string& id : *ids) LogInfo(absl::StrCat("worker ", id, " is not drained"));
  signals_.Changed();
  return ids;
}

void WorkerDrains::ForgetOld() {
  const MutexLock lock(&mutex_);
  const SteadyTime now = SteadyTime::Now();
  if (drains_.empty() || now < next_look_) return;
  next_look_ = now + kLookForOldInterval;
  std::vector<std::string> old;
  {
    const MutexLock of_tables(&tables_.mutex);
    const std::map<std::string, WorkerRecord>& workers = tables_.scheduler.workers().workers();
    for (auto& [id, entry] : drains_) {
      const auto worker = workers.find(id);
      const bool is_there = worker != workers.end() && !worker->second.Stopped();
      if (is_there) entry.known_time = now;
      if (now - entry.known_time > limits_.lost_worker_kept) old.push_back(id);
    }
  }
  if (old.empty()) return;
  const absl::Status removed = store_.RemoveDrains(old);
  disk_.Note(removed);
  if (!removed.ok()) return;  // Retried at the next call.
  const MutexLock of_tables(&tables_.mutex);
  for (const std::string& id : old) {
    drains_.erase(id);
    tables_.scheduler.Undrain(id);
  }
}

}  // namespace sheaf::coordinator
