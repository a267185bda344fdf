// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/result_outbox.h"

#include <utility>

#include "common/base/check.h"

namespace sheaf::worker {

void ResultOutbox::Push(FinishedPart part) {
  size_bytes_ += part.exr_bytes.size();
  parts_.push_back(std::move(part));
}

std::vector<const FinishedPart*> ResultOutbox::Front(size_t part_count_max) const {
  std::vector<const FinishedPart*> front;
  for (auto it = parts_.begin(); it != parts_.end() && front.size() < part_count_max; ++it) {
    front.push_back(&*it);
  }
  return front;
}

void ResultOutbox::Pop() {
  SHEAF_CHECK(!parts_.empty());
  size_bytes_ -= parts_.front().exr_bytes.size();
  parts_.pop_front();
}

}  // namespace sheaf::worker
