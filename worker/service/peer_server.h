// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PeerServer: serves the blobs of this machine's cache to other workers of the farm.
#pragma once

#include <grpcpp/server.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "common/tls/credential_store.h"
#include "sheaf/v1/peer.grpc.pb.h"

namespace sheaf::worker {

inline constexpr int kPeerUploadsMax = 4;  // Served at once; more are refused.
// One upload may take so long.
inline constexpr absl::Duration kPeerUploadMax = absl::Hours(1);

struct PeerOptions {
  bool enabled = false;
  uint16_t port = 0;                     // 0: the system chooses.
  uint64_t bytes_per_second_max = 0;     // All uploads together; 0: no limit.
  std::optional<CredentialFiles> files;  // None: in plain text, on loopback alone.
};

// Thread safety: all members may be called concurrently.
class PeerServer final : public v1::PeerService::Service {
 public:
  // blobs must outlive the server. Errors: kUnavailable (the port is taken); those of files.
  static absl::StatusOr<std::unique_ptr<PeerServer>> Start(const PeerOptions& options,
                                                           const BlobStore* blobs);
  ~PeerServer() override;

  uint16_t port() const { return static_cast<uint16_t>(port_); }
  uint64_t served_bytes() const { return served_bytes_; }

  grpc::Status ReadPeerBlob(grpc::ServerContext* context, const v1::ReadBlobRequest* request,
                            grpc::ServerWriter<v1::ReadBlobResponse>* writer) override;

 private:
  PeerServer(const BlobStore* blobs, uint64_t bytes_per_second_max)
      : blobs_(blobs), bytes_per_second_max_(bytes_per_second_max) {}
  // Waits until `size_bytes` more bytes may be sent; false if the call was cancelled.
  bool WaitForTurn(grpc::ServerContext* context, uint64_t size_bytes);

  const BlobStore* const blobs_;
  const uint64_t bytes_per_second_max_;
  std::atomic<int> uploads_{0};
  std::atomic<uint64_t> served_bytes_{0};
  Mutex mutex_;
  SteadyTime next_send_ ABSL_GUARDED_BY(mutex_) = SteadyTime::InfinitePast();
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
};

}  // namespace sheaf::worker
