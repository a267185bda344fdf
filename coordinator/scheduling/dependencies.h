// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Jobs that wait for other jobs (docs/scheduling.md): what is delivered of those, and what people
// are told. Pure functions of the jobs as they are; jobs depend on earlier ones alone, so that no
// job waits for itself.
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

// kBroken: it is not delivered, and will not be unless a person does something.
enum class DependencyState { kDone, kAwaited, kBroken };

// How the dependency of a job stands as a whole or, where that goes by frame, that of one frame.
DependencyState StateOf(const JobRecords& jobs, const JobDependency& dependency,
                        std::optional<int32_t> frame_number);
// How it stands for all frames of the job that waits: done where it is for all of them, broken
// where it is for one.
DependencyState StateForAll(const JobRecords& jobs, const JobRecord& job,
                            const JobDependency& dependency);
// Whether the job waits for another one as a whole, or the frame for one of another job.
bool IsBlocked(const JobRecords& jobs, const JobRecord& job);
bool IsBlocked(const JobRecords& jobs, const JobRecord& job, int32_t frame_number);

// Why nothing of a live job can be leased: it, or all that is left of it, waits for other jobs or
// for approval. What a person can do about it is named. Empty where something can be leased, or
// nothing waits.
std::string WhyHeld(const JobRecords& jobs, const JobRecord& job);
// Why a frame of a live job is not rendered (to the end): it waits for another job's, or for
// approval. Empty where it does not.
std::string WhyFrameWaits(const JobRecords& jobs, const JobRecord& job, const FrameRecord& frame);
// How a dependency stands, in a few words: "done", "released", "waits", "has failed" and the like.
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
