// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shares the farm between shows, users and jobs, and keeps their limits and the jobs' requirements.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
void SetShare(WorkState& state, const ShareSubject& subject, const ShareSetting& setting);
void ResetShare(WorkState& state, const ShareSubject& subject);
double WeightOf(const WorkState& state, const ShareSubject& subject);

int ThreadsPerLease(const WorkerRecord& worker);
// Whether the worker meets the job's requirements, and one more lease stays within all limits.
bool MayServe(const WorkState& state, const JobRecord& job, const WorkerRecord& worker);
// Leases from the first job, in order of shares, that has a task for the worker.
bool GrantFirstRender(WorkState& state, WorkerRecord* worker, SteadyTime now);
// Charges a new lease to its job, user and show.
void ChargeLease(WorkState& state, const JobRecord& job, const WorkerRecord& worker,
                 const Lease& lease, uint64_t sample_count);
void ChargeResult(WorkState& state, const Lease& lease, const ResultCost& cost, SteadyTime now);
// Whether the identity of a live worker that meets the job's requirements is accepted. A scan
// over workers where the job requires tags or memory.
bool AnyIdentityFits(const WorkState& state, const JobSpec& spec,
                     const std::function<bool(const std::string&)>& accept);
// Explains why no worker may render any task of the job: unmet requirements, or a limit.
std::string WhyNobodyMay(const WorkState& state, const JobRecord& job);

}  // namespace sheaf::coordinator::scheduling
