// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmOptions: the directory and the limits of a farm.
#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"
#include "common/objects/object_store.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/core/policy/retention.h"
#include "coordinator/store/database/durability.h"

namespace sheaf::coordinator {

struct FarmOptions {
  std::string state_directory;
  // The store of parts and files of scenes, which must outlive the farm; null: the state directory.
  ObjectStore* parts = nullptr;
  ObjectStore* content = nullptr;
  Durability durability = Durability::kPowerLoss;  // For jobs and parts; images are durable.
  Limits limits;
  RetentionLimits retention;  // How much of ended jobs is kept.
  // Parts of delivered frames, also of unfinished jobs, are kept for RefineJob up to this total;
  // beyond it the oldest are removed.
  uint64_t kept_parts_bytes_max = uint64_t{20} << 30;
  // Small images of the ends of rounds; beyond the limit the oldest are removed.
  uint64_t round_previews_bytes_max = uint64_t{2} << 30;
  // Rate at which stored data is repeatedly compared with its digests; 0: never.
  uint64_t scrub_bytes_per_second = 0;
  // Memory of unfinished tiles; beyond it tiles are merged when their last part has come.
  uint64_t merge_bytes_max = uint64_t{1} << 30;
  absl::Duration preview_interval_min =
      absl::Milliseconds(300);      // Between two previews of a frame.
  uint64_t disk_reserve_bytes = 0;  // DiskReserve's; 0: none.
  // Advice to users if an upload does not fit.
  std::string space_advice =
      "free space on it (sheaf gc, sheaf usage), or lower --disk-free-min, which is kept for jobs";
  uint64_t part_bytes_max = uint64_t{1} << 30;  // For one result.
  // Whether failures of jobs are logged as warnings; otherwise the farm's owner reports them.
  bool warns_of_failed_jobs = true;
};

}  // namespace sheaf::coordinator
