// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BlobFetcher: fetches blobs from other workers that hold them, and from the coordinator on any
// trouble with these. The bytes of a peer are compared with digests that the coordinator states
// before they are taken: a peer that lies costs a retry.
#pragma once

#include <grpcpp/channel.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stop_token>

#include "absl/status/status.h"
#include "common/content/chunk_list.h"
#include "common/content/content_cache.h"
#include "sheaf/v1/content.grpc.pb.h"
#include "worker/service/peer_exchange.h"

namespace sheaf::worker {

inline constexpr size_t kPeersTriedMax = 6;  // For one blob.
inline constexpr absl::Duration kPeerConnectMax = absl::Seconds(2);
// One attempt may take this long, and a second more for each kPeerBytesPerSecondMin bytes.
inline constexpr absl::Duration kPeerAttemptMin = absl::Seconds(10);
inline constexpr uint64_t kPeerBytesPerSecondMin = uint64_t{4} << 20;
// How long to wait for another worker that fetches the blob from the coordinator.
inline constexpr absl::Duration kPeerWaitMax = absl::Minutes(2);

// Thread safety: all members may be called concurrently.
class BlobFetcher {
 public:
  // exchange must outlive the object; null: all blobs come from the coordinator, uncounted.
  BlobFetcher(const std::shared_ptr<grpc::Channel>& coordinator, PeerExchange* exchange)
      : stub_(v1::ContentService::NewStub(coordinator)), exchange_(exchange) {}

  // As ContentCache::Fetch.
  absl::Status Fetch(const BlobDigest& blob, uint64_t offset_bytes,
                     const ContentCache::Append& append, const std::stop_token& stop);

 private:
  // Where a fetch stands.
  struct Progress {
    const BlobDigest& blob;
    const ContentCache::Append& append;
    const std::stop_token& stop;
    uint64_t offset_bytes = 0;  // Bytes that are there.
    absl::Status own = {};      // An error of append: no peer's fault.
  };
  // Whether the blob is complete, or cannot be completed by anybody (then `own` says why).
  bool FetchFromPeers(Progress* progress);
  // OK once the blob is complete; *kind says what is wrong with the peer otherwise.
  absl::Status FetchFromPeer(const v1::Peer& peer, const ChunkList& list, Progress* progress,
                             v1::PeerTrouble::Kind* kind);
  absl::Status FetchFromCoordinator(Progress* progress);

  const std::unique_ptr<v1::ContentService::Stub> stub_;
  PeerExchange* const exchange_;
};

}  // namespace sheaf::worker
