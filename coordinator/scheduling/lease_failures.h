// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Handles leases that end without a result.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
void Fail(WorkState& state, const LeaseFailure& failure, const std::string& worker_id,
          SteadyTime now);
void RestoreFailures(WorkState& state, uint64_t job_id, FailureLog failures);
std::set<uint64_t> TakeFailureJobs(WorkState& state, absl::Time stamp);
void Quarantine(WorkState& state, const std::string& identity, const std::string& reason,
                bool made_false_results);
void RestoreQuarantine(WorkState& state, const QuarantineRecord& record);
bool LiftQuarantine(WorkState& state, const std::string& identity);
std::vector<QuarantineRecord> TakeQuarantines(WorkState& state, absl::Time stamp);

void JudgeDoubtfulScenes(WorkState& state);
void LoseLeases(WorkState& state, const std::string& worker_id, SteadyTime now);
void ApplyReport(WorkState& state, WorkerRecord* worker, const WorkerReport& report,
                 SteadyTime now);
void DropLease(WorkState& state, uint64_t lease_id, bool put_back);
// The identities of which no live worker's cache has room for the job.
std::set<std::string> IdentitiesWithoutRoom(WorkState& state, const JobRecord& job);
// Whether a live worker outside `failed` meets the job's requirements.
bool OthersLive(const WorkState& state, const JobSpec& spec, const std::set<std::string>& failed);
bool OtherIdentitiesLive(const WorkState& state, const JobSpec& spec,
                         const std::set<std::string>& failed);
// Whether failures reported by these identities can end a job: one of them has delivered results,
// or no live identity has. Scans the live identities if all of them are strangers.
bool AreBelieved(const WorkState& state, const std::string& numeric_profile,
                 const std::set<std::string>& identities);
// Sets doubtful tasks aside that every identity failed and whose failures are now believed.
void JudgeDoubtfulTasks(WorkState& state);
// Counts the job against workers that failed a task which another identity rendered.
void BlameSuspects(WorkState& state, const std::map<std::string, std::string>& suspects,
                   uint64_t job_id, const std::string& rendered_by, SteadyTime now);

}  // namespace sheaf::coordinator::scheduling
