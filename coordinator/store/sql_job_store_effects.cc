// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that stores the costs of effects in scenes.
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {

absl::Status SqlJobStore::InsertEffects(uint64_t job_id, const std::vector<EffectCost>& effects) {
  Statement insert = database_->Prepare(absl::StrCat("INSERT ", IntoTable<EffectRow>("effects")));
  int64_t position = 0;
  for (const EffectCost& effect : effects) {
    absl::Status status = BindRow(EffectRow{job_id, position++, effect}, &insert).Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status SqlJobStore::LoadEffects(const std::map<uint64_t, StoredJob*>& jobs) {
  Statement query = database_->Prepare(
      absl::StrCat(SelectFrom<EffectRow>("effects"), "ORDER BY job_id, position"));
  return ReadRows<EffectRow>(&query, [&jobs](EffectRow row) {
    const auto job = jobs.find(row.job_id);
    if (job != jobs.end()) job->second->spec.effect_costs.push_back(std::move(row.cost));
    return absl::OkStatus();
  });
}

}  // namespace sheaf::coordinator
