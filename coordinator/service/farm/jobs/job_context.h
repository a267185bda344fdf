// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobContext: what the classes of jobs work on, and the mutex that orders their changes.
#pragma once

#include <cstdint>
#include <string>

#include "common/base/mutex.h"
#include "coordinator/service/farm/state/delivery_queue.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_options.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/job_journal.h"
#include "coordinator/service/farm/state/part_removals.h"
#include "coordinator/service/farm/state/resumed_frames.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// Thread safety: each member has its own.
struct JobContext {
  const FarmOptions options;
  const std::string numeric_profile;  // Given to new jobs.
  FarmTables& tables;
  JobStore& store;
  PartRemovals& removals;
  RoundPreviews& previews;
  const ResumedFrames& resumed;
  DeliveryQueue& queue;
  DiskState& disk;
  FarmSignals& signals;
  JobJournal& journal;
  // Held by one call at a time that stores the ends of jobs, reopens or pauses a job, or removes
  // its stored data. Taken before the tables' mutex.
  Mutex settle_mutex{};
  // How often ended jobs were reopened since the start.
  uint64_t reopen_count ABSL_GUARDED_BY(settle_mutex) = 0;
};

}  // namespace sheaf::coordinator
