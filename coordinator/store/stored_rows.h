// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of the job store's tables: the columns of each and the members that they store
// (row_columns.h). job_schema.cc creates the tables.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/settings/frame_settings_fields.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/row_seal.h"

namespace sheaf::coordinator {

// The row type or its const version: one function visits rows to bind and rows to read.
template <typename T, typename Row>
concept RowOf = std::is_same_v<std::remove_const_t<T>, Row>;

// The immutable columns of the table `jobs`.
template <RowOf<StoredJob> Row, typename Visitor>
void VisitFixedColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.spec.job_id);
  visit("request_id", row.request_id);
  visit("title", row.spec.title);
  visit("owner", row.spec.owner);
  visit("numeric_profile", row.spec.numeric_profile);
  visit("tile_size_px", row.spec.partition.tile_size_px);
  visit("pass_sample_count", row.spec.partition.pass_sample_count);
  visit("lease_pass_count", row.spec.partition.lease_pass_count);
  visit("cell_size_px", row.spec.partition.cell_size_px);
  visit("create_ns", row.create_time);
}

// The mutable columns of the table `jobs`.
template <RowOf<StoredJob> Row, typename Visitor>
void VisitStateColumns(Row& row, const Visitor& visit) {
  visit("priority", row.spec.priority);
  visit("phase", row.phase);
  visit("end_ns", row.end_time);
  visit("paused", row.paused);
  visit("pinned", row.pinned);
  visit("parts_removed_ns", row.parts_removed_time);
}

// The table `jobs`. Frames, effects and failures are in tables of their own.
struct JobRow {
  StoredJob job;
  int64_t seal = 0;        // Over the immutable columns.
  int64_t state_seal = 0;  // Over the columns of VisitStateColumns.
};
template <RowOf<JobRow> Row, typename Visitor>
void VisitColumns(Row& sealed, const Visitor& visit) {
  auto& row = sealed.job;
  VisitFixedColumns(row, visit);
  VisitStateColumns(row, visit);
  visit("seal", sealed.seal);
  visit("state_seal", sealed.state_seal);
  visit("failure", row.failure);
  visit("failure_count", row.failures.count);
  visit("wall_ns", row.wall_duration);
  visit("warning", row.warning);
  visit("show", row.spec.show);
  visit("pool", row.spec.requirements.pool);
  visit("required_tags", row.spec.requirements.tags);
  visit("memory_min_bytes", row.spec.requirements.memory_min_bytes);
  visit("memory_expected_bytes", row.spec.requirements.memory_expected_bytes);
  visit("deadline_ns", row.spec.deadline.time);
  visit("quoted_cpu_seconds", row.spec.deadline.cpu_seconds);
  visit("quoted_cpu_seconds_low", row.spec.deadline.cpu_seconds_low);
  visit("quoted_cpu_seconds_high", row.spec.deadline.cpu_seconds_high);
  visit("command", row.spec.command);
}
inline int64_t SealOf(const StoredJob& job) {
  return SealOfColumns([&job](const auto& visit) { VisitFixedColumns(job, visit); });
}
inline int64_t SealOfState(const StoredJob& job) {
  return SealOfColumns([&job](const auto& visit) { VisitStateColumns(job, visit); });
}

// The stop rule of a frame, in the table `frames`.
template <RowOf<StopRule> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("target_error", row.target_error);
  visit("time_max_ns", row.time_max);
  visit("cpu_max_ns", row.cpu_max);
  visit("first_round_samples", row.first_round_samples);
  visit("certified", row.certified);
}

// The specification of a frame, in the table `frames`.
struct FrameSpecRow {
  uint64_t job_id = 0;
  FrameSpec spec;
};
template <RowOf<FrameSpecRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  visit("frame_number", row.spec.frame_number);
  visit("scene_sha256", row.spec.scene.sha256_hex);
  visit("scene_bytes", row.spec.scene.size_bytes);
  visit("frame_digest", row.spec.frame_digest);
  visit("resumed_sha256", row.spec.resumed.sha256_hex);
  visit("resumed_bytes", row.spec.resumed.size_bytes);
  VisitFrameSettings(row.spec.settings, [&visit](const SettingField& field, auto& value) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, PixelRect>) {
      visit("x0", value.x0);
      visit("y0", value.y0);
      visit("x1", value.x1);
      visit("y1", value.y1);
    } else if constexpr (std::is_same_v<Value, PixelLattice>) {
      visit(field.column, value.stride_px);
    } else {
      visit(field.column, value);
    }
  });
  VisitColumns(row.spec.stop, visit);
}

