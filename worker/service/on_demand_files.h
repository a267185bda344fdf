// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OnDemandFiles: the files of a scene that are fetched when a task first reads them, into the
// content cache like all others. They stay pinned there for the lifetime of the object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/content/content_cache.h"
#include "common/content/manifest.h"
#include "common/volume/file_bytes.h"
#include "worker/service/blob_fetcher.h"
#include "worker/service/peer_exchange.h"

namespace sheaf::worker {

// All attempts to fetch a file begin within this time, and as often its bytes may be wrong.
inline constexpr absl::Duration kOnDemandFetchMax = absl::Minutes(3);
inline constexpr int kWrongBytesMax = 3;

// Thread safety: all members may be called concurrently.
class OnDemandFiles {
 public:
  // cache, fetcher and exchange must outlive the object. exchange: null where nothing is counted.
  OnDemandFiles(const std::vector<ManifestFile>& files, ContentCache* cache, BlobFetcher* fetcher,
                PeerExchange* exchange);

  // Fetches the file if it is not there, and opens it. Errors: kNotFound for a name that is not
  // among the files; kCancelled after a request to stop; others if it cannot be fetched.
  absl::StatusOr<volume::FileBytes> Open(const std::string& name, const std::stop_token& stop);

  bool empty() const { return files_.empty(); }
  uint64_t size_bytes() const;
  // Whether all files that were asked for came, and are unchanged since. Errors: kDataLoss: what
  // was rendered since cannot be trusted, and the scene must be loaded again.
  absl::Status Check() const;

 private:
  absl::StatusOr<ContentLease> Fetch(const ManifestFile& file, const std::stop_token& stop);

  std::map<std::string, ManifestFile> files_;  // By name.
  ContentCache* const cache_;
  BlobFetcher* const fetcher_;
  PeerExchange* const exchange_;
  mutable Mutex mutex_;
  std::vector<ContentLease> leases_ ABSL_GUARDED_BY(mutex_);
  absl::Status failed_ ABSL_GUARDED_BY(mutex_);  // The first failure.
};

}  // namespace sheaf::worker
