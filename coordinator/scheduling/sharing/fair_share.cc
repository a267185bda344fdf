// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/sharing/fair_share.h"

#include <algorithm>
#include <limits>

#include "absl/strings/numbers.h"
#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// Thread-seconds of a pixel sample before any measurement.
constexpr double kUnknownSecondsPerSample = 1e-5;

// Number of a user's jobs that are tried before those of other users.
constexpr size_t kJobsTriedFirst = 8;

}  // namespace

// Merges the ordered sets of the groups; a child with jobs of several groups comes once.
class FairShare::Merge {
 public:
  Merge(const Node& node, const std::vector<int>& groups) {
    for (const int group : groups) {
      const auto found = node.ready.find(group);
      if (found != node.ready.end())
        ranges_.push_back({found->second.begin(), found->second.end()});
    }
  }
  // Null at the end.
  const Node* Next() {
    while (true) {
      Range* first = nullptr;
      for (Range& range : ranges_) {
        if (range.next == range.end) continue;
        if (first == nullptr || *range.next < *first->next) first = &range;
      }
      if (first == nullptr) return nullptr;
      const Node* const node = std::get<2>(*first->next++);
      if (node == last_) continue;
      return last_ = node;
    }
  }

 private:
  struct Range {
    std::set<Key>::const_iterator next, end;
  };
  std::vector<Range> ranges_;
  const Node* last_ = nullptr;
};

struct FairShare::Walk {
  const std::vector<int>& groups;
  const MayTake& may_take;
  const size_t count_max;
  const size_t nodes_max;
  size_t user_first = 0, user_end = 0;  // Range of a user's jobs.
  size_t node_count = 0;
  std::vector<uint64_t> jobs = {};

  bool Full() const { return jobs.size() >= count_max || node_count >= nodes_max; }
};

bool FairShare::IsReady(const Node& node) {
  return node.level == Level::kJob ? node.is_ready : !node.ready.empty();
}

double FairShare::NewcomerShare(const Node& parent) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [group, ready] : parent.ready) {
    least = std::min(least, std::get<0>(*ready.begin()));
  }
  return parent.ready.empty() ? parent.clock : std::max(parent.clock, least);
}

FairShare::Node* FairShare::MakeChild(Node* parent, Level level, const std::string& name) {
  std::unique_ptr<Node>& child = parent->children[name];
  if (child != nullptr) {
    parent->idle.erase(KeyOf(child.get()));
    return child.get();
  }
  child = std::make_unique<Node>();
  child->level = level;
  child->name = name;
  child->order = next_order_++;
  child->parent = parent;
  child->share = NewcomerShare(*parent);
  return child.get();
}

FairShare::Node* FairShare::Attach(const Job& job) {
  std::unique_ptr<Node>& root = classes_[{job.numeric_profile, -int64_t{job.priority}}];
  if (root == nullptr) {
    root = std::make_unique<Node>();
    root->level = Level::kClass;
    root->name = job.numeric_profile;
    root->minus_priority = -int64_t{job.priority};
  }
  Forget(root.get());
  Node* show = MakeChild(root.get(), Level::kShow, job.show);
  Forget(show);
  return MakeChild(show, Level::kUser, job.user);
}

void FairShare::AddJob(const Job& job) {
  const auto [it, is_new] = jobs_.emplace(job.job_id, std::make_unique<Node>());
  SHEAF_CHECK(is_new);
  Node* node = it->second.get();
  node->order = job.job_id;
  node->group = job.group;
  node->parent = Attach(job);
  node->share = NewcomerShare(*node->parent);
  for (Node* n = node; n != nullptr; n = n->parent) ++n->job_count;
}

void FairShare::Detach(Node* job) {
  Node* parent = job->parent;
  for (Node* n = parent; n != nullptr; n = n->parent) {
    --n->job_count;
    n->lease_count -= job->lease_count;
  }
  while (parent->level != Level::kClass) {
    Node* const child = std::exchange(parent, parent->parent);
    if (child->job_count == 0) parent->idle.insert(KeyOf(child));
    Forget(parent);
  }
  if (parent->job_count > 0) return;
  const ClassKey key{parent->name, parent->minus_priority};
  classes_.erase(key);
}