// The delivery of a frame, in the table `frames`.
struct DeliveredRow {
  bool delivered = false;  // If false, the other columns describe the last delivery, if any.
  DeliveredFrame frame;
};
template <RowOf<DeliveredRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("delivered", row.delivered);
  visit("image_digest", row.frame.image_digest);
  visit("relative_mse", row.frame.relative_mse);
  visit("wall_ns", row.frame.wall_duration);
  visit("ray_count", row.frame.cost.ray_count);
  visit("nonfinite_count", row.frame.cost.nonfinite_count);
  visit("cpu_ns", row.frame.cost.cpu_duration);
  visit("part_bytes", row.frame.cost.part_bytes);
  visit("sample_count", row.frame.sample_count);
  visit("relative_mse_upper", row.frame.relative_mse_upper);
  visit("stop_reason", row.frame.stop_reason);
  visit("tile_count", row.frame.tile_count);
  visit("unreliable_tile_count", row.frame.unreliable_tile_count);
  visit("unreliable_layers", row.frame.unreliable_layers);
  visit("flip", row.frame.flip);
  visit("one_sequence_gain", row.frame.one_sequence_gain);
  visit("left_eye_relative_mse", row.frame.left_eye_relative_mse);
  visit("right_eye_relative_mse", row.frame.right_eye_relative_mse);
  visit("eye_difference_relative_mse", row.frame.eye_difference_relative_mse);
}

// A frame of a job that continues, in the table `frames`.
struct ReopenedRow {
  bool delivered = false;
  uint64_t samples = 0;
  StopRule stop;
  BlobDigest resumed;
  int64_t seal = 0;  // Over the frame's specification.
};
template <RowOf<ReopenedRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("delivered", row.delivered);
  visit("samples", row.samples);
  VisitColumns(row.stop, visit);
  visit("resumed_sha256", row.resumed.sha256_hex);
  visit("resumed_bytes", row.resumed.size_bytes);
  visit("seal", row.seal);
}

// A complete row of the table `frames`.
struct FrameRow {
  Sealed<FrameSpecRow> wanted;
  DeliveredRow delivered;
  int32_t correction_count = 0;
};
template <RowOf<FrameRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  VisitColumns(row.wanted, visit);
  VisitColumns(row.delivered, visit);
  visit("correction_count", row.correction_count);
}

// The table `parts`.
template <RowOf<PartRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.key.frame.job_id);
  visit("frame_number", row.key.frame.frame_number);
  visit("x0", row.key.tile.x0);
  visit("y0", row.key.tile.y0);
  visit("x1", row.key.tile.x1);
  visit("y1", row.key.tile.y1);
  visit("first", row.key.block.first);
  visit("count", row.key.block.count);
  visit("sha256", row.digest.sha256_hex);
  visit("size_bytes", row.digest.size_bytes);
  visit("worker_id", row.worker_id);
  visit("ray_count", row.cost.ray_count);
  visit("nonfinite_count", row.cost.nonfinite_count);
  visit("cpu_ns", row.cost.cpu_duration);
  visit("cell_size_px", row.key.cells.size_px);
  visit("cells", row.key.cells.mask);
  visit("kind", row.key.kind);
  visit("identity", row.identity);
  visit("field", row.field);
}

// Reads all rows of a statement from SelectFrom<Sealed<PartRow>>. Rows that changed on disk go to
// `changed`; they are dropped if it is null. Errors: those of Step.
inline absl::StatusOr<std::vector<PartRow>> ReadPartRows(Statement* query,
                                                         std::vector<PartRow>* changed = nullptr) {
  std::vector<PartRow> parts;
  absl::Status read = ReadRows<Sealed<PartRow>>(query, [&](Sealed<PartRow> part) {
    part.row.cost.part_bytes = part.row.digest.size_bytes;
    if (part.IsWhole()) {
      parts.push_back(std::move(part.row));
    } else if (changed != nullptr) {
      changed->push_back(std::move(part.row));
    }
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return parts;
}

// The cost of a tile's parts, in the table `parts`, grouped by tile.
template <RowOf<JobStore::TileCost> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("x0", row.tile.x0);
  visit("y0", row.tile.y0);
  visit("x1", row.tile.x1);
  visit("y1", row.tile.y1);
  visit("CAST(SUM(cpu_ns) AS BIGINT)", row.cpu_duration);
}

// The table `rounds`, without its column of cells.
template <RowOf<StoredRound> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("frame_number", row.frame_number);
  visit("round", row.record.round);
  visit("relative_mse", row.record.relative_mse);
  visit("relative_mse_upper", row.record.relative_mse_upper);
  visit("predicted_relative_mse", row.record.predicted_relative_mse);
  visit("certified_upper", row.record.certified_upper);
  visit("sample_count", row.record.sample_count);
  visit("sample_count_expected", row.record.sample_count_expected);
  visit("wall_ns", row.record.wall_duration);
  visit("ray_count", row.record.cost.ray_count);
  visit("nonfinite_count", row.record.cost.nonfinite_count);
  visit("cpu_ns", row.record.cost.cpu_duration);
  visit("part_bytes", row.record.cost.part_bytes);
  visit("stop_reason", row.record.stop_reason);
}
// The same row with the column of packed cells.
struct CellRoundRow {
  uint64_t job_id = 0;
  StoredRound round;
  StoredBytes cells;
};
template <RowOf<CellRoundRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  VisitColumns(row.round, visit);
  visit("tiles", row.cells);
}

