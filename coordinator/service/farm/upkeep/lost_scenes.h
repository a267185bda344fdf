// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LostScenes: holds the frames whose scenes have files that were damaged or lost in the content
// store, naming the file, until a user submits the scene again.
#pragma once

#include <map>
#include <string>

#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"

namespace sheaf::coordinator {

// Thread safety: one thread at a time.
class LostScenes {
 public:
  // All arguments must outlive the object.
  LostScenes(FarmTables* tables, const BlobStore* blobs, FarmSignals* signals)
      : tables_(*tables), blobs_(*blobs), signals_(*signals) {}

  // Holds the frames whose blobs are lost, and releases those whose blobs are back. Cheap when
  // called too soon after the last call.
  void Update();

 private:
  // Names the lost file of a scene, and what to do; empty if no file is lost.
  std::string LostFileOf(const BlobDigest& scene) const;

  FarmTables& tables_;
  const BlobStore& blobs_;
  FarmSignals& signals_;
  std::map<std::string, BlobDigest> lost_;  // Needed by live jobs, by digest.
  SteadyTime next_update_time_ = SteadyTime::InfinitePast();
};

}  // namespace sheaf::coordinator
