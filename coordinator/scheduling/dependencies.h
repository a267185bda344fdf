// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Dependencies between jobs (docs/scheduling.md): their state, and the text that users see. Pure
// functions of the jobs. A job depends only on earlier jobs, so there are no cycles.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

struct FrameRecord;
struct JobRecord;
using JobRecords = std::map<uint64_t, JobRecord>;

// kBroken: it is not delivered, and will not be unless a user acts.
enum class DependencyState { kDone, kAwaited, kBroken };

// Returns the state of a dependency as a whole or, for a dependency by frame, of one frame.
DependencyState StateOf(const JobRecords& jobs, const JobDependency& dependency,
                        std::optional<int32_t> frame_number);
// Returns the state over all frames of the waiting job: done if done for all of them, broken if
// broken for any.
DependencyState StateForAll(const JobRecords& jobs, const JobRecord& job,
                            const JobDependency& dependency);
// Whether the job waits as a whole, or the frame waits for a frame of another job.
bool IsBlocked(const JobRecords& jobs, const JobRecord& job);
bool IsBlocked(const JobRecords& jobs, const JobRecord& job, int32_t frame_number);

// Explains why no task of a live job can be leased: the job, or all that is left of it, waits for
// other jobs or for approval. Says what a user can do about it. Empty if a task can be leased, or
// if nothing waits.
std::string WhyHeld(const JobRecords& jobs, const JobRecord& job);
// Explains why a frame of a live job is not rendered to the end: it waits for another job's frame,
// or for approval. Empty if it does not wait.
std::string WhyFrameWaits(const JobRecords& jobs, const JobRecord& job, const FrameRecord& frame);
// Describes the state of a dependency: "done", "released", "waits", "has failed" and the like.
std::string DependencyText(const JobRecords& jobs, const JobRecord& job,
                           const JobDependency& dependency);

// Live jobs by the jobs that they wait for.
class Dependents {
 public:
  void Add(const JobSpec& spec);
  void Erase(const JobSpec& spec);
  // Ascending.
  const std::set<uint64_t>& Of(uint64_t job_id) const;

 private:
  std::map<uint64_t, std::set<uint64_t>> by_job_;
};

}  // namespace sheaf::coordinator
