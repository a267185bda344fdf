// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// UploadMissing: small blobs in batches, large ones by chunks, several uploads at once. A
// coordinator in this process gets no messages: its store is written.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/job/blob_reader.h"
#include "cli/job/follow_job.h"
#include "cli/job/identity/digest_memory.h"
#include "cli/job/summary.h"
#include "cli/progress_line.h"
#include "common/base/first_error.h"
#include "common/base/load_phases.h"
#include "common/base/mutex.h"
#include "common/content/blob_batch.h"

namespace sheaf::cli {
namespace {

constexpr size_t kUploadsMax = 4;                  // Concurrent, to hide the latency of many files.
constexpr std::chrono::seconds kUploadSilence{2};  // A shorter upload shows no progress.

// Shows the number of bytes sent so far.
class UploadProgress {
 public:
  explicit UploadProgress(uint64_t total_bytes)
      : total_bytes_(std::max<uint64_t>(total_bytes, 1)) {}
  void Add(uint64_t size_bytes) {
    const MutexLock lock(&mutex_);
    sent_bytes_ += size_bytes;
    const double fraction =
        std::min(1.0, static_cast<double>(sent_bytes_) / static_cast<double>(total_bytes_));
    line_.Show("uploading", fraction,
               absl::StrFormat("%.0f %% of %sB", 100 * fraction,
                               FormatCount(static_cast<double>(total_bytes_))));
  }

 private:
  Mutex mutex_;
  ProgressLine line_ ABSL_GUARDED_BY(mutex_){kUploadSilence};
  const uint64_t total_bytes_;
  uint64_t sent_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

// Blobs of one call: several small ones, or one.
using UploadGroup = std::vector<const BlobSource*>;

std::vector<UploadGroup> GroupBlobs(const PreparedJob& job,
                                    const std::vector<BlobDigest>& missing) {
  std::vector<UploadGroup> groups;
  UploadGroup small;
  uint64_t small_bytes = 0;
  for (const BlobDigest& digest : missing) {
    const BlobSource& blob = job.blobs.at(digest.sha256_hex);
    if (digest.size_bytes > kSmallBlobBytesMax) {
      groups.push_back({&blob});
      continue;
    }
    if (small.size() == kSmallBlobsMax || small_bytes + digest.size_bytes > kSmallBlobsBytesMax) {
      groups.push_back(std::exchange(small, {}));
      small_bytes = 0;
    }
    small.push_back(&blob);
    small_bytes += digest.size_bytes;
  }
  if (!small.empty()) groups.push_back(std::move(small));
  return groups;
}

absl::Status StoreAll(const BlobStore& store, const UploadGroup& group,
                      const std::function<void(uint64_t)>& on_progress) {
  for (const BlobSource* blob : group) {
    if (absl::Status status = StoreBlob(store, *blob); !status.ok()) return status;
    on_progress(blob->digest.size_bytes);
  }
  return absl::OkStatus();
}

absl::Status UploadOne(FarmClient* client, const BlobStore* own, const UploadGroup& group,
                       const std::function<void(uint64_t)>& on_progress) {
  if (own != nullptr) return StoreAll(*own, group, on_progress);
  const uint64_t size_bytes = group.front()->digest.size_bytes;
  if (size_bytes > kUnchunkedBytesMax) return client->UploadByChunks(*group.front(), on_progress);
  if (size_bytes > kSmallBlobBytesMax) return client->Upload(*group.front(), on_progress);
  return client->UploadSmall(group, on_progress);
}

}  // namespace

absl::Status StoreBlob(const BlobStore& store, const BlobSource& blob) {
  const PhaseTimer timer(LoadPhase::kStore);
  absl::StatusOr<BlobWriter> writer = store.BeginWrite(blob.digest, 0);
  if (absl::IsAlreadyExists(writer.status())) return absl::OkStatus();
  if (!writer.ok()) return writer.status();
  BlobReader reader(blob, 0);
  while (!reader.AtEnd()) {
    const absl::StatusOr<std::string> bytes = reader.Next();
    absl::Status status = bytes.ok() ? writer->Append(*bytes) : bytes.status();
    if (!status.ok()) return status;
  }
  const absl::Status status = writer->Commit();
  return absl::IsInvalidArgument(status) ? ChangedError(blob.path) : status;
}

absl::Status UploadMissing(FarmClient* client, const PreparedJob& job, const BlobStore* own) {
  std::vector<BlobDigest> digests;
  for (const auto& [hex, blob] : job.blobs) digests.push_back(blob.digest);
  const absl::StatusOr<std::vector<BlobDigest>> missing = client->FindMissing(digests);
  if (!missing.ok()) return missing.status();
  if (missing->empty()) return absl::OkStatus();
  uint64_t total_bytes = 0;
  for (const BlobDigest& digest : *missing) total_bytes += digest.size_bytes;
  UploadProgress progress(total_bytes);
  const std::vector<UploadGroup> groups = GroupBlobs(job, *missing);
  std::atomic<size_t> next{0};
  FirstError first_error;
  {
    std::vector<std::jthread> uploads;
    for (size_t t = 0; t < std::min(kUploadsMax, groups.size()); ++t) {
      uploads.emplace_back([&] {
        for (size_t i = next++; i < groups.size(); i = next++) {
          const absl::Status status = UploadOne(
              client, own, groups[i], [&](uint64_t size_bytes) { progress.Add(size_bytes); });
          if (status.ok()) continue;
          first_error.Update(status);
          next = groups.size();
        }
      });
    }
  }
  absl::Status status = first_error.Get();
  // A file does not match its remembered digest: all are hashed again next time.
  if (absl::IsFailedPrecondition(status)) ::unlink(DigestMemory::DefaultPath().c_str());
  return status;
}

}  // namespace sheaf::cli
