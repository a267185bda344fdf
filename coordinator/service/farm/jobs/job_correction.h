// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobCorrection: removes false results. The frames that hold them are rendered again from the
// remaining parts, even if they are delivered. A frame with rounds starts at its first round,
// because its decisions came from false sums.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/jobs/job_context.h"
#include "coordinator/service/farm/jobs/job_ends.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobCorrection {
 public:
  JobCorrection(JobContext& context, JobEnds& ends) : context_(context), ends_(ends) {}

  // Removes the stored results of an identity that made false ones, once its quarantine is durable;
  // the frames that hold them are rendered again. Requires: no result is taken meanwhile. Errors:
  // those of the store, and kUnavailable while the disk does not remove all of them. Call it again
  // after an error; no frame is corrected twice.
  absl::Status RemoveResultsOf(const std::string& identity);
  // Removes the parts of a frame whose guiding field was lost and trained to a different result;
  // they are rendered again. Requires and errors: as RemoveResultsOf.
  absl::Status RemovePartsOfLostField(const FrameId& id);

 private:
  // why: the finding about the parts, for users.
  absl::Status CorrectJob(uint64_t job_id, const std::string& why,
                          const std::vector<PartRow>& false_parts)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(context_.settle_mutex);
  // The false parts of an identity, with those that others made with its guiding fields. Fields
  // come last: if a stop interrupts the removal, a remaining field leads to the rest.
  absl::StatusOr<std::vector<PartRow>> WithPartsOfFields(uint64_t job_id,
                                                         std::vector<PartRow> false_parts);

  JobContext& context_;
  JobEnds& ends_;
};

}  // namespace sheaf::coordinator
