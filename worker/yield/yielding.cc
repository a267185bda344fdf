// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/yield/yielding.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/memory_room.h"

namespace sheaf::worker {

std::string Yielding::Reason(SteadyTime now, const MachineReading& reading, uint64_t scene_bytes) {
  if (options_.processors_max && reading.processor_seconds) {
    const std::optional<double> used = processor_use_.Add(now, *reading.processor_seconds);
    if (used && *used > *options_.processors_max) {
      return absl::StrFormat("other programs use %.1f processors (--yield-load %g)", *used,
                             *options_.processors_max);
    }
  }
  if (options_.memory_available_min > 0 && reading.memory_available) {
    if (away_.empty()) bytes_to_come_back_ = scene_bytes;
    // The memory of its present scenes will be free.
    const uint64_t missing = bytes_to_come_back_ - std::min(scene_bytes, bytes_to_come_back_);
    if (*reading.memory_available < options_.memory_available_min + missing) {
      return absl::StrCat(FormatMemory(*reading.memory_available),
                          " of memory are available (--yield-memory ",
                          FormatMemory(options_.memory_available_min), ")");
    }
  }
  return "";
}

std::string Yielding::WhyAway(SteadyTime now, absl::CivilMinute local,
                              const MachineReading& reading, uint64_t scene_bytes) {
  // Read in any case, so that the load is known when the hours begin.
  const std::string reason = Reason(now, reading, scene_bytes);
  if (!reason.empty()) {
    away_ = reason;
    last_reason_ = now;
  } else if (now - last_reason_ >= options_.calm) {
    away_.clear();
  }
  if (!options_.hours.Contains(local)) return "outside its hours (--hours)";
  return away_;
}

}  // namespace sheaf::worker
