// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResultChecks: the tasks that are rendered again, by other identities, to compare the results. A
// check is over when two identities have delivered the same bytes: those are believed, and every
// identity that delivered other bytes made a false result. Once two results differ, the check is a
// dispute, and neither is believed.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/steady_time.h"
#include "coordinator/scheduling/lease_table.h"

namespace sheaf::coordinator {

// The bytes that an identity delivered for a task, by their digest.
struct ResultVersion {
  std::string identity;
  std::string sha256_hex;
  friend bool operator==(const ResultVersion&, const ResultVersion&) = default;
};

// The verdict after one more version of a result.
struct CheckVerdict {
  enum class Kind {
    kOpen,       // More versions are needed.
    kConfirmed,  // All versions agree.
    kDecided,    // Some agree, and the others made false results.
    kUndecided,  // Too many differ: no further versions are requested.
  };
  Kind kind = Kind::kOpen;
  std::vector<std::string> liars;  // Identities.
};

struct ResultCheck {
  std::vector<ResultVersion> versions;  // The first is the one that is merged.
  std::set<std::string> avoided;        // Identities that failed to render it.
  bool leased = false;
  bool IsDispute() const { return versions.size() > 1; }
  // Whether another version of this identity would add information.
  bool MayBeDoneBy(const std::string& identity) const;
};

// The wait of a rendered frame for its checks.
struct CheckWait {
  SteadyTime begin, progress;  // Start, and the time of the last check.
  SteadyTime end;              // Deadline, unless a check arrives.
  bool waits = true;           // The last answer.
};

// Thread safety: none. Cost: O(log n) a call, and O(n) of what is returned.
class ResultChecks {
 public:
  // versions_max: different versions of one task at which a dispute stays undecided.
  explicit ResultChecks(size_t versions_max) : versions_max_(versions_max) {}

  // Begins a check of the merged result. A no-op if there is one.
  void Begin(const TaskId& task, ResultVersion merged);
  // Adds a version; begins a check if there is none. An identity that contradicts itself made a
  // false result, whichever identities agree with it. A check that is not open after this is over.
  CheckVerdict Add(const TaskId& task, const ResultVersion& merged, ResultVersion version);
  void Erase(const TaskId& task);
  void EraseFrame(const FrameId& frame);

  // A worker holds the check's lease, or gave it back. The check is known.
  void Lease(const TaskId& task);
  void Return(const TaskId& task);
  // The identity cannot render the task.
  void Avoid(const TaskId& task, const std::string& identity);

  const ResultCheck* Find(const TaskId& task) const;
  // Those that no worker holds.
  const std::set<TaskId>& waiting() const { return waiting_; }
  std::vector<TaskId> OfFrame(const FrameId& frame) const;
  bool HasDispute(const FrameId& frame) const;
  size_t size() const { return checks_.size(); }

 private:
  using Checks = std::map<TaskId, ResultCheck>;
  Checks::const_iterator FirstOf(const FrameId& frame) const;

  const size_t versions_max_;
  Checks checks_;
  std::set<TaskId> waiting_;
};

}  // namespace sheaf::coordinator
