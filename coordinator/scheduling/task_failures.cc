// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/task_failures.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {

void TaskFailures::Add(const std::string& worker_id, const std::string& identity, FailureKind kind,
                       const std::string& words) {
  last_words = words;
  // Workers that vanished are not to blame, and there may be many.
  const bool is_named = kind != FailureKind::kLost;
  TaskFailure added{is_named ? worker_id : "", is_named ? identity : "", kind, 1, words};
  for (TaskFailure& failure : trouble.failures) {
    if (failure.worker_id != added.worker_id || failure.kind != kind) continue;
    ++failure.count;
    failure.words = words;
    return;
  }
  trouble.failures.push_back(std::move(added));
}

int TaskFailures::CountOf(FailureKind kind) const {
  int count = 0;
  for (const TaskFailure& failure : trouble.failures) {
    if (failure.kind == kind) count += failure.count;
  }
  return count;
}

int TaskFailures::IdentityCountOf(FailureKind kind) const {
  std::set<std::string> identities;
  for (const TaskFailure& failure : trouble.failures) {
    if (failure.kind == kind) identities.insert(failure.identity);
  }
  return static_cast<int>(identities.size());
}

std::set<std::string> TaskFailures::Identities() const {
  std::set<std::string> identities;
  for (const TaskFailure& failure : trouble.failures) {
    if (!failure.identity.empty()) identities.insert(failure.identity);
  }
  return identities;
}

std::set<std::string> TaskFailures::Workers() const {
  std::set<std::string> workers;
  for (const TaskFailure& failure : trouble.failures) {
    if (!failure.worker_id.empty()) workers.insert(failure.worker_id);
  }
  return workers;
}

bool TaskFailures::IsFailedBy(const std::string& worker_id) const {
  return std::ranges::any_of(trouble.failures, [&](const TaskFailure& failure) {
    return failure.worker_id == worker_id && IsOwnFailure(failure.kind);
  });
}

bool TaskFailures::HasInfrastructureFailureOf(const std::string& worker_id) const {
  return std::ranges::any_of(trouble.failures, [&](const TaskFailure& failure) {
    return failure.worker_id == worker_id && failure.kind == FailureKind::kInfrastructure;
  });
}

bool TaskFailures::IsPoison(const Limits& limits) const {
  std::set<std::string> own;
  for (const TaskFailure& failure : trouble.failures) {
    if (IsOwnFailure(failure.kind)) own.insert(failure.identity);
  }
  return static_cast<int>(own.size()) >= limits.poison_workers_max ||
         IdentityCountOf(FailureKind::kInternal) >= limits.crash_workers_max ||
         IdentityCountOf(FailureKind::kMemory) >= limits.memory_workers_max ||
         IdentityCountOf(FailureKind::kInvalid) >= limits.invalid_workers_max ||
         CountOf(FailureKind::kInfrastructure) >= limits.infrastructure_failures_max ||
         CountOf(FailureKind::kLost) >= limits.lost_failures_max;
}

std::string TaskFailures::Text() const {
  std::string text;
  for (const TaskFailure& failure : trouble.failures) {
    if (failure.worker_id.empty()) continue;
    absl::StrAppend(&text, text.empty() ? "" : ", ", failure.worker_id, " by ",
                    FailureKindText(failure.kind),
                    failure.count == 1 ? "" : absl::StrCat(" (", failure.count, " times)"));
  }
  return text;
}

}  // namespace sheaf::coordinator