// Removes children without jobs that are not ahead of others: they would return with a newcomer's
// share.
void FairShare::Forget(Node* parent) {
  while (!parent->idle.empty()) {
    const Key first = *parent->idle.begin();
    if (std::get<0>(first) > parent->clock && parent->idle.size() <= limits_.idle_shares_max)
      return;
    parent->idle.erase(parent->idle.begin());
    parent->children.erase(std::string(std::get<2>(first)->name));
  }
}

void FairShare::RemoveJob(uint64_t job_id) {
  const auto found = jobs_.find(job_id);
  SHEAF_CHECK(found != jobs_.end());
  SetReady(job_id, false);
  Detach(found->second.get());
  jobs_.erase(found);
}

void FairShare::SetReady(uint64_t job_id, bool is_ready) {
  Node* const job = jobs_.at(job_id).get();
  if (job->is_ready == is_ready) return;
  if (!is_ready) {
    for (Node* n = job; n->parent != nullptr; n = n->parent) {
      const auto of_group = n->parent->ready.find(job->group);
      of_group->second.erase(KeyOf(n));
      if (!of_group->second.empty()) break;
      n->parent->ready.erase(of_group);
    }
    job->is_ready = false;
    return;
  }
  for (Node* n = job; n->parent != nullptr; n = n->parent) {
    // It held nothing and wanted nothing.
    if (!IsReady(*n) && n->lease_count == 0) {
      n->share = std::max(n->share, NewcomerShare(*n->parent));
    }
  }
  job->is_ready = true;
  for (Node* n = job; n->parent != nullptr; n = n->parent) {
    std::set<Key>& ready = n->parent->ready[job->group];
    const bool was_ready = !ready.empty();
    ready.insert(KeyOf(n));
    if (was_ready) break;
  }
}

void FairShare::SetPriority(uint64_t job_id, int32_t priority) {
  Node* const job = jobs_.at(job_id).get();
  const bool was_ready = job->is_ready;
  SetReady(job_id, false);
  const Node& user = *job->parent;
  const Job moved{job_id, ClassOf(*job).first, priority, user.parent->name, user.name, job->group};
  Detach(job);
  job->parent = Attach(moved);
  job->share = NewcomerShare(*job->parent);
  for (Node* n = job->parent; n != nullptr; n = n->parent) {
    ++n->job_count;
    n->lease_count += job->lease_count;
  }
  SetReady(job_id, was_ready);
}

void FairShare::Collect(const Node& node, Walk* walk) {
  Merge children(node, walk->groups);
  size_t place = 0;
  while (const Node* child = children.Next()) {
    if (walk->Full()) return;
    if (child->level == Level::kJob) {
      if (place >= walk->user_end) return;
      if (place++ >= walk->user_first) walk->jobs.push_back(child->order);
      continue;
    }
    ++walk->node_count;
    const bool is_show = child->level == Level::kShow;
    if (!walk->may_take(is_show ? ShareKind::kShow : ShareKind::kUser, child->name)) continue;
    Collect(*child, walk);
  }
}

std::vector<uint64_t> FairShare::Offer(const std::string& numeric_profile,
                                       const std::vector<int>& groups, const MayTake& may_take,
                                       size_t count_max) const {
  Walk walk{groups, may_take, count_max, static_cast<size_t>(limits_.share_scan_max)};
  const std::pair<size_t, size_t> passes[] = {{0, kJobsTriedFirst}, {kJobsTriedFirst, count_max}};
  const auto first = classes_.lower_bound({numeric_profile, std::numeric_limits<int64_t>::min()});
  for (auto it = first; it != classes_.end() && it->first.first == numeric_profile; ++it) {
    for (const auto& [begin, end] : passes) {
      if (walk.Full() || begin >= count_max) break;
      walk.user_first = begin;
      walk.user_end = end;
      Collect(*it->second, &walk);
    }
    if (walk.Full()) break;
  }
  return std::move(walk.jobs);
}

double FairShare::WeightOf(const Node& node) const {
  if (node.level == Level::kJob) return 1;
  const ShareKind kind = node.level == Level::kUser ? ShareKind::kUser : ShareKind::kShow;
  const auto found = weights_.find({kind, node.name});
  return found == weights_.end() ? 1 : found->second;
}

FairShare::ClassKey FairShare::ClassOf(const Node& job) const {
  const Node& root = *job.parent->parent->parent;
  return {root.name, root.minus_priority};
}

