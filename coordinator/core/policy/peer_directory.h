// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PeerDirectory: the blobs that workers hold, and where the next worker should fetch a blob. One
// worker fetches a blob that no worker holds from the coordinator, while the others wait for it:
// the coordinator sends it about once, however many workers need it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/time/time.h"
#include "common/base/steady_time.h"

namespace sheaf::coordinator {

inline constexpr size_t kPeersAnsweredMax = 3;    // In one answer.
inline constexpr size_t kHoldersPerBlobMax = 64;  // Others are not remembered.
inline constexpr size_t kDirectoryBlobsMax = 1 << 20;
inline constexpr size_t kDirectoryWorkersMax = 10'000;
// A worker that has not reported for this long is not used.
inline constexpr absl::Duration kPeerSilenceMax = absl::Seconds(30);
// How long others wait for a worker that fetches a blob but reports no progress.
inline constexpr absl::Duration kFetchSilenceMax = absl::Seconds(10);
// A peer that this many workers accuse of wrong bytes is not used for a time.
inline constexpr size_t kAccusersMax = 3;
inline constexpr absl::Duration kShunnedTime = absl::Hours(1);

// Where a worker serves its blobs.
struct PeerContact {
  std::string worker_id;
  std::string address;   // "host:port"; empty: it serves none.
  std::string identity;  // Its certificate's common name; empty without certificates.
  friend bool operator==(const PeerContact&, const PeerContact&) = default;
};

enum class PeerTroubleKind { kUnreachable, kRefused, kWrongBytes, kMissing };
inline constexpr size_t kPeerTroubleKindCount = 4;
// Returns "unreachable", "refused", "wrong_bytes" or "missing".
const char* PeerTroubleKindName(PeerTroubleKind kind);

// Where to fetch a blob. Neither peers nor from_coordinator: ask again later.
struct PeerAnswer {
  std::vector<PeerContact> peers;
  bool from_coordinator = false;
};

// Blobs are named by their SHA-256 in hexadecimal. Thread safety: none.
class PeerDirectory {
 public:
  // A worker holds these blobs, in addition to those it reported before, and fetches those from the
  // coordinator.
  void Report(const PeerContact& worker, const std::vector<std::string>& held,
              const std::vector<std::string>& fetching, SteadyTime now);
  // tried: peers that did not give it. serves: whether the worker will serve it once it has it; if
  // not, no worker waits for it.
  PeerAnswer Locate(const std::string& blob, const std::string& worker_id, bool serves,
                    const std::set<std::string>& tried, SteadyTime now);
  // The accuser reports that the peer did not give the blob. Unless the peer was busy, it is not
  // used for the blob again until it reports that it holds it.
  void NoteTrouble(const std::string& peer_id, const std::string& blob, PeerTroubleKind kind,
                   const std::string& accuser, SteadyTime now);

  // The workers that serve now.
  size_t CountServing(SteadyTime now) const;
  size_t blob_count() const { return blobs_.size(); }

 private:
  struct Worker {
    PeerContact contact;
    SteadyTime last_seen;
    uint64_t offer_count = 0;  // How often it was the first peer of an answer.
    std::set<std::string> accusers;
    SteadyTime shunned_until = SteadyTime::InfinitePast();
  };
  struct Fetch {
    std::string worker_id;
    SteadyTime last_seen;
  };
  struct Blob {
    std::vector<std::string> holders;  // The latest last.
    std::optional<Fetch> fetch;        // The worker that fetches it from the coordinator.
  };
  bool Serves(const Worker& worker, SteadyTime now) const;
  void ForgetSilentWorkers(SteadyTime now);

  std::map<std::string, Worker> workers_;
  std::unordered_map<std::string, Blob> blobs_;
};

}  // namespace sheaf::coordinator
