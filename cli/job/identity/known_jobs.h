// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// KnownJobs: the jobs that a client has seen, by name. A coordinator whose state was replaced
// reuses numbers; a job is the same only if it was created at the same time.
#pragma once

#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// Thread safety: all members may be called concurrently.
class KnownJobs {
 public:
  // Records a job that was created for this client.
  void Note(const v1::Job& job);
  // Records a job that is seen for the first time. Errors: kNotFound if its name was another job's.
  absl::Status Check(const v1::Job& job);
  bool Has(const std::string& name) const;

 private:
  mutable Mutex mutex_;
  std::map<std::string, absl::Time> create_times_ ABSL_GUARDED_BY(mutex_);  // By name.
};

}  // namespace sheaf::cli
