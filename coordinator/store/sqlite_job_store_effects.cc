// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that keeps what the effects of scenes cost.
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
  return ReadRowsOfJobs(
      database_->Prepare(
          "SELECT job_id, name, problem, without, time_share, time_share_error, mean_change, "
          "mean_change_error, relative_mse, variance_ratio FROM effects ORDER BY job_id, position"),
      jobs, [](SqliteStatement* row, StoredJob* job) {
        job->spec.effect_costs.push_back({row->Text(1), row->Text(2), row->Text(3), row->Double(4),
                                          row->Double(5), row->Double(6), row->Double(7),
                                          row->Double(8), row->Double(9)});
      });
}

}  // namespace sheaf::coordinator
