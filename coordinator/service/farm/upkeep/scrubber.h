// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scrubber: repeatedly reads stored data at a low rate and compares it with its digests, so that
// disk errors are found while they can be repaired: files of scenes, parts of delivered frames, and
// delivered images. (Parts of other frames are compared when their tiles are built from them.)
// Damage is repaired as if it were found on use ([ADR
// 47](docs/adr/0047-files-are-looked-at-again.md)): the next client that submits a blob sends it
// again, parts are rendered again, images are made again.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "coordinator/service/farm/delivery/delivered_images.h"
#include "coordinator/service/farm/jobs/job_continuation.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/part_removals.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Thread safety: AddMetrics may be called from any thread, the rest by one at a time.
class Scrubber {
 public:
  // The objects that it works on; all must outlive it.
  struct Parts {
    FarmTables& tables;
    JobStore& store;
    const BlobStore& blobs;
    const DeliveredImages& images;
    JobContinuation& jobs;
    PartRemovals& removals;
  };
  // bytes_per_second: on average; each file is read in one go. Requires: it is not 0.
  Scrubber(uint64_t bytes_per_second, const Parts& parts)
      : bytes_per_second_(bytes_per_second), parts_(parts) {}

  // One pass after the other, until the stop.
  void Run(const std::stop_token& stop);
  // Compares everything once, as fast as the rate allows. Returns false if it was stopped.
  bool Pass(const std::stop_token& stop);
  // Checks which of the damaged items are whole again.
  void LookAgain();

  void AddMetrics(std::vector<MetricView>* metrics) const;

 private:
  enum class Kind { kBlob, kPart, kImage };
  static constexpr size_t kKindCount = 3;
  static const char* KindName(Kind kind);
  // The present state of an item that was damaged.
  enum class State { kDamaged, kWhole, kGone };

  // Delivered frames, by job.
  struct Frames {
    std::set<int32_t> delivered;
    bool is_remade = false;  // Its job has succeeded and is not a pilot: frames are remade.
  };
  Frames FramesOf(uint64_t job_id) const;
  bool PassJob(uint64_t job_id, const std::stop_token& stop);
  // Compares the object of a blob whose file is whole.
  void ScrubObject(const BlobDigest& digest);
  void ScrubPart(const PartRow& row, bool is_remade);
  // Counts the bytes and waits as long as the rate requires. Returns false if it was stopped.
  bool Pace(uint64_t bytes, const std::stop_token& stop);
  // now: returns its present state; polled until it is no longer damaged.
  void NoteDamage(Kind kind, const std::string& name, std::function<State()> now);
  State StateOfPart(const PartRow& row) const;
  State StateOfImage(const FrameId& id) const;

  const uint64_t bytes_per_second_;
  const Parts parts_;
  std::map<std::pair<Kind, std::string>, std::function<State()>> damaged_;
  SteadyTime next_look_ = SteadyTime::InfinitePast();

  mutable Mutex mutex_;
  uint64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::array<uint64_t, kKindCount> damaged_count_ ABSL_GUARDED_BY(mutex_){};
  std::array<uint64_t, kKindCount> repaired_count_ ABSL_GUARDED_BY(mutex_){};
  absl::Time last_pass_ ABSL_GUARDED_BY(mutex_) = absl::UnixEpoch();  // Last complete one.
};

}  // namespace sheaf::coordinator
