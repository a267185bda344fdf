// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ContentExchange: the chunks of stored blobs, the workers that hold blobs, and counts of
// transfers.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_index.h"
#include "coordinator/core/policy/peer_directory.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// The sources of the blobs of a worker's scenes, and their pages of volumes, since its start.
struct ContentCounts {
  uint64_t cache_blobs = 0, cache_bytes = 0;
  uint64_t peer_blobs = 0, peer_bytes = 0;
  uint64_t coordinator_blobs = 0, coordinator_bytes = 0;
  uint64_t served_bytes = 0;  // To other workers.
  uint64_t volume_pages_found = 0, volume_pages_read = 0, volume_read_bytes = 0;
  uint64_t volume_pages_evicted = 0, volume_part_bytes = 0;
  uint64_t volume_resident_bytes = 0;  // Now.
};

// A peer that did not give a blob.
struct PeerTroubleReport {
  std::string peer_id, blob;
  PeerTroubleKind kind = PeerTroubleKind::kUnreachable;
};

struct ContentReport {
  PeerContact worker;
  std::vector<std::string> held, fetching;
  std::vector<PeerTroubleReport> troubles;
  ContentCounts counts;
};

// Thread safety: all members may be called concurrently.
class ContentExchange {
 public:
  // blobs must outlive the object.
  explicit ContentExchange(const BlobStore* blobs);

  ChunkIndex& chunks() { return chunks_; }
  // Differs between starts of the coordinator.
  const std::string& directory_id() const { return directory_id_; }

  void Report(const ContentReport& report, SteadyTime now);
  PeerAnswer Locate(const std::string& blob, const std::string& worker_id, bool serves,
                    const std::set<std::string>& tried, SteadyTime now);

  // Count bytes of blobs that came from clients, that were found in stored blobs instead, and that
  // were sent to workers and others.
  void NoteReceived(uint64_t size_bytes) { received_bytes_ += size_bytes; }
  void NoteReused(uint64_t size_bytes) { reused_bytes_ += size_bytes; }
  void NoteSent(uint64_t size_bytes) { sent_bytes_ += size_bytes; }

  void AddMetrics(std::vector<MetricView>* metrics) const;

 private:
  // Adds a worker's transfers since its last report.
  void AddVolumeMetrics(std::vector<MetricView>* metrics) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void AddCounts(const std::string& worker_id, const ContentCounts& counts, SteadyTime now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  struct LastCounts {
    ContentCounts counts;
    SteadyTime time;
  };

  ChunkIndex chunks_;
  const std::string directory_id_;
  std::atomic<uint64_t> received_bytes_{0}, reused_bytes_{0}, sent_bytes_{0};
  mutable Mutex mutex_;
  PeerDirectory directory_ ABSL_GUARDED_BY(mutex_);
  // By worker_id; at most kDirectoryWorkersMax.
  std::map<std::string, LastCounts> last_ ABSL_GUARDED_BY(mutex_);
  ContentCounts sums_ ABSL_GUARDED_BY(mutex_);
  std::array<uint64_t, kPeerTroubleKindCount> troubles_ ABSL_GUARDED_BY(mutex_){};
};

}  // namespace sheaf::coordinator
