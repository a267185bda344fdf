// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/share_limits.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/placed_grants.h"

namespace sheaf::coordinator::scheduling {
namespace {

// Whether one more lease of the worker stays within the subject's limit.
bool KeepsLimit(const WorkState& state, const ShareSubject& subject, const WorkerRecord& worker) {
  const auto setting = state.sharing.settings.find(subject);
  if (setting == state.sharing.settings.end() || setting->second.threads_max == 0) return true;
  return state.sharing.held_threads.OfWith(subject, worker.worker_id, ThreadsPerLease(worker),
                                           worker.thread_count) <= setting->second.threads_max;
}

}  // namespace

void SetShare(WorkState& state, const ShareSubject& subject, const ShareSetting& setting) {
  state.sharing.settings[subject] = setting;
  state.sharing.order.SetWeight(subject, setting.weight);
}

void ResetShare(WorkState& state, const ShareSubject& subject) {
  state.sharing.settings.erase(subject);
  state.sharing.order.ResetWeight(subject);
}

double WeightOf(const WorkState& state, const ShareSubject& subject) {
  const auto setting = state.sharing.settings.find(subject);
  return setting == state.sharing.settings.end() ? 1 : setting->second.weight;
}

int ThreadsPerLease(const WorkerRecord& worker) {
  // A worker that asks for fewer leases than it has threads renders one lease with several.
  return std::max(1, worker.thread_count / std::max(1, worker.requested_lease_count));
}

bool MayServe(const WorkState& state, const JobRecord& job, const WorkerRecord& worker) {
  return Fits(job.spec.requirements, worker.traits) &&
         !job.IsRefusedByCacheOf(worker.worker_id, worker.last_seen_time) &&
         KeepsLimit(state, {ShareKind::kUser, job.spec.owner}, worker) &&
         KeepsLimit(state, {ShareKind::kShow, job.spec.show}, worker) &&
         KeepsLimit(state, {ShareKind::kPool, worker.traits.pool}, worker);
}

bool GrantFirstRender(WorkState& state, WorkerRecord* worker, SteadyTime now) {
  if (!KeepsLimit(state, {ShareKind::kPool, worker->traits.pool}, *worker)) return false;
  const std::vector<int> groups =
      state.sharing.groups.For(worker->numeric_profile, worker->traits, state.workers.kinds(),
                               state.limits.worker_kinds_scan_max);
  if (groups.empty()) return false;
  const auto may_take = [&](ShareKind kind, const std::string& name) {
    return state.sharing.settings.empty() || KeepsLimit(state, {kind, name}, *worker);
  };
  const auto offer = [&](size_t count_max) {
    return state.sharing.order.Offer(worker->numeric_profile, groups, may_take, count_max);
  };
  const std::vector<uint64_t> first = offer(1);
  if (first.empty()) return false;
  if (GrantWarm(state, &state.jobs.at(first[0]), worker, now)) return true;
  const std::vector<uint64_t> front = offer(static_cast<size_t>(state.limits.job_scan_max));
  if (GrantPlaced(state, front, worker, now)) return true;
  // Jobs that cannot yet open a frame may fill the front.
  const bool is_full = front.size() >= static_cast<size_t>(state.limits.job_scan_max);
  return is_full && GrantPlaced(state, OpenedJobs(state, *worker), worker, now);
}

void ChargeLease(WorkState& state, const JobRecord& job, const WorkerRecord& worker,
                 const Lease& lease, uint64_t sample_count) {
  const int threads = ThreadsPerLease(worker);
  state.sharing.order.Grant(lease.lease_id, job.spec.job_id, sample_count, threads);
  state.sharing.held_threads.Add(lease.lease_id, {job.spec.owner, job.spec.show, worker.traits.pool,
                                                  worker.worker_id, threads, worker.thread_count});
}

void ChargeResult(WorkState& state, const Lease& lease, const ResultCost& cost, SteadyTime now) {
  const WorkerRecord* worker = state.workers.Find(lease.worker_id);
  const int threads = worker == nullptr ? 1 : std::max(1, worker->thread_count);
  const absl::Duration held = std::max(absl::ZeroDuration(), now - lease.grant_time);
  state.sharing.order.Deliver(lease.lease_id, cost.cpu_duration, held * threads);
}

bool AnyIdentityFits(const WorkState& state, const JobSpec& spec,
                     const std::function<bool(const std::string&)>& accept) {
  const Requirements& requirements = spec.requirements;
  if (requirements.tags.empty() && requirements.memory_min_bytes == 0) {
    return std::ranges::any_of(
        state.workers.LiveIdentities(spec.numeric_profile, requirements.pool),
        [&](const auto& identity) { return accept(identity.first); });
  }
  return std::ranges::any_of(state.workers.workers(), [&](const auto& entry) {
    const WorkerRecord& worker = entry.second;
    return worker.Live() && worker.numeric_profile == spec.numeric_profile &&
           Fits(requirements, worker.traits) && accept(worker.identity);
  });
}

std::string WhyNobodyMay(const WorkState& state, const JobRecord& job) {
  std::string why = state.workers.kinds().WhyNone(job.spec.numeric_profile, job.spec.requirements);
  if (!why.empty()) return why;
  for (const ShareSubject& subject : {ShareSubject{ShareKind::kUser, job.spec.owner},
                                      ShareSubject{ShareKind::kShow, job.spec.show},
                                      ShareSubject{ShareKind::kPool, job.spec.requirements.pool}}) {
    const auto setting = state.sharing.settings.find(subject);
    if (setting == state.sharing.settings.end() || setting->second.threads_max == 0) continue;
    const int64_t held = state.sharing.held_threads.Of(subject);
    if (held < setting->second.threads_max) continue;
    return absl::StrCat(FormatShareSubject(subject), " holds ", held, " threads, of ",
                        setting->second.threads_max, " that it may hold (sheaf share list)");
  }
  return "";
}

}  // namespace sheaf::coordinator::scheduling
