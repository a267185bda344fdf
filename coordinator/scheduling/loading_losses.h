// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LoadingLosses: workers that vanished one after the other while they loaded a scene. A scene that
// needs more memory than a worker has ends the worker, and then the next one; machines that are
// switched off vanish too, but many at once. So a loss counts only if its lease was granted after
// the previously counted worker was certainly gone.
#pragma once

#include <string>

#include "absl/container/btree_set.h"
#include "common/base/steady_time.h"

namespace sheaf::coordinator {

class LoadingLosses {
 public:
  // A worker vanished while it loaded the scene under a lease granted at grant_time; it was gone by
  // gone_time. Returns whether the loss counts.
  bool Add(const std::string& worker_id, SteadyTime grant_time, SteadyTime gone_time);
  // The next loss counts whenever its lease was granted: a restart resets the steady clock.
  void ForgetTime() { last_gone_time_ = SteadyTime::InfinitePast(); }
  // A worker has loaded the scene, so it fits.
  void Clear();

  int count() const { return static_cast<int>(workers_.size()); }
  const absl::btree_set<std::string>& workers() const { return workers_; }

 private:
  absl::btree_set<std::string> workers_;
  SteadyTime last_gone_time_ = SteadyTime::InfinitePast();
};

}  // namespace sheaf::coordinator
