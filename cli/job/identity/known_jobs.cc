// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/known_jobs.h"

#include "absl/strings/str_cat.h"

namespace sheaf::cli {
namespace {

absl::Time CreateTime(const v1::Job& job) {
  return absl::FromUnixSeconds(job.create_time().seconds()) +
         absl::Nanoseconds(job.create_time().nanos());
}

}  // namespace

void KnownJobs::Note(const v1::Job& job) {
  const MutexLock lock(&mutex_);
  create_times_[job.name()] = CreateTime(job);
}

absl::Status KnownJobs::Check(const v1::Job& job) {
  const MutexLock lock(&mutex_);
  const absl::Time created = CreateTime(job);
  const auto [known, is_new] = create_times_.emplace(job.name(), created);
  if (is_new || known->second == created) return absl::OkStatus();
  return absl::NotFoundError(
      absl::StrCat(job.name(), ": is another job now, created at ", absl::FormatTime(created),
                   ", since the coordinator's state was replaced; the one of ",
                   absl::FormatTime(known->second), " is no longer there: submit it again"));
}

bool KnownJobs::Has(const std::string& name) const {
  const MutexLock lock(&mutex_);
  return create_times_.contains(name);
}

}  // namespace sheaf::cli
