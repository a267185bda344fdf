// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Limits of a scheduler so small that a fuzzer runs thousands of them a second, and the steps that
// the farm does around a scheduler. Shared by the targets of messages.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/scheduling/scheduler.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::testing {

inline constexpr char kProfile[] = "profile";

inline coordinator::Limits SmallLimits() {
  coordinator::Limits limits;
  limits.tiles_per_frame_max = 1 << 10;
  limits.cells_per_frame_max = 1 << 12;
  limits.job_tasks_max = 1 << 20;
  return limits;
}

// Fills in what JobControl::Create does.
inline void CompleteSpec(uint64_t job_id, coordinator::JobSpec* spec) {
  spec->job_id = job_id;
  spec->numeric_profile = kProfile;
  std::sort(spec->frames.begin(), spec->frames.end(),
            [](const auto& a, const auto& b) { return a.frame_number < b.frame_number; });
  int32_t cell_size_px = spec->partition.cell_size_px;
  for (coordinator::FrameSpec& frame : spec->frames) {
    frame.frame_digest = FrameDigest(frame.scene.sha256_hex, frame.settings, kProfile);
    if (spec->partition.cell_size_px != 0) continue;
    cell_size_px = std::max(cell_size_px, coordinator::ChooseCellSize(
                                              frame.settings.window, spec->partition.tile_size_px));
  }
  spec->partition.cell_size_px = cell_size_px;
}

// A scheduler's answer with what the farm adds to it (Farm::Synchronize).
inline coordinator::Farm::SynchronizeAnswer AnswerOf(
    const coordinator::Scheduler& scheduler,
    const coordinator::Scheduler::SynchronizeAnswer& decided) {
  coordinator::Farm::SynchronizeAnswer answer;
  for (const coordinator::Lease& lease : decided.leases) {
    coordinator::FrameSpec frame = scheduler.FindFrame(lease.frame)->Spec();
    answer.leases.push_back(
        {lease, frame.frame_digest, frame.scene, frame.settings, std::string(32, 't')});
  }
  answer.next_synchronize = decided.next_synchronize;
  answer.lease_duration = SmallLimits().lease_duration;
  return answer;
}

}  // namespace sheaf::testing
