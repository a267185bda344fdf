// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/on_demand_files.h"

#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"
#include "common/rpc/retry.h"
#include "worker/service/load_fetches.h"

namespace sheaf::worker {

OnDemandFiles::OnDemandFiles(const std::vector<ManifestFile>& files, ContentCache* cache,
                             BlobFetcher* fetcher, PeerExchange* exchange)
    : cache_(cache), fetcher_(fetcher), exchange_(exchange) {
  for (const ManifestFile& file : files) files_.emplace(file.name, file);
}

uint64_t OnDemandFiles::size_bytes() const {
  uint64_t bytes = 0;
  for (const auto& [name, file] : files_) bytes += file.digest.size_bytes;
  return bytes;
}

absl::StatusOr<ContentLease> OnDemandFiles::Fetch(const ManifestFile& file,
                                                  const std::stop_token& stop) {
  const std::vector<ManifestFile> files = {file};
  std::optional<absl::StatusOr<ContentLease>> lease;
  int wrong = 0;
  const auto fetch = [&]() -> absl::Status {
    LoadFetches fetches(fetcher_, exchange_, stop);
    lease.emplace(cache_->Acquire(files, fetches.AsFetch(), stop));
    const absl::Status acquired = lease->status();
    if (acquired.ok()) fetches.NoteAcquired(files);
    if (absl::IsDataLoss(acquired) && ++wrong < kWrongBytesMax) {
      return absl::UnavailableError(acquired.message());  // They are fetched again.
    }
    return acquired;
  };
  RetryEnvironment environment = SystemRetryEnvironment();
  environment.sleep = [&stop](absl::Duration wait) { return SleepUnlessStopped(wait, stop); };
  const absl::Status status =
      RetryLoop({.elapsed_max = kOnDemandFetchMax}, Idempotency::kIdempotent, environment, fetch);
  if (stop.stop_requested()) return absl::CancelledError("stopped while a file was fetched");
  if (!status.ok()) return Annotate(status, absl::StrCat("fetching ", file.name));
  return *std::move(lease);
}

absl::StatusOr<volume::FileBytes> OnDemandFiles::Open(const std::string& name,
                                                      const std::stop_token& stop) {
  const auto found = files_.find(name);
  if (found == files_.end()) {
    return absl::NotFoundError(absl::StrCat("file \"", name, "\" is not among those of the scene"));
  }
  absl::StatusOr<ContentLease> lease = Fetch(found->second, stop);
  absl::StatusOr<volume::FileBytes> file =
      lease.ok() ? volume::FileBytes::Open(name, lease->local_paths().at(name))
                 : absl::StatusOr<volume::FileBytes>(lease.status());
  if (file.ok() && exchange_ != nullptr) exchange_->CountPart(file->size());
  const MutexLock lock(&mutex_);
  if (lease.ok()) leases_.push_back(*std::move(lease));
  if (!file.ok() && failed_.ok()) failed_ = file.status();
  return file;
}

absl::Status OnDemandFiles::Check() const {
  const MutexLock lock(&mutex_);
  if (!failed_.ok()) return absl::DataLossError(failed_.message());
  for (const ContentLease& lease : leases_) {
    if (absl::Status status = cache_->CheckUnchanged(lease); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace sheaf::worker
