// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LoadFetches: the fetches of one load, for a ContentCache and a BlobFetcher.
#pragma once

#include <set>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "common/content/content_cache.h"
#include "worker/service/blob_fetcher.h"
#include "worker/service/peer_exchange.h"

namespace sheaf::worker {

// Counts the blobs that were in the cache, and reports those that are now. Not thread-safe.
class LoadFetches {
 public:
  LoadFetches(BlobFetcher* fetcher, PeerExchange* exchange, std::stop_token stop)
      : fetcher_(fetcher), exchange_(exchange), stop_(std::move(stop)) {}

  ContentCache::Fetch AsFetch() {
    return
        [this](const BlobDigest& blob, uint64_t offset_bytes, const ContentCache::Append& append) {
          NoteFetched();  // The next blob is asked for once the one before is complete.
          fetched_.insert(blob.sha256_hex);
          fetching_ = blob;
          return fetcher_->Fetch(blob, offset_bytes, append, stop_);
        };
  }
  // The files are all in the cache.
  void NoteAcquired(const std::vector<ManifestFile>& files) {
    NoteFetched();
    if (exchange_ == nullptr) return;
    std::set<std::string> seen;
    for (const ManifestFile& file : files) {
      const BlobDigest& blob = file.digest;
      if (!seen.insert(blob.sha256_hex).second || fetched_.contains(blob.sha256_hex)) continue;
      exchange_->CountBlob(BlobSource::kCache);
      exchange_->CountBytes(BlobSource::kCache, blob.size_bytes);
      // Another worker of this machine may have fetched it.
      exchange_->NoteHeld(blob, /*is_new=*/false);
    }
  }

 private:
  void NoteFetched() {
    if (exchange_ != nullptr && !fetching_.sha256_hex.empty())
      exchange_->NoteHeld(fetching_, /*is_new=*/true);
    fetching_ = {};
  }

  BlobFetcher* const fetcher_;
  PeerExchange* const exchange_;
  const std::stop_token stop_;
  std::set<std::string> fetched_;
  BlobDigest fetching_;
};

}  // namespace sheaf::worker
