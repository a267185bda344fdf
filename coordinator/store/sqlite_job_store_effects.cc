// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that keeps what the effects of scenes cost.
#include <map>

#include "coordinator/store/sqlite_job_store.h"

namespace sheaf::coordinator {

absl::Status SqliteJobStore::InsertEffects(uint64_t job_id,
                                           const std::vector<EffectCost>& effects) {
  SqliteStatement insert = database_->Prepare(
      "INSERT INTO effects(job_id, position, name, problem, without, time_share, "
      "time_share_error, mean_change, mean_change_error, relative_mse, variance_ratio) "
      "VALUES(?,?,?,?,?,?,?,?,?,?,?)");
  int64_t position = 0;
  for (const EffectCost& effect : effects) {
    absl::Status status = insert.Bind(job_id)
                              .Bind(position++)
                              .Bind(effect.name)
                              .Bind(effect.problem)
                              .Bind(effect.without)
                              .Bind(effect.time_share)
                              .Bind(effect.time_share_error)
                              .Bind(effect.mean_change)
                              .Bind(effect.mean_change_error)
                              .Bind(effect.relative_mse)
                              .Bind(effect.variance_ratio)
                              .Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status SqliteJobStore::LoadEffects(std::vector<StoredJob>* jobs) {
  std::map<uint64_t, StoredJob*> by_id;
  for (StoredJob& job : *jobs) by_id[job.spec.job_id] = &job;
  SqliteStatement query = database_->Prepare(
      "SELECT job_id, name, problem, without, time_share, time_share_error, mean_change, "
      "mean_change_error, relative_mse, variance_ratio FROM effects ORDER BY job_id, position");
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return absl::OkStatus();
    const auto job = by_id.find(static_cast<uint64_t>(query.Int64(0)));
    if (job == by_id.end()) continue;
    job->second->spec.effect_costs.push_back({query.Text(1), query.Text(2), query.Text(3),
                                              query.Double(4), query.Double(5), query.Double(6),
                                              query.Double(7), query.Double(8), query.Double(9)});
  }
}

}  // namespace sheaf::coordinator
