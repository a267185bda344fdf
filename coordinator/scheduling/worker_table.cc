// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/worker_table.h"

#include <algorithm>

#include "common/base/check.h"
#include "coordinator/core/job/work_left.h"

namespace sheaf::coordinator {

double WorkerRecord::SamplesPerThreadSecond() const {
  const double seconds = absl::ToDoubleSeconds(cpu_duration);
  return seconds > 0 ? static_cast<double>(sample_count) / seconds : 0.0;
}

double WorkerRecord::ThreadsUsed() const {
  // Prior: this much of its time at the usual share.
  constexpr absl::Duration kPrior = absl::Seconds(2);
  const double fraction =
      absl::FDivDuration(kPrior * kUsualThreadUse * thread_count + busy_cpu_duration,
                         (kPrior + busy_duration) * thread_count);
  return std::clamp(fraction, 0.1, 1.0) * thread_count;
}

double WorkerRecord::RelativeSpeed() const {
  // Prior: this much CPU time at the speed of others.
  constexpr double kPriorSeconds = 10;
  const double speed =
      (kPriorSeconds + recent_usual_seconds) / (kPriorSeconds + recent_cpu_seconds);
  return std::clamp(speed, 0.25, 4.0);
}

void WorkerRecord::NoteSpeed(double usual_seconds, double cpu_seconds) {
  constexpr double kRecentSeconds = 300;
  recent_usual_seconds += usual_seconds;
  recent_cpu_seconds += cpu_seconds;
  if (recent_cpu_seconds + recent_usual_seconds < 2 * kRecentSeconds) return;
  recent_usual_seconds /= 2;
  recent_cpu_seconds /= 2;
}

void WorkerTable::CountLive(const WorkerRecord& worker, int sign) {
  if (!worker.Live()) return;
  LiveWorkers& live = live_[worker.numeric_profile];
  live.count += sign;
  live.slots += sign * std::min(worker.Slots(), limits_.leases_per_worker_max);
  live_total_ += sign;
  kinds_.Count(worker.numeric_profile, worker.traits, sign);
  std::map<std::string, int>& of_pool = live.by_pool[worker.traits.pool];
  for (std::map<std::string, int>* identities : {&live.by_identity, &of_pool}) {
    const auto identity = identities->try_emplace(worker.identity, 0).first;
    identity->second += sign;
    if (identity->second == 0) identities->erase(identity);
  }
  if (of_pool.empty()) live.by_pool.erase(worker.traits.pool);
}

WorkerRecord* WorkerTable::Touch(const WorkerReport& report, SteadyTime now) {
  auto found = workers_.find(report.worker_id);
  if (found == workers_.end()) {
    if (workers_.size() >= static_cast<size_t>(limits_.workers_max)) return nullptr;
    found = workers_.emplace(report.worker_id, WorkerRecord{}).first;
    found->second.worker_id = report.worker_id;
    found->second.identity = IdentityOf(report);
    ++identities_[found->second.identity].worker_count;
    const auto quarantine = quarantined_.find(found->second.identity);
    if (quarantine != quarantined_.end()) found->second.quarantine_reason = quarantine->second;
    ApplyDrain(&found->second);
  } else {
    CountLive(found->second, -1);
    heard_.erase({found->second.last_seen_time, report.worker_id});
    silent_.erase({found->second.last_seen_time, report.worker_id});
  }
  WorkerRecord& worker = found->second;
  SHEAF_CHECK(worker.identity == IdentityOf(report));
  worker.host = report.host;
  worker.numeric_profile = report.numeric_profile;
  worker.traits = report.traits;
  worker.thread_count = report.thread_count;
  worker.requested_lease_count = report.requested_lease_count;
  worker.draining = report.draining;
  worker.scene_memory_bytes = report.scene_memory_bytes;
  worker.lost = false;
  worker.last_seen_time = now;
  worker.warm_scenes.clear();
  for (const std::string& scene : report.warm_scenes) {
    if (worker.warm_scenes.size() >= static_cast<size_t>(limits_.warm_scenes_max)) break;
    worker.warm_scenes.insert(scene);
  }
  heard_.insert({now, report.worker_id});
  CountLive(worker, +1);
  return &worker;
}

WorkerRecord* WorkerTable::Find(const std::string& worker_id) {
  const auto found = workers_.find(worker_id);
  return found == workers_.end() ? nullptr : &found->second;
}

std::vector<WorkerRecord*> WorkerTable::WorkersOf(const std::string& identity) {
  std::vector<WorkerRecord*> found;
  if (!identities_.contains(identity)) return found;
  for (auto& [id, worker] : workers_) {
    if (worker.identity == identity) found.push_back(&worker);
  }
  return found;
}

void WorkerTable::SetQuarantine(const std::string& identity, const std::string& reason) {
  for (WorkerRecord* worker : WorkersOf(identity)) {
    CountLive(*worker, -1);
    worker->quarantine_reason = reason;
    CountLive(*worker, +1);
  }
}

void WorkerTable::Quarantine(const std::string& identity, const std::string& reason) {
  if (!quarantined_.emplace(identity, reason).second) return;
  quarantine_order_.push_back(identity);
  SetQuarantine(identity, reason);
  if (quarantined_.size() > limits_.quarantines_max) LiftQuarantine(quarantine_order_.front());
}

void WorkerTable::LiftQuarantine(const std::string& identity) {
  if (quarantined_.erase(identity) == 0) return;
  SetQuarantine(identity, "");
  std::erase(quarantine_order_, std::string(identity));
}

void WorkerTable::SetSick(WorkerRecord* worker, const std::string& reason) {
  CountLive(*worker, -1);
  worker->sick_reason = reason;
  CountLive(*worker, +1);
}

void WorkerTable::ApplyDrain(WorkerRecord* worker) const {
  const auto drain = drains_.find(worker->worker_id);
  worker->drained = drain != drains_.end();
  worker->drained_then_exit = worker->drained && drain->second;
}

void WorkerTable::Drain(const std::string& worker_id, bool then_exit) {
  drains_[worker_id] = then_exit;
  WorkerRecord* worker = Find(worker_id);
  if (worker == nullptr) return;
  CountLive(*worker, -1);
  ApplyDrain(worker);
  CountLive(*worker, +1);
}

void WorkerTable::Undrain(const std::string& worker_id) {
  if (drains_.erase(worker_id) == 0) return;
  WorkerRecord* worker = Find(worker_id);
  if (worker == nullptr) return;
  CountLive(*worker, -1);
  ApplyDrain(worker);
  CountLive(*worker, +1);
}

void WorkerTable::NoteResult(const std::string& identity) {
  const auto found = identities_.find(identity);
  if (found != identities_.end()) ++found->second.result_count;
}

uint64_t WorkerTable::ResultCount(const std::string& identity) const {
  const auto found = identities_.find(identity);
  return found == identities_.end() ? 0 : found->second.result_count;
}

std::vector<std::string> WorkerTable::MarkLost(SteadyTime now) {
  std::vector<std::string> newly_lost;
  while (!heard_.empty() && heard_.begin()->first + limits_.lease_duration < now) {
    const auto entry = *heard_.begin();
    heard_.erase(heard_.begin());
    silent_.insert(entry);
    WorkerRecord& worker = workers_.at(entry.second);
    if (worker.Stopped()) continue;
    CountLive(worker, -1);
    worker.lost = true;
    newly_lost.push_back(entry.second);
  }
  return newly_lost;
}

void WorkerTable::ForgetOld(SteadyTime now) {
  while (!silent_.empty() && silent_.begin()->first + limits_.lost_worker_kept < now) {
    const auto worker = workers_.find(silent_.begin()->second);
    SHEAF_CHECK(worker->second.leases.empty());
    const auto identity = identities_.find(worker->second.identity);
    if (--identity->second.worker_count == 0) identities_.erase(identity);
    workers_.erase(worker);
    silent_.erase(silent_.begin());
  }
}

int WorkerTable::LiveCount(const std::string& numeric_profile) const {
  const auto found = live_.find(numeric_profile);
  return found == live_.end() ? 0 : found->second.count;
}

int WorkerTable::LiveSlots(const std::string& numeric_profile) const {
  const auto found = live_.find(numeric_profile);
  return found == live_.end() ? 0 : found->second.slots;
}

const std::map<std::string, int>& WorkerTable::LiveIdentities(
    const std::string& numeric_profile) const {
  static const std::map<std::string, int> kNone;
  const auto found = live_.find(numeric_profile);
  return found == live_.end() ? kNone : found->second.by_identity;
}

const std::map<std::string, int>& WorkerTable::LiveIdentities(const std::string& numeric_profile,
                                                              const std::string& pool) const {
  static const std::map<std::string, int> kNone;
  const auto found = live_.find(numeric_profile);
  if (found == live_.end()) return kNone;
  const auto of_pool = found->second.by_pool.find(pool);
  return of_pool == found->second.by_pool.end() ? kNone : of_pool->second;
}

}  // namespace sheaf::coordinator
