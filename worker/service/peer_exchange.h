// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PeerExchange: this worker among the others. It serves the blobs of its cache, tells the
// coordinator what it holds and where its blobs came from, and asks it who else holds one.
#pragma once

#include <grpcpp/channel.h>

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/blob_store.h"
#include "common/volume/volume_pages.h"
#include "sheaf/v1/transfer.grpc.pb.h"
#include "worker/service/peer_server.h"

namespace sheaf::worker {

// How often it reports without news, and least time between two reports.
inline constexpr absl::Duration kReportInterval = absl::Seconds(2);
inline constexpr absl::Duration kReportSpacing = absl::Milliseconds(50);
// Smaller blobs are fetched from the coordinator: asking who has them would cost as much.
inline constexpr uint64_t kPeerBlobBytesMin = uint64_t{16} << 10;
inline constexpr size_t kHeldBlobsMax = 100'000;  // Reported.
inline constexpr size_t kHeldPerReportMax = 10'000;
inline constexpr size_t kTroublesKeptMax = 1000;
inline constexpr size_t kPeerChannelsMax = 64;  // Open at once.

enum class BlobSource { kCache, kPeer, kCoordinator };

// Thread safety: all members may be called concurrently.
class PeerExchange {
 public:
  // Serves where options say so; if it cannot, it says why in the log and asks others all the same.
  // blobs must outlive the object. coordinator: for calls that take no time.
  PeerExchange(const std::shared_ptr<grpc::Channel>& coordinator, std::string worker_id,
               const PeerOptions& options, const BlobStore* blobs);
  ~PeerExchange();

  bool asks_peers() const { return options_.enabled; }

  // Where to fetch a blob. tried: worker ids of peers that did not give it. Errors: those of the
  // call.
  absl::StatusOr<v1::LocateBlobResponse> Locate(const BlobDigest& blob,
                                                const std::vector<std::string>& tried,
                                                const std::stop_token& stop);
  // Errors: those of reading the certificates.
  absl::StatusOr<std::shared_ptr<grpc::Channel>> ChannelTo(const v1::Peer& peer);

  // The blob is complete in the cache. is_new: it is since now, so others may have been told that
  // it was missing.
  void NoteHeld(const BlobDigest& blob, bool is_new);
  // The blob is being fetched from the coordinator, or no longer.
  void NoteFetching(const BlobDigest& blob, bool is_fetching);
  void NoteTrouble(const std::string& peer_id, const BlobDigest& blob, v1::PeerTrouble::Kind kind);
  // Counts a blob of a scene by where it came from.
  void CountBlob(BlobSource source);
  void CountBytes(BlobSource source, uint64_t size_bytes);
  // Counts what a scene did with pages of volumes. resident_bytes: what it has in memory now.
  void CountPages(const volume::PageCounts& pages, uint64_t resident_bytes);
  // Counts a part of a page file that a scene opened.
  void CountPart(uint64_t size_bytes);

 private:
  void Run(const std::stop_token& stop);
  // Makes one report; false if it was not answered.
  bool Report(absl::Duration deadline);
  v1::ReportContentRequest TakeReport() ABSL_LOCKS_EXCLUDED(mutex_);

  const std::string worker_id_;
  const PeerOptions options_;
  const std::unique_ptr<v1::TransferService::Stub> stub_;
  std::unique_ptr<PeerServer> server_;  // Null where it serves no peer.

  Mutex mutex_;
  CondVar news_;
  std::set<std::string> held_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> unreported_ ABSL_GUARDED_BY(mutex_);  // Those of held_ not yet reported.
  std::multiset<std::string> fetching_ ABSL_GUARDED_BY(mutex_);
  std::vector<v1::PeerTrouble> troubles_ ABSL_GUARDED_BY(mutex_);  // At most kTroublesKeptMax.
  v1::ContentCounts counts_ ABSL_GUARDED_BY(mutex_);
  std::string directory_id_ ABSL_GUARDED_BY(mutex_);
  // By identity and address.
  std::map<std::string, std::shared_ptr<grpc::Channel>> channels_ ABSL_GUARDED_BY(mutex_);
  std::jthread reporter_;
};

}  // namespace sheaf::worker
