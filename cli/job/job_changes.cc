// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/job_changes.h"

#include <algorithm>
#include <set>
#include <utility>

namespace sheaf::cli {

void MergeChanges(v1::Job message, v1::Job* job) {
  if (!message.frames_are_changes()) {
    *job = std::move(message);
    return;
  }
  message.set_frames_are_changes(false);
  message.mutable_frames()->Swap(job->mutable_frames());  // Now job has the changed ones.
  message.mutable_troubles()->Swap(job->mutable_troubles());
  const auto number_of = [](const v1::Frame& frame) { return frame.spec().frame_number(); };
  std::set<int32_t> changed;
  for (v1::Frame& frame : *job->mutable_frames()) {
    const int32_t number = number_of(frame);
    changed.insert(number);
    auto* known = message.mutable_frames();
    const auto place = std::ranges::lower_bound(*known, number, {}, number_of);
    if (place != known->end() && number_of(*place) == number) place->Swap(&frame);
  }
  auto* troubles = message.mutable_troubles();
  troubles->erase(std::remove_if(troubles->begin(), troubles->end(),
                                 [&](const v1::FrameTrouble& trouble) {
                                   return changed.contains(trouble.frame_number());
                                 }),
                  troubles->end());
  troubles->MergeFrom(job->troubles());
  std::sort(troubles->begin(), troubles->end(),
            [](const auto& a, const auto& b) { return a.frame_number() < b.frame_number(); });
  *job = std::move(message);
}

}  // namespace sheaf::cli