void FairShare::SetShare(Node* node, double share) {
  std::vector<std::set<Key>*> sets;
  if (node->level == Level::kJob) {
    if (node->is_ready) sets.push_back(&node->parent->ready.at(node->group));
  } else {
    for (const auto& [group, ready] : node->ready) sets.push_back(&node->parent->ready.at(group));
  }
  for (std::set<Key>* set : sets) set->erase(KeyOf(node));
  node->share = share;
  for (std::set<Key>* set : sets) set->insert(KeyOf(node));
}

void FairShare::Count(Node* job, double seconds, bool is_grant) {
  for (Node* n = job; n->parent != nullptr; n = n->parent) {
    double share = n->share;
    if (is_grant) {
      const double lag_max = limits_.share_lag_max_seconds * std::max(1, n->parent->lease_count);
      share = std::max(share, n->parent->clock - lag_max);
      n->parent->clock = std::max(n->parent->clock, share);
    }
    SetShare(n, share + seconds / WeightOf(*n));
  }
}

double FairShare::ExpectedSeconds(uint64_t job_id, uint64_t sample_count) const {
  // Jobs of one user are more similar than those of all users.
  double rate = sample_count_ > 0 ? cpu_seconds_ / sample_count_ : kUnknownSecondsPerSample;
  const Node& job = *jobs_.at(job_id);
  for (const Node* node : {&std::as_const(*job.parent), &job}) {
    if (node->sample_count > 0) rate = node->cpu_seconds / node->sample_count;
  }
  return rate * static_cast<double>(sample_count);
}

void FairShare::Grant(uint64_t lease_id, uint64_t job_id, uint64_t sample_count, int thread_count) {
  Node* const job = jobs_.at(job_id).get();
  const double seconds = ExpectedSeconds(job_id, sample_count);
  charges_[lease_id] = {job_id, ClassOf(*job), seconds, thread_count};
  Count(job, seconds, /*is_grant=*/true);
  for (Node* n = job; n != nullptr; n = n->parent) ++n->lease_count;
}

void FairShare::Recharge(Charge* charge, double seconds) {
  const auto job = jobs_.find(charge->job_id);
  const double more = seconds - std::exchange(charge->seconds, seconds);
  // Service received at the old priority stays charged there.
  if (job == jobs_.end() || ClassOf(*job->second) != charge->job_class) return;
  Count(job->second.get(), more, /*is_grant=*/false);
}

void FairShare::Run(uint64_t lease_id, SteadyTime now) {
  const auto found = charges_.find(lease_id);
  if (found == charges_.end()) return;
  Charge& charge = found->second;
  charge.begin_time = std::min(charge.begin_time, now);
  const double held = absl::ToDoubleSeconds(now - charge.begin_time) * charge.thread_count;
  if (held > charge.seconds) Recharge(&charge, held);
}

void FairShare::Deliver(uint64_t lease_id, absl::Duration cpu, absl::Duration cpu_max) {
  const auto found = charges_.find(lease_id);
  if (found == charges_.end()) return;
  Recharge(&found->second, absl::ToDoubleSeconds(std::clamp(cpu, absl::ZeroDuration(), cpu_max)));
  const auto job = jobs_.find(found->second.job_id);
  if (job != jobs_.end()) {
    for (Node* n = job->second.get(); n != nullptr; n = n->parent) --n->lease_count;
  }
  charges_.erase(found);
}

void FairShare::End(uint64_t lease_id, SteadyTime heard_time) {
  const auto found = charges_.find(lease_id);
  if (found == charges_.end()) return;
  const Charge& charge = found->second;
  const absl::Duration held =
      charge.begin_time <= heard_time ? heard_time - charge.begin_time : absl::ZeroDuration();
  Deliver(lease_id, held * charge.thread_count, absl::InfiniteDuration());
}

void FairShare::NoteCost(uint64_t job_id, uint64_t sample_count, absl::Duration cpu) {
  const auto found = jobs_.find(job_id);
  if (found == jobs_.end() || sample_count == 0 || cpu <= absl::ZeroDuration()) return;
  const double seconds = absl::ToDoubleSeconds(cpu);
  const auto samples = static_cast<double>(sample_count);
  for (Node* node : {found->second.get(), found->second->parent}) {
    node->cpu_seconds += seconds;
    node->sample_count += samples;
  }
  cpu_seconds_ += seconds;
  sample_count_ += samples;
}

double FairShare::ShareOfJob(uint64_t job_id) const { return jobs_.at(job_id)->share; }

}  // namespace sheaf::coordinator
