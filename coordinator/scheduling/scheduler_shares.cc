// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that shares the farm between shows, users and jobs, and keeps their limits
// and the jobs' requirements.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

void Scheduler::SetShare(const ShareSubject& subject, const ShareSetting& setting) {
  share_settings_[subject] = setting;
  shares_.SetWeight(subject, setting.weight);
}

void Scheduler::ResetShare(const ShareSubject& subject) {
  share_settings_.erase(subject);
  shares_.ResetWeight(subject);
}

double Scheduler::WeightOf(const ShareSubject& subject) const {
  const auto setting = share_settings_.find(subject);
  return setting == share_settings_.end() ? 1 : setting->second.weight;
}

int Scheduler::ThreadsPerLease(const WorkerRecord& worker) {
  // A worker that asks for fewer leases than it has threads renders one lease with several.
  return std::max(1, worker.thread_count / std::max(1, worker.requested_lease_count));
}

bool Scheduler::KeepsLimit(const ShareSubject& subject, const WorkerRecord& worker) const {
  const auto setting = share_settings_.find(subject);
  if (setting == share_settings_.end() || setting->second.threads_max == 0) return true;
  return held_threads_.OfWith(subject, worker.worker_id, ThreadsPerLease(worker),
                              worker.thread_count) <= setting->second.threads_max;
}

bool Scheduler::MayServe(const JobRecord& job, const WorkerRecord& worker) const {
  return Fits(job.spec.requirements, worker.traits) &&
         !job.IsRefusedByCacheOf(worker.worker_id, worker.last_seen_time) &&
         KeepsLimit({ShareKind::kUser, job.spec.owner}, worker) &&
         KeepsLimit({ShareKind::kShow, job.spec.show}, worker) &&
         KeepsLimit({ShareKind::kPool, worker.traits.pool}, worker);
}

bool Scheduler::GrantFirstRender(WorkerRecord* worker, SteadyTime now) {
  if (!KeepsLimit({ShareKind::kPool, worker->traits.pool}, *worker)) return false;
  const std::vector<int> groups = requirement_groups_.For(
      worker->numeric_profile, worker->traits, workers_.kinds(), limits_.worker_kinds_scan_max);
  if (groups.empty()) return false;
  const auto may_take = [&](ShareKind kind, const std::string& name) {
    return share_settings_.empty() || KeepsLimit({kind, name}, *worker);
  };
  const auto offer = [&](size_t count_max) {
    return shares_.Offer(worker->numeric_profile, groups, may_take, count_max);
  };
  const std::vector<uint64_t> first = offer(1);
  if (first.empty()) return false;
  if (GrantWarm(&jobs_.at(first[0]), worker, now)) return true;
  const std::vector<uint64_t> front = offer(static_cast<size_t>(limits_.job_scan_max));
  if (GrantPlaced(front, worker, now)) return true;
  // Jobs that cannot yet open a frame may fill the front.
  const bool is_full = front.size() >= static_cast<size_t>(limits_.job_scan_max);
  return is_full && GrantPlaced(OpenedJobs(*worker), worker, now);
}

void Scheduler::ChargeLease(const JobRecord& job, const WorkerRecord& worker, const Lease& lease,
                            uint64_t sample_count) {
  const int threads = ThreadsPerLease(worker);
  shares_.Grant(lease.lease_id, job.spec.job_id, sample_count, threads);
  held_threads_.Add(lease.lease_id, {job.spec.owner, job.spec.show, worker.traits.pool,
                                     worker.worker_id, threads, worker.thread_count});
}

void Scheduler::ChargeResult(const Lease& lease, const ResultCost& cost, SteadyTime now) {
  const WorkerRecord* worker = workers_.Find(lease.worker_id);
  const int threads = worker == nullptr ? 1 : std::max(1, worker->thread_count);
  const absl::Duration held = std::max(absl::ZeroDuration(), now - lease.grant_time);
  shares_.Deliver(lease.lease_id, cost.cpu_duration, held * threads);
}

bool Scheduler::AnyIdentityFits(const JobSpec& spec,
                                const std::function<bool(const std::string&)>& accept) const {
  const Requirements& requirements = spec.requirements;
  if (requirements.tags.empty() && requirements.memory_min_bytes == 0) {
    return std::ranges::any_of(workers_.LiveIdentities(spec.numeric_profile, requirements.pool),
                               [&](const auto& identity) { return accept(identity.first); });
  }
  return std::ranges::any_of(workers_.workers(), [&](const auto& entry) {
    const WorkerRecord& worker = entry.second;
    return worker.Live() && worker.numeric_profile == spec.numeric_profile &&
           Fits(requirements, worker.traits) && accept(worker.identity);
  });
}

std::string Scheduler::WhyNobodyMay(const JobRecord& job) const {
  std::string why = workers_.kinds().WhyNone(job.spec.numeric_profile, job.spec.requirements);
  if (!why.empty()) return why;
  for (const ShareSubject& subject : {ShareSubject{ShareKind::kUser, job.spec.owner},
                                      ShareSubject{ShareKind::kShow, job.spec.show},
                                      ShareSubject{ShareKind::kPool, job.spec.requirements.pool}}) {
    const auto setting = share_settings_.find(subject);
    if (setting == share_settings_.end() || setting->second.threads_max == 0) continue;
    const int64_t held = held_threads_.Of(subject);
    if (held < setting->second.threads_max) continue;
    return absl::StrCat(FormatShareSubject(subject), " holds ", held, " threads, of ",
                        setting->second.threads_max, " that it may hold (sheaf share list)");
  }
  return "";
}

}  // namespace sheaf::coordinator
