// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FairShare: the order in which jobs are offered to workers. Jobs of one numeric profile and
// priority share the work as a tree: first the shows, then the users of a show, then the jobs of a
// user.
//
// Every node counts its share: the thread-seconds that it received, divided by its weight. The
// child with the smallest share is offered first. A grant charges the expected cost of the lease's
// samples. While the lease runs longer than that, it is charged by the time it is held. Its end
// charges the CPU time of its result or, without a result, the time it was held. So cheap and
// expensive scenes get equal time, not equal numbers of samples.
//
// A node that arrives, or returns after it held and wanted nothing, begins at the share of the
// child that was served last, or at the least share of those that want work, if that is larger: it
// has no claim on time that others used before. This is the virtual time of start-time fair
// queueing (Goyal, Vin and Cheng 1996, doi:10.1145/248156.248171), applied to a tree as there, with
// strides of 1 / weight (Waldspurger and Weihl 1995, "Stride Scheduling", MIT/LCS/TM-528). A node
// that could not be served, because of a limit or a lack of workers, catches up by at most
// share_lag_max.
//
// Thread safety: none. Cost: O(g log n) a lease, for g different requirements of a node's jobs;
// nodes at the front that `may_take` refuses cost O(log n) each. Equal calls give equal orders.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "common/base/steady_time.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/core/job/share_setting.h"

namespace sheaf::coordinator {

class FairShare {
 public:
  explicit FairShare(const Limits& limits) : limits_(limits) {}
  FairShare(const FairShare&) = delete;
  FairShare& operator=(const FairShare&) = delete;

  struct Job {
    uint64_t job_id = 0;
    std::string numeric_profile;
    int32_t priority = 0;
    std::string show, user;
    int group = 0;  // Jobs of a group have equal requirements (RequirementGroups).
  };
  // The job wants nothing yet. Requires: the id is new.
  void AddJob(const Job& job);
  // Its open leases are no longer charged to anyone.
  void RemoveJob(uint64_t job_id);
  // Whether a job has something to lease.
  void SetReady(uint64_t job_id, bool is_ready);
  // The job begins at the least share at its new priority.
  void SetPriority(uint64_t job_id, int32_t priority);
  // Sets the weight of a user or a show, from the next charge on.
  void SetWeight(const ShareSubject& subject, double weight) { weights_[subject] = weight; }
  void ResetWeight(const ShareSubject& subject) { weights_.erase(subject); }

  // Whether a user or a show may hold more threads.
  using MayTake = std::function<bool(ShareKind, const std::string&)>;
  // The jobs to try for a worker, at most count_max of them, the first to be served first. groups:
  // those whose requirements it meets. A user's jobs after the first few come last, so that a user
  // whose jobs this worker cannot render leaves room for others.
  std::vector<uint64_t> Offer(const std::string& numeric_profile, const std::vector<int>& groups,
                              const MayTake& may_take, size_t count_max) const;

  // A lease of sample_count pixel samples was granted, for thread_count threads of a worker.
  void Grant(uint64_t lease_id, uint64_t job_id, uint64_t sample_count, int thread_count);
  // The lease was seen being loaded or rendered. A no-op if the lease has ended, as are the next
  // two.
  void Run(uint64_t lease_id, SteadyTime now);
  // The lease gave a result that took `cpu`. cpu_max: an upper bound on what a worker can have
  // spent.
  void Deliver(uint64_t lease_id, absl::Duration cpu, absl::Duration cpu_max);
  // The lease ended without a result; its worker was last heard at heard_time.
  void End(uint64_t lease_id, SteadyTime heard_time);
  // Samples of a job cost this.
  void NoteCost(uint64_t job_id, uint64_t sample_count, absl::Duration cpu);

  // Thread-seconds over the weight. Only comparable between jobs of the same user and priority.
  double ShareOfJob(uint64_t job_id) const;
  // The expected cost of a lease of the job, in thread-seconds.
  double ExpectedSeconds(uint64_t job_id, uint64_t sample_count) const;

 private:
  enum class Level { kJob, kUser, kShow, kClass };
  struct Node;
  using Key = std::tuple<double, uint64_t, Node*>;  // Share and order; the latter is unique.
  struct Node {
    Level level = Level::kJob;
    std::string name;
    uint64_t order = 0;                        // A job's id.
    int64_t minus_priority = 0;                // Only for a class.
    Node* parent = nullptr;                    // Null for a class.
    double share = 0;                          // Thread-seconds over the weight.
    double clock = 0;                          // The largest share with which a child was served.
    int job_count = 0;                         // At or below it.
    int lease_count = 0;                       // The same.
    double cpu_seconds = 0, sample_count = 0;  // Measured costs.
    int group = 0;                             // Only for a job.
    bool is_ready = false;                     // Only for a job.
    // Not for a job: children with ready jobs, by group; and all children other than jobs.
    std::map<int, std::set<Key>> ready;
    std::map<std::string, std::unique_ptr<Node>> children;
    std::set<Key> idle;  // Children without jobs that are ahead of others.
  };
  using ClassKey = std::pair<std::string, int64_t>;  // Numeric profile, minus priority.
  struct Charge {
    uint64_t job_id = 0;
    ClassKey job_class;
    double seconds = 0;
    int thread_count = 1;
    SteadyTime begin_time = SteadyTime::InfiniteFuture();
  };
  class Merge;  // The ready children of a node, over several groups, in order.
  struct Walk;

  static Key KeyOf(Node* node) { return {node->share, node->order, node}; }
  static bool IsReady(const Node& node);
  static double NewcomerShare(const Node& parent);
  Node* MakeChild(Node* parent, Level level, const std::string& name);
  Node* Attach(const Job& job);
  void Detach(Node* job);
  void Forget(Node* parent);
  void SetShare(Node* node, double share);
  // Counts seconds, which may be negative, for a job and all above it.
  void Count(Node* job, double seconds, bool is_grant);
  void Recharge(Charge* charge, double seconds);
  double WeightOf(const Node& node) const;
  ClassKey ClassOf(const Node& job) const;
  static void Collect(const Node& node, Walk* walk);

  const Limits limits_;
  std::map<ClassKey, std::unique_ptr<Node>> classes_;
  std::unordered_map<uint64_t, std::unique_ptr<Node>> jobs_;
  std::unordered_map<uint64_t, Charge> charges_;  // By lease.
  std::map<ShareSubject, double> weights_;        // Others have 1.
  double cpu_seconds_ = 0, sample_count_ = 0;     // Measured, of all jobs.
  uint64_t next_order_ = 0;
};

}  // namespace sheaf::coordinator
