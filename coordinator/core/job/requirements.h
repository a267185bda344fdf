// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requirements: the workers that a job may use; WorkerTraits: the matching properties that a worker
// reports. The instruction set is not among them: it is in the numeric profile, which job and
// worker always share.
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sheaf::coordinator {

inline constexpr char kDefaultPool[] = "default";
inline constexpr size_t kJobTagsMax = 16;
inline constexpr size_t kWorkerTagsMax = 32;

struct Requirements {
  std::string pool = kDefaultPool;  // Only workers of this pool.
  std::vector<std::string> tags;    // Only workers with all of them. Ascending, unique.
  uint64_t memory_min_bytes = 0;    // Only workers with this much memory for scenes.
  // The memory that loading its scenes is expected to need; 0: not known. Workers with less get the
  // job only while no live worker has it.
  uint64_t memory_expected_bytes = 0;
  friend auto operator<=>(const Requirements&, const Requirements&) = default;
};

struct WorkerTraits {
  std::string pool = kDefaultPool;
  std::vector<std::string> tags;  // Ascending, each once.
  uint64_t memory_bytes = 0;      // For scenes; 0: not known.
  friend auto operator<=>(const WorkerTraits&, const WorkerTraits&) = default;
};

// Errors: kInvalidArgument, naming the field.
absl::Status CheckRequirements(const Requirements& requirements);
absl::Status CheckWorkerTraits(const WorkerTraits& traits);

// Ascending, each once.
std::vector<std::string> SortedTags(std::vector<std::string> tags);
// "gpu-free ssd": as a column holds them.
std::string FormatTags(const std::vector<std::string>& tags);
std::vector<std::string> ParseTags(const std::string& text);

// The next of four steps an octave: 5 GiB to 5 GiB, 5.1 GiB to 6 GiB.
uint64_t RoundMemoryUp(uint64_t bytes);

}  // namespace sheaf::coordinator
