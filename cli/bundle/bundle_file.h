// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BundleWriter and Bundle: a task with all inputs for rendering it again, in one file (README.md).
// The file is untrusted: all of it is checked before use.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/digest.h"
#include "common/content/content_cache.h"
#include "common/content/manifest.h"
#include "common/content/tar_file.h"
#include "sheaf/v1/job.pb.h"
#include "worker/agent/work.h"

namespace sheaf::cli {

inline constexpr int kBundleFormat = 1;
inline constexpr uint64_t kTaskJsonBytesMax = uint64_t{4} << 20;
// The files of a scene, its manifest, a guiding field, task.json and SHA256SUMS.
inline constexpr size_t kBundleFilesMax = kManifestFilesMax + 4;

// Writes what ReadTaskBundle sends. The file gets its name when Finish returns OK; otherwise it is
// removed. Thread safety: one thread at a time.
class BundleWriter {
 public:
  // version: Sheaf's, for readers of the bundle.
  BundleWriter(std::string path, std::string version);
  ~BundleWriter();
  BundleWriter(const BundleWriter&) = delete;
  BundleWriter& operator=(const BundleWriter&) = delete;

  // A message with a task restarts the file. Errors: those of the disk; kDataLoss if bytes do not
  // match their digest, or messages are out of order; kInvalidArgument (a file is too large).
  absl::Status Take(const v1::ReadTaskBundleResponse& message);
  // Errors: those of Take.
  absl::Status Finish();
  // The task of the last start.
  const v1::TaskBundle& task() const { return task_; }
  uint64_t size_bytes() const { return size_bytes_; }

 private:
  absl::Status Begin(const v1::TaskBundle& task);
  absl::Status EndFile();

  const std::string path_, partial_path_, version_;
  v1::TaskBundle task_;
  std::unique_ptr<TarWriter> tar_;
  std::string sums_;
  BlobDigest file_;  // The file being written; empty if none.
  std::unique_ptr<Sha256> hash_;
  uint64_t size_bytes_ = 0;
};

// A bundle whose digests match. Thread safety: one thread at a time.
class Bundle {
 public:
  // Reads all of it once. read: reads at offsets of the file, as in OpenForReading.
  // Errors: kDataLoss (truncated, altered, or not a bundle), kInvalidArgument (not a valid task of
  // a worker), kUnimplemented (another format), kResourceExhausted (too large); those of read.
  static absl::StatusOr<Bundle> Open(ReadBytesAt read, uint64_t size_bytes);

  const v1::TaskBundle& task() const { return task_; }
  // The task in the form that a worker gets.
  const worker::Lease& lease() const { return lease_; }
  const Manifest& manifest() const { return manifest_; }
  // For ContentCache::Acquire of the manifest's files; must not outlive the bundle.
  ContentCache::Fetch Fetcher() const;
  // The guiding field; empty if the task needs none.
  absl::StatusOr<std::string> ReadField() const;

 private:
  explicit Bundle(ReadBytesAt read) : read_(std::move(read)) {}
  // Compares all digests.
  absl::Status Verify(const std::vector<TarEntry>& entries);
  absl::Status ReadTask(const TarEntry& entry);
  absl::Status ReadManifest();
  // Errors: kDataLoss if there is no such file.
  absl::StatusOr<TarEntry> Find(const BlobDigest& digest, const std::string& what) const;

  ReadBytesAt read_;
  std::map<std::string, TarEntry> files_;  // By digest.
  v1::TaskBundle task_;
  worker::Lease lease_;
  Manifest manifest_;
};

}  // namespace sheaf::cli
