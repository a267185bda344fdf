// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkerTable: the workers known to the coordinator, their liveness and their performance.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "common/base/steady_time.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/scheduling/sharing/requirement_groups.h"

namespace sheaf::coordinator {

struct WorkerRecord {
  std::string worker_id, host, numeric_profile;
  std::string identity;  // WorkerReport::identity.
  WorkerTraits traits;
  int32_t thread_count = 1;
  int32_t requested_lease_count = 0;
  bool draining = false;           // It reported that it is stopping.
  bool drained = false;            // An operator has drained it: it gets no lease.
  bool drained_then_exit = false;  // ... and must exit when it holds no lease.
  bool lost = false;
  std::string quarantine_reason;      // Empty while it is trusted.
  std::string sick_reason;            // Why it gets no work until an operator lifts that; or empty.
  std::set<std::string> warm_scenes;  // Compiled in its memory, or of leases it holds.
  uint64_t scene_memory_bytes = 0;    // Taken by the scenes in its memory; 0: not known.
  std::set<uint64_t> leases;          // Ids, held now.
  uint64_t lease_granted_count = 0;   // Ever.
  uint64_t lease_cold_count = 0;      // Those of scenes that it did not have.
  SteadyTime cold_lease_time = SteadyTime::InfinitePast();  // Time of the last of those.
  SteadyTime last_seen_time;
  uint64_t result_count = 0;    // Accepted.
  uint64_t sample_count = 0;    // Pixel samples of those.
  absl::Duration cpu_duration;  // CPU time of those.
  // Wall time between two accepted results if it held the second's lease all that time, and so
  // neither waited nor loaded; and the CPU time of those second results.
  absl::Duration busy_duration, busy_cpu_duration;
  SteadyTime last_result_time = SteadyTime::InfinitePast();
  // CPU time of recent results, and the time that other workers would have taken for them.
  double recent_cpu_seconds = 0, recent_usual_seconds = 0;
  // Jobs with tasks that it failed and others rendered, with the time of the last one.
  std::map<uint64_t, SteadyTime> failed_jobs;
  int infrastructure_failures = 0;  // Since its last accepted result.
  SteadyTime no_work_before = SteadyTime::InfinitePast();

  bool Quarantined() const { return !quarantine_reason.empty(); }
  bool Sick() const { return !sick_reason.empty(); }
  // Whether it has stopped cleanly: it reported that it stops, and holds no lease.
  bool Stopped() const { return draining && !lost && leases.empty(); }
  bool Draining() const { return draining || drained; }
  bool Live() const { return !lost && !Draining() && !Quarantined() && !Sick(); }
  // Pixel samples per second and thread; 0 before the first result.
  double SamplesPerThreadSecond() const;
  // Its speed relative to other workers on the same frames, within [1/4, 4].
  double RelativeSpeed() const;
  // A result took cpu_seconds, for which others would have taken usual_seconds.
  void NoteSpeed(double usual_seconds, double cpu_seconds);
  // Leases that it renders at once.
  int Slots() const { return std::max(1, std::min(thread_count, requested_lease_count)); }
  // The number of threads that samples keep busy: at least a tenth of its threads, at most all.
  double ThreadsUsed() const;
};

class WorkerTable {
 public:
  explicit WorkerTable(const Limits& limits) : limits_(limits) {}

  // Records a worker's report. Returns nullptr if the table is full. Requires: a known worker of
  // this id has the same identity.
  WorkerRecord* Touch(const WorkerReport& report, SteadyTime now);
  // Returns nullptr for a worker never heard of.
  WorkerRecord* Find(const std::string& worker_id);
  // Excludes all workers of the identity, also later ones.
  void Quarantine(const std::string& identity, const std::string& reason);
  void LiftQuarantine(const std::string& identity);
  // Excludes one worker, not its successors; an empty reason ends the exclusion.
  void SetSick(WorkerRecord* worker, const std::string& reason);
  // Drains a worker, known or not, or undoes that.
  void Drain(const std::string& worker_id, bool then_exit);
  void Undrain(const std::string& worker_id);
  // By identity, the reasons.
  const std::map<std::string, std::string>& quarantined() const { return quarantined_; }
  std::vector<WorkerRecord*> WorkersOf(const std::string& identity);
  // Counts an accepted result.
  void NoteResult(const std::string& identity);
  // Accepted results of an identity while it has known workers.
  uint64_t ResultCount(const std::string& identity) const;
  // Marks workers as lost that were silent for longer than the lease duration, except those that
  // have stopped; returns their ids.
  std::vector<std::string> MarkLost(SteadyTime now);
  // Forgets those silent for long. Requires: they hold no leases.
  void ForgetOld(SteadyTime now);

  // Live workers of a numeric profile.
  int LiveCount(const std::string& numeric_profile) const;
  int LiveCount() const { return live_total_; }
  // Leases that the workers of a numeric profile render at once.
  int LiveSlots(const std::string& numeric_profile) const;
  // The identities of live workers, each with its number of live workers.
  const std::map<std::string, int>& LiveIdentities(const std::string& numeric_profile) const;
  // The same for one pool.
  const std::map<std::string, int>& LiveIdentities(const std::string& numeric_profile,
                                                   const std::string& pool) const;
  // The live workers, by their traits.
  const WorkerKinds& kinds() const { return kinds_; }
  const std::map<std::string, WorkerRecord>& workers() const { return workers_; }

 private:
  struct IdentityRecord {
    int worker_count = 0;
    uint64_t result_count = 0;
  };
  struct LiveWorkers {
    int count = 0, slots = 0;
    std::map<std::string, int> by_identity;
    std::map<std::string, std::map<std::string, int>> by_pool;  // Then by identity.
  };
  void CountLive(const WorkerRecord& worker, int sign);
  void SetQuarantine(const std::string& identity, const std::string& reason);
  // Updates whether it is drained.
  void ApplyDrain(WorkerRecord* worker) const;

  const Limits& limits_;
  std::map<std::string, WorkerRecord> workers_;
  std::set<std::pair<SteadyTime, std::string>> heard_, silent_;  // By last_seen_time.
  std::map<std::string, LiveWorkers> live_;                      // By numeric profile.
  std::map<std::string, IdentityRecord> identities_;             // With known workers.
  std::map<std::string, std::string> quarantined_;
  std::map<std::string, bool> drains_;        // By worker id, whether it exits then.
  std::deque<std::string> quarantine_order_;  // Those of quarantined_, the oldest first.
  WorkerKinds kinds_;
  int live_total_ = 0;
};

}  // namespace sheaf::coordinator
