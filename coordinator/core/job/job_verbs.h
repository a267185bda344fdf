// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobVerb: every request that changes a job, in one table. gRPC's method, the farm's function, the
// client's call and the entry of the audit log have the verb's name; the HTTP route has its word.
// The methods, routes and rows of roles follow from the table.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/core/job/stop_rule.h"

// VERB(call, word, arguments): a method of JobService, whose request has the type v1::CALLRequest
// and whose answer is the job.
#define SHEAF_JOB_VERBS(VERB)                 \
  VERB(CancelJob, "cancel", kNone)            \
  VERB(PauseJob, "pause", kNone)              \
  VERB(ResumeJob, "resume", kNone)            \
  VERB(PinJob, "pin", kNone)                  \
  VERB(UnpinJob, "unpin", kNone)              \
  VERB(DeleteJob, "delete", kNone)            \
  VERB(SetJobPriority, "priority", kPriority) \
  VERB(RetryTasks, "retry", kTasks)           \
  VERB(KillTasks, "kill", kTasksOfFrame)      \
  VERB(ReleaseJob, "release", kNone)          \
  VERB(ApproveFrames, "approve", kFrames)     \
  VERB(RefineJob, "refine", kRefinement)

namespace sheaf::coordinator {

#define SHEAF_VERB(call, word, takes) k##call,
enum class JobVerb { SHEAF_JOB_VERBS(SHEAF_VERB) };
#undef SHEAF_VERB

// The arguments of a verb, beside its job.
struct JobArguments {
  int32_t priority = 0;
  std::optional<int32_t> frame = {};  // None: all.
  std::optional<uint32_t> task = {};  // A tile's number; none: all of the frame.
  std::vector<int32_t> frames = {};   // Empty: all.
  Refinement refinement = {};
  std::string user = {};  // The user who asks.
};

struct JobVerbRow {
  // kTasks: a frame and a task, which may be missing; kTasksOfFrame: the frame is required.
  enum class Takes { kNone, kPriority, kTasks, kTasksOfFrame, kFrames, kRefinement };
  JobVerb verb;
  const char* name;  // "PauseJob": gRPC's method, and the entry of the audit log.
  const char* word;  // "pause": the route POST /api/v1/jobs/ID:pause.
  Takes takes;
};

#define SHEAF_VERB(call, word, takes) {JobVerb::k##call, #call, word, JobVerbRow::Takes::takes},
inline constexpr JobVerbRow kJobVerbs[] = {SHEAF_JOB_VERBS(SHEAF_VERB)};
#undef SHEAF_VERB

constexpr const JobVerbRow& RowOf(JobVerb verb) { return kJobVerbs[static_cast<size_t>(verb)]; }

}  // namespace sheaf::coordinator