// The table `effects`.
struct EffectRow {
  uint64_t job_id = 0;
  int64_t position = 0;
  EffectCost cost;
};
template <RowOf<EffectRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  visit("position", row.position);
  visit("name", row.cost.name);
  visit("problem", row.cost.problem);
  visit("ablation", row.cost.ablation);
  visit("time_fraction", row.cost.time_fraction);
  visit("time_fraction_error", row.cost.time_fraction_error);
  visit("mean_change", row.cost.mean_change);
  visit("mean_change_error", row.cost.mean_change_error);
  visit("relative_mse", row.cost.relative_mse);
  visit("variance_ratio", row.cost.variance_ratio);
}

// The table `failures`.
struct FailureRow {
  uint64_t job_id = 0;
  int64_t position = 0;
  FailureRecord failure;
};
template <RowOf<FailureRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  visit("position", row.position);
  visit("frame_number", row.failure.frame_number);
  visit("x0", row.failure.tile.x0);
  visit("y0", row.failure.tile.y0);
  visit("x1", row.failure.tile.x1);
  visit("y1", row.failure.tile.y1);
  visit("first", row.failure.block.first);
  visit("count", row.failure.block.count);
  visit("worker_id", row.failure.worker_id);
  visit("kind", row.failure.kind);
  visit("message", row.failure.message);
  visit("time_ns", row.failure.time);
  visit("task_kind", row.failure.task_kind);
}

// The table `task_failures`: how often a worker failed a task with one class of failure. A count of
// 0 marks a task that is set aside; `words` says why. A block of no samples stands for the whole
// frame.
struct TroubleRow {
  TaskTrouble task;  // Without failures and set_aside.
  TaskFailure failure;
};
template <RowOf<TroubleRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.task.frame.job_id);
  visit("frame_number", row.task.frame.frame_number);
  visit("task_kind", row.task.kind);
  visit("x0", row.task.tile.x0);
  visit("y0", row.task.tile.y0);
  visit("x1", row.task.tile.x1);
  visit("y1", row.task.tile.y1);
  visit("first", row.task.block.first);
  visit("count", row.task.block.count);
  visit("cell_size_px", row.task.cells.size_px);
  visit("cells", row.task.cells.mask);
  visit("worker_id", row.failure.worker_id);
  visit("identity", row.failure.identity);
  visit("kind", row.failure.kind);
  visit("times", row.failure.count);
  visit("words", row.failure.words);
}

// The table `shares`.
struct ShareRow {
  ShareSubject subject;
  ShareSetting setting;
};
template <RowOf<ShareRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("kind", row.subject.kind);
  visit("name", row.subject.name);
  visit("weight", row.setting.weight);
  visit("threads_max", row.setting.threads_max);
}

// The columns of the table `usage` that are sums.
template <RowOf<Usage> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("result_count", row.result_count);
  visit("sample_count", row.sample_count);
  visit("ray_count", row.ray_count);
  visit("cpu_ns", row.cpu_duration);
  visit("repeated_count", row.repeated_count);
  visit("repeated_cpu_ns", row.repeated_cpu_duration);
  visit("lost_count", row.lost_count);
  visit("lost_cpu_ns", row.lost_cpu_duration);
  visit("upload_bytes", row.upload_bytes);
  visit("part_bytes", row.part_bytes);
  visit("image_bytes", row.image_bytes);
}
// The table `usage`.
template <RowOf<UsageRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("day", row.day);
  visit("owner", row.owner);
  visit("show", row.show);
  visit("job_id", row.job_id);
  VisitColumns(row.usage, visit);
}

// The table `dependencies`.
struct DependencyRow {
  uint64_t job_id = 0;  // The job that waits.
  JobDependency dependency;
};
template <RowOf<DependencyRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  visit("on_job_id", row.dependency.job_id);
  visit("by_frame", row.dependency.by_frame);
  visit("released", row.dependency.released);
  visit("removed", row.dependency.removed);
}

// The table `approvals`. Sealed: the samples of images depend on it.
struct ApprovalRow {
  uint64_t job_id = 0;
  int32_t frame_number = 0;
  FrameApproval approval;
};
template <RowOf<ApprovalRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  visit("frame_number", row.frame_number);
  visit("samples", row.approval.samples);
  visit("approved", row.approval.approved);
}

// The table `job_events`.
struct EventRow {
  uint64_t job_id = 0;
  int64_t position = 0;  // Ascending in the job.
  bool of_frame = false;
  int32_t frame_number = 0;
  JobEvent event;
};
template <RowOf<EventRow> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("job_id", row.job_id);
  visit("position", row.position);
  visit("time_ns", row.event.time);
  visit("what", row.event.what);
  visit("who", row.event.who);
  visit("of_frame", row.of_frame);
  visit("frame_number", row.frame_number);
  visit("text", row.event.text);
}

// The table `drains`.
template <RowOf<DrainRecord> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("worker_id", row.worker_id);
  visit("then_exit", row.then_exit);
  visit("time_ns", row.time);
}

// The table `quarantines`.
template <RowOf<QuarantineRecord> Row, typename Visitor>
void VisitColumns(Row& row, const Visitor& visit) {
  visit("identity", row.identity);
  visit("reason", row.reason);
  visit("made_false_results", row.made_false_results);
  visit("time_ns", row.time);
}

}  // namespace sheaf::coordinator
