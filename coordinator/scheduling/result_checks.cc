// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/result_checks.h"

#include <algorithm>
#include <utility>

#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// By digest, the identities that vouch for it.
CheckVerdict Judge(const std::vector<ResultVersion>& versions, size_t versions_max) {
  std::map<std::string, size_t> votes;
  for (const ResultVersion& version : versions) ++votes[version.sha256_hex];
  const auto most =
      std::ranges::max_element(votes, {}, [](const auto& entry) { return entry.second; });
  CheckVerdict verdict;
  if (most->second < 2) {
    const bool enough = versions.size() >= versions_max;
    verdict.kind = enough ? CheckVerdict::Kind::kUndecided : CheckVerdict::Kind::kOpen;
    return verdict;
  }
  for (const ResultVersion& version : versions) {
    if (version.sha256_hex != most->first) verdict.liars.push_back(version.identity);
  }
  verdict.kind =
      verdict.liars.empty() ? CheckVerdict::Kind::kConfirmed : CheckVerdict::Kind::kDecided;
  return verdict;
}

}  // namespace

bool ResultCheck::MayBeDoneBy(const std::string& identity) const {
  return !avoided.contains(identity) &&
         std::ranges::none_of(
             versions, [&](const ResultVersion& version) { return version.identity == identity; });
}

void ResultChecks::Begin(const TaskId& task, ResultVersion merged) {
  const auto [check, is_new] = checks_.try_emplace(task);
  if (!is_new) return;
  check->second.versions.push_back(std::move(merged));
  waiting_.insert(task);
}

CheckVerdict ResultChecks::Add(const TaskId& task, const ResultVersion& merged,
                               ResultVersion version) {
  const bool is_new = !checks_.contains(task);
  Begin(task, merged);
  ResultCheck& check = checks_.at(task);
  const auto earlier =
      std::ranges::find(check.versions, version.identity, &ResultVersion::identity);
  CheckVerdict verdict;
  if (earlier == check.versions.end()) {
    check.versions.push_back(std::move(version));
    verdict = Judge(check.versions, versions_max_);
  } else if (earlier->sha256_hex != version.sha256_hex) {
    verdict = {CheckVerdict::Kind::kDecided, {version.identity}};
  } else {
    if (is_new) Erase(task);
    return verdict;  // The same again.
  }
  if (verdict.kind != CheckVerdict::Kind::kOpen) Erase(task);
  return verdict;
}

void ResultChecks::Erase(const TaskId& task) {
  checks_.erase(task);
  waiting_.erase(task);
}

void ResultChecks::EraseFrame(const FrameId& frame) {
  for (auto it = FirstOf(frame); it != checks_.end() && it->first.frame == frame;) {
    waiting_.erase(it->first);
    it = checks_.erase(it);
  }
}

void ResultChecks::Lease(const TaskId& task) {
  SHEAF_CHECK(waiting_.erase(task) == 1);
  checks_.at(task).leased = true;
}

void ResultChecks::Return(const TaskId& task) {
  const auto check = checks_.find(task);
  if (check == checks_.end()) return;  // It was decided by another result meanwhile.
  check->second.leased = false;
  waiting_.insert(task);
}

void ResultChecks::Avoid(const TaskId& task, const std::string& identity) {
  const auto check = checks_.find(task);
  if (check != checks_.end()) check->second.avoided.insert(identity);
}

const ResultCheck* ResultChecks::Find(const TaskId& task) const {
  const auto check = checks_.find(task);
  return check == checks_.end() ? nullptr : &check->second;
}

ResultChecks::Checks::const_iterator ResultChecks::FirstOf(const FrameId& frame) const {
  return checks_.lower_bound(TaskId{frame, 0, 0, 0, 0});
}

std::vector<TaskId> ResultChecks::OfFrame(const FrameId& frame) const {
  std::vector<TaskId> found;
  for (auto it = FirstOf(frame); it != checks_.end() && it->first.frame == frame; ++it) {
    found.push_back(it->first);
  }
  return found;
}

bool ResultChecks::HasDispute(const FrameId& frame) const {
  return std::ranges::any_of(OfFrame(frame),
                             [this](const TaskId& task) { return Find(task)->IsDispute(); });
}

}  // namespace sheaf::coordinator
