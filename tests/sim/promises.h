// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Promises: what the job store has said to be durable, over all runs of the coordinator. A call
// that returned OK is a promise. A call that failed, or during which the machine stopped, may have
// had its effect or not: then either is right, and the next start shows which.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/job_store.h"

namespace sheaf::sim {

// A value that is known, or is one of several.
template <typename Value>
class Possibly {
 public:
  void Set(Value value) { values_ = {std::move(value)}; }
  void MaySet(Value value) { values_.insert(std::move(value)); }
  bool IsCertainly(const Value& value) const {
    return values_.size() == 1 && values_.contains(value);
  }
  bool MayBe(const Value& value) const { return values_.contains(value); }

 private:
  std::set<Value> values_{Value{}};
};

struct PromisedJob {
  Possibly<int> phase;  // JobPhase.
  Possibly<bool> paused;
  Possibly<int32_t> priority;
  std::map<int32_t, Possibly<std::string>> delivered;  // By frame: digests of images; "": none.
  // By frame, the last digest whose delivery was durable: it may be shown, also while the frame is
  // being reopened.
  std::map<int32_t, std::string> shown;
};

class Promises {
 public:
  // Called with what is broken.
  explicit Promises(std::function<void(const std::string&)> broken) : broken_(std::move(broken)) {}

  // certain: the call returned OK and the machine did not stop during it.
  void Created(uint64_t job_id, const coordinator::JobSpec& spec, bool certain);
  void Ended(uint64_t job_id, coordinator::JobPhase phase, bool certain);
  void Paused(uint64_t job_id, bool paused, bool certain);
  void Prioritized(uint64_t job_id, int32_t priority, bool certain);
  void Reopened(uint64_t job_id, const std::vector<int32_t>& frames, bool certain);
  void Delivered(const coordinator::FrameId& frame, const std::string& digest, bool certain);
  void Written(const coordinator::PartRow& row, bool certain);
  void Removed(const coordinator::PartRow& row, bool certain);
  void FrameRemoved(const coordinator::FrameId& frame, bool certain);
  void Quarantined(const coordinator::QuarantineRecord& record, bool certain);
  void Lifted(const std::string& identity, bool certain);
  // A life has started with this secret.
  void Started(const std::string& secret);
  // A file was damaged on purpose: its row may be lost.
  void Damaged() { ++damaged_count_; }

  // Compares with what a new life found.
  void CheckLog(int64_t lost_commits) const;
  void CheckJobs(const std::vector<coordinator::StoredJob>& jobs);
  void CheckParts(uint64_t job_id, const coordinator::JobStore::LoadedParts& parts);
  void CheckQuarantines(const std::vector<coordinator::QuarantineRecord>& records);

  // A call begins that stores parts; and whether a part of these bytes became durable in it. A job
  // that ends meanwhile may have removed the part by the end of the call.
  void BeginStoring() { stored_.clear(); }
  bool HasStored(const std::string& sha256_hex) const { return stored_.contains(sha256_hex); }
  const std::map<uint64_t, PromisedJob>& jobs() const { return jobs_; }
  uint64_t PartsBytes() const;
  // Whether the delivered image of the frame may differ from that of one process, by a false part
  // (one of these digests) or a false guiding field that the farm could not correct: its maker has
  // not been found to make false ones, or the part was gone by then. In a frame without rounds this
  // part is one of those that make the image; rounds may have been decided by any that was there
  // before.
  bool MayBeFalse(const coordinator::FrameId& frame, bool in_rounds,
                  const std::set<std::string>& false_digests) const;
  // The name of a part of the frame that certainly is there, although it was made with another
  // guiding field than the one with this digest, or is another field. Empty: there is none. Parts
  // that are no longer believed do not count: a broken disk may remove them later.
  std::string PartOfOtherField(const coordinator::FrameId& frame, const std::string& field) const;
  // An identity that certainly has parts, although it is durable that it made false ones. Empty:
  // there is none.
  std::string LiarWithParts() const;
  // Whether it is durable that the identity made false parts.
  bool IsLiar(const std::string& identity) const;
  std::vector<std::string> Liars() const;

 private:
  struct PromisedPart {
    coordinator::PartRow row;
    bool certain = false;
  };
  enum class Trust { kTrusted, kQuarantined, kLiar };
  static Trust TrustOf(const coordinator::QuarantineRecord& record) {
    return record.made_false_results ? Trust::kLiar : Trust::kQuarantined;
  }
  // The part is gone.
  void Forget(const coordinator::PartRow& row);
  static std::string NameOf(const coordinator::PartKey& key);
  void CheckJob(const coordinator::StoredJob& job);

  std::function<void(const std::string&)> broken_;
  std::map<uint64_t, PromisedJob> jobs_;
  std::map<coordinator::FrameId, std::map<std::string, PromisedPart>> parts_;
  // Digests of parts that went while their identity was still trusted.
  std::map<coordinator::FrameId, std::set<std::string>> forgotten_;
  // The parts that were there when the frame was delivered: its image was made of them.
  std::map<coordinator::FrameId, std::vector<coordinator::PartRow>> image_parts_;
  std::set<std::string> stored_;  // Digests.
  std::map<std::string, Possibly<Trust>> identities_;
  std::string secret_;
  int64_t damaged_count_ = 0;
};

}  // namespace sheaf::sim
