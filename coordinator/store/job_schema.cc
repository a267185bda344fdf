// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/job_schema.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <memory>
#include <set>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "coordinator/store/database/sqlite_database.h"

namespace sheaf::coordinator {
namespace {

constexpr int64_t kSchemaVersion = 30;

// The tables that a new database gets.
constexpr char kSchema[] = R"sql(
CREATE TABLE meta(key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
INSERT INTO meta VALUES('lives', 0);
CREATE TABLE jobs(
  job_id INTEGER PRIMARY KEY AUTOINCREMENT, request_id TEXT NOT NULL UNIQUE, title TEXT NOT NULL,
  priority INTEGER NOT NULL, numeric_profile TEXT NOT NULL, tile_size_px INTEGER NOT NULL,
  pass_sample_count INTEGER NOT NULL, lease_pass_count INTEGER NOT NULL, phase INTEGER NOT NULL,
  failure TEXT NOT NULL, create_ns INTEGER NOT NULL, end_ns INTEGER NOT NULL,
  paused INTEGER NOT NULL DEFAULT 0, failure_count INTEGER NOT NULL DEFAULT 0,
  cell_size_px INTEGER NOT NULL DEFAULT 0, wall_ns INTEGER NOT NULL DEFAULT 0,
  warning TEXT NOT NULL DEFAULT '', owner TEXT NOT NULL DEFAULT 'local',
  seal INTEGER NOT NULL DEFAULT 0, pinned INTEGER NOT NULL DEFAULT 0,
  parts_removed_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  state_seal INTEGER NOT NULL DEFAULT 0, show TEXT NOT NULL DEFAULT 'default',
  pool TEXT NOT NULL DEFAULT 'default', required_tags TEXT NOT NULL DEFAULT '',
  memory_min_bytes INTEGER NOT NULL DEFAULT 0, memory_expected_bytes INTEGER NOT NULL DEFAULT 0,
  deadline_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  quoted_cpu_seconds REAL NOT NULL DEFAULT 0, quoted_cpu_seconds_low REAL NOT NULL DEFAULT 0,
  quoted_cpu_seconds_high REAL NOT NULL DEFAULT 0);
CREATE TABLE frames(
  job_id INTEGER NOT NULL REFERENCES jobs(job_id), frame_number INTEGER NOT NULL,
  scene_sha256 TEXT NOT NULL, scene_bytes INTEGER NOT NULL, frame_digest TEXT NOT NULL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL, x0 INTEGER NOT NULL, y0 INTEGER NOT NULL,
  x1 INTEGER NOT NULL, y1 INTEGER NOT NULL, samples INTEGER NOT NULL, max_depth INTEGER NOT NULL,
  seed INTEGER NOT NULL, force_generic INTEGER NOT NULL, delivered INTEGER NOT NULL DEFAULT 0,
  image_digest TEXT NOT NULL DEFAULT '', relative_mse REAL NOT NULL DEFAULT 0,
  wall_ns INTEGER NOT NULL DEFAULT 0, ray_count INTEGER NOT NULL DEFAULT 0,
  nonfinite_count INTEGER NOT NULL DEFAULT 0, cpu_ns INTEGER NOT NULL DEFAULT 0,
  color INTEGER NOT NULL DEFAULT 0, single_scattering INTEGER NOT NULL DEFAULT 0,
  outputs TEXT NOT NULL DEFAULT '', primaries INTEGER NOT NULL DEFAULT 0,
  white_balance_k REAL NOT NULL DEFAULT 0, one_sequence INTEGER NOT NULL DEFAULT 0,
  similarity_after INTEGER NOT NULL DEFAULT 0, target_error REAL NOT NULL DEFAULT 0,
  time_max_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  cpu_max_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  first_round_samples INTEGER NOT NULL DEFAULT 16, tile_count INTEGER NOT NULL DEFAULT 0,
  unreliable_tile_count INTEGER NOT NULL DEFAULT 0, sample_count INTEGER NOT NULL DEFAULT 0,
  part_bytes INTEGER NOT NULL DEFAULT 0, relative_mse_upper REAL NOT NULL DEFAULT 0,
  stop_reason INTEGER NOT NULL DEFAULT 0, pixel_stride_px INTEGER NOT NULL DEFAULT 1,
  flip REAL NOT NULL DEFAULT 0, resumed_sha256 TEXT NOT NULL DEFAULT '',
  resumed_bytes INTEGER NOT NULL DEFAULT 0, unreliable_layers TEXT NOT NULL DEFAULT '',
  one_sequence_gain REAL NOT NULL DEFAULT 0, sensor TEXT NOT NULL DEFAULT '',
  max_component_value REAL NOT NULL DEFAULT 0, correction_count INTEGER NOT NULL DEFAULT 0,
  seal INTEGER NOT NULL DEFAULT 0, techniques INTEGER NOT NULL DEFAULT 0,
  light_samples_max INTEGER NOT NULL DEFAULT 0, PRIMARY KEY(job_id, frame_number)) WITHOUT ROWID;
CREATE TABLE rounds(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, round INTEGER NOT NULL,
  relative_mse REAL NOT NULL, relative_mse_upper REAL NOT NULL,
  predicted_relative_mse REAL NOT NULL, sample_count INTEGER NOT NULL,
  sample_count_expected INTEGER NOT NULL, wall_ns INTEGER NOT NULL, ray_count INTEGER NOT NULL,
  nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL, part_bytes INTEGER NOT NULL,
  stop_reason INTEGER NOT NULL, tiles BLOB NOT NULL, seal INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, frame_number, round)) WITHOUT ROWID;
CREATE TABLE effects(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, name TEXT NOT NULL, problem TEXT NOT NULL,
  ablation TEXT NOT NULL, time_fraction REAL NOT NULL, time_fraction_error REAL NOT NULL,
  mean_change REAL NOT NULL, mean_change_error REAL NOT NULL, relative_mse REAL NOT NULL,
  variance_ratio REAL NOT NULL, PRIMARY KEY(job_id, position)) WITHOUT ROWID;
CREATE TABLE failures(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, frame_number INTEGER NOT NULL,
  x0 INTEGER NOT NULL, y0 INTEGER NOT NULL, x1 INTEGER NOT NULL, y1 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, worker_id TEXT NOT NULL, kind INTEGER NOT NULL,
  message TEXT NOT NULL, time_ns INTEGER NOT NULL, task_kind INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, position)) WITHOUT ROWID;
CREATE TABLE quarantines(
  identity TEXT PRIMARY KEY, reason TEXT NOT NULL, made_false_results INTEGER NOT NULL,
  time_ns INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE parts(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, kind INTEGER NOT NULL,
  y0 INTEGER NOT NULL, x0 INTEGER NOT NULL, first INTEGER NOT NULL, count INTEGER NOT NULL,
  cells INTEGER NOT NULL, y1 INTEGER NOT NULL, x1 INTEGER NOT NULL, cell_size_px INTEGER NOT NULL,
  sha256 TEXT NOT NULL, size_bytes INTEGER NOT NULL, worker_id TEXT NOT NULL,
  ray_count INTEGER NOT NULL, nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL,
  identity TEXT NOT NULL, seal INTEGER NOT NULL, field TEXT NOT NULL DEFAULT '',
  PRIMARY KEY(job_id, frame_number, kind, y0, x0, first, count, cells)) WITHOUT ROWID;
CREATE INDEX parts_by_identity ON parts(identity);
CREATE TABLE task_failures(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, task_kind INTEGER NOT NULL,
  x0 INTEGER NOT NULL, y0 INTEGER NOT NULL, x1 INTEGER NOT NULL, y1 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, cell_size_px INTEGER NOT NULL,
  cells INTEGER NOT NULL, worker_id TEXT NOT NULL, identity TEXT NOT NULL, kind INTEGER NOT NULL,
  times INTEGER NOT NULL, words TEXT NOT NULL, seal INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number, task_kind, y0, x0, first, count, cells, worker_id, kind))
  WITHOUT ROWID;
CREATE TABLE removed_jobs(
  job_id INTEGER PRIMARY KEY);
CREATE TABLE shares(
  kind INTEGER NOT NULL, name TEXT NOT NULL, weight REAL NOT NULL, threads_max INTEGER NOT NULL,
  PRIMARY KEY(kind, name)) WITHOUT ROWID;
CREATE TABLE usage(
  day INTEGER NOT NULL, owner TEXT NOT NULL, show TEXT NOT NULL, job_id INTEGER NOT NULL,
  result_count INTEGER NOT NULL, sample_count INTEGER NOT NULL, ray_count INTEGER NOT NULL,
  cpu_ns INTEGER NOT NULL, repeated_count INTEGER NOT NULL, repeated_cpu_ns INTEGER NOT NULL,
  lost_count INTEGER NOT NULL, lost_cpu_ns INTEGER NOT NULL, upload_bytes INTEGER NOT NULL,
  part_bytes INTEGER NOT NULL, image_bytes INTEGER NOT NULL,
  PRIMARY KEY(day, owner, show, job_id)) WITHOUT ROWID;
CREATE TABLE dependencies(
  job_id INTEGER NOT NULL, on_job_id INTEGER NOT NULL, by_frame INTEGER NOT NULL,
  released INTEGER NOT NULL, removed INTEGER NOT NULL,
  PRIMARY KEY(job_id, on_job_id)) WITHOUT ROWID;
CREATE INDEX dependencies_by_job ON dependencies(on_job_id);
CREATE TABLE approvals(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, samples INTEGER NOT NULL,
  approved INTEGER NOT NULL, seal INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number)) WITHOUT ROWID;
CREATE TABLE drains(
  worker_id TEXT PRIMARY KEY, then_exit INTEGER NOT NULL, time_ns INTEGER NOT NULL) WITHOUT ROWID;
)sql";

// The additions of each version to the first one's tables (tests/job_schema_test.cc), for databases
// of earlier versions. An addition is one to kSchema, too. Defaults of new columns describe frames
// of earlier versions: those were rendered with the present defaults.
constexpr char kAddedBy2[] = R"sql(
ALTER TABLE frames ADD COLUMN color INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN single_scattering INTEGER NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy3[] = R"sql(
ALTER TABLE frames ADD COLUMN outputs TEXT NOT NULL DEFAULT '';
)sql";
constexpr char kAddedBy4[] = R"sql(
ALTER TABLE frames ADD COLUMN primaries INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN white_balance_k REAL NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy5[] = R"sql(
ALTER TABLE frames ADD COLUMN one_sequence INTEGER NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy6[] = R"sql(
ALTER TABLE frames ADD COLUMN similarity_after INTEGER NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy7[] = R"sql(
ALTER TABLE frames ADD COLUMN target_error REAL NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN time_max_ns INTEGER NOT NULL DEFAULT 9223372036854775807;
ALTER TABLE frames ADD COLUMN cpu_max_ns INTEGER NOT NULL DEFAULT 9223372036854775807;
ALTER TABLE frames ADD COLUMN first_round_samples INTEGER NOT NULL DEFAULT 16;
ALTER TABLE frames ADD COLUMN tile_count INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN unreliable_tile_count INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN sample_count INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN part_bytes INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN relative_mse_upper REAL NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN stop_reason INTEGER NOT NULL DEFAULT 0;
UPDATE frames SET sample_count = (x1 - x0) * (y1 - y0) * samples WHERE delivered = 1;
CREATE TABLE rounds(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, round INTEGER NOT NULL,
  relative_mse REAL NOT NULL, relative_mse_upper REAL NOT NULL,
  predicted_relative_mse REAL NOT NULL, sample_count INTEGER NOT NULL,
  sample_count_expected INTEGER NOT NULL, wall_ns INTEGER NOT NULL,
  ray_count INTEGER NOT NULL, nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL,
  part_bytes INTEGER NOT NULL, stop_reason INTEGER NOT NULL, tiles BLOB NOT NULL,
  PRIMARY KEY(job_id, frame_number, round)) WITHOUT ROWID;
)sql";
constexpr char kAddedBy8[] = R"sql(
ALTER TABLE frames ADD COLUMN pixel_stride_px INTEGER NOT NULL DEFAULT 1;
)sql";
constexpr char kAddedBy9[] = R"sql(
ALTER TABLE jobs ADD COLUMN paused INTEGER NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy10[] = R"sql(
ALTER TABLE frames ADD COLUMN flip REAL NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN resumed_sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE frames ADD COLUMN resumed_bytes INTEGER NOT NULL DEFAULT 0;
CREATE TABLE effects(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, name TEXT NOT NULL, problem TEXT NOT NULL,
  without TEXT NOT NULL, time_share REAL NOT NULL, time_share_error REAL NOT NULL,
  mean_change REAL NOT NULL, mean_change_error REAL NOT NULL, relative_mse REAL NOT NULL,
  variance_ratio REAL NOT NULL, PRIMARY KEY(job_id, position)) WITHOUT ROWID;
)sql";
constexpr char kAddedBy11[] = R"sql(
ALTER TABLE frames ADD COLUMN unreliable_layers TEXT NOT NULL DEFAULT '';
)sql";
constexpr char kAddedBy12[] = R"sql(
ALTER TABLE jobs ADD COLUMN failure_count INTEGER NOT NULL DEFAULT 0;
CREATE TABLE failures(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, frame_number INTEGER NOT NULL,
  x0 INTEGER NOT NULL, y0 INTEGER NOT NULL, x1 INTEGER NOT NULL, y1 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, worker_id TEXT NOT NULL, kind INTEGER NOT NULL,
  message TEXT NOT NULL, time_ns INTEGER NOT NULL, PRIMARY KEY(job_id, position)) WITHOUT ROWID;
)sql";

// The same tile and block may have several parts, of different cells.
constexpr char kAddedBy13[] = R"sql(
ALTER TABLE jobs ADD COLUMN cell_size_px INTEGER NOT NULL DEFAULT 0;
ALTER TABLE parts RENAME TO parts_of_tiles;
CREATE TABLE parts(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, y0 INTEGER NOT NULL, x0 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, cells INTEGER NOT NULL, y1 INTEGER NOT NULL,
  x1 INTEGER NOT NULL, cell_size_px INTEGER NOT NULL, sha256 TEXT NOT NULL,
  size_bytes INTEGER NOT NULL, worker_id TEXT NOT NULL, ray_count INTEGER NOT NULL,
  nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number, y0, x0, first, count, cells)) WITHOUT ROWID;
INSERT INTO parts SELECT job_id, frame_number, y0, x0, first, count, 0, y1, x1, 0, sha256,
  size_bytes, worker_id, ray_count, nonfinite_count, cpu_ns FROM parts_of_tiles;
DROP TABLE parts_of_tiles;
)sql";
constexpr char kAddedBy14[] = R"sql(
ALTER TABLE frames ADD COLUMN one_sequence_gain REAL NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy15[] = R"sql(
ALTER TABLE jobs ADD COLUMN wall_ns INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN sensor TEXT NOT NULL DEFAULT '';
ALTER TABLE frames ADD COLUMN max_component_value REAL NOT NULL DEFAULT 0;
)sql";
constexpr char kAddedBy16[] = R"sql(
ALTER TABLE frames RENAME COLUMN picture_digest TO image_digest;
ALTER TABLE effects RENAME COLUMN without TO ablation;
ALTER TABLE effects RENAME COLUMN time_share TO time_fraction;
ALTER TABLE effects RENAME COLUMN time_share_error TO time_fraction_error;
)sql";
// Parts of before belong to the workers that rendered them.
constexpr char kAddedBy17[] = R"sql(
ALTER TABLE parts ADD COLUMN identity TEXT NOT NULL DEFAULT '';
UPDATE parts SET identity = worker_id;
CREATE INDEX parts_by_identity ON parts(identity);
ALTER TABLE frames ADD COLUMN correction_count INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN warning TEXT NOT NULL DEFAULT '';
CREATE TABLE quarantines(
  identity TEXT PRIMARY KEY, reason TEXT NOT NULL, made_false_results INTEGER NOT NULL,
  time_ns INTEGER NOT NULL) WITHOUT ROWID;
)sql";

constexpr char kAddedBy18[] = R"sql(
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT 'local';
)sql";

// See row_seal.h. A later version that adds a column to a sealed row must set the seals to 0.
constexpr char kAddedBy19[] = R"sql(
ALTER TABLE jobs ADD COLUMN seal INTEGER NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN seal INTEGER NOT NULL DEFAULT 0;
ALTER TABLE parts ADD COLUMN seal INTEGER NOT NULL DEFAULT 0;
ALTER TABLE rounds ADD COLUMN seal INTEGER NOT NULL DEFAULT 0;
)sql";
// The seals of earlier rows do not cover the new column.
constexpr char kAddedBy20[] = R"sql(
ALTER TABLE frames ADD COLUMN techniques INTEGER NOT NULL DEFAULT 0;
UPDATE frames SET seal = 0;
)sql";
// The light tile of a frame may have the rectangle of another tile.
constexpr char kAddedBy21[] = R"sql(
ALTER TABLE failures ADD COLUMN task_kind INTEGER NOT NULL DEFAULT 0;
ALTER TABLE parts RENAME TO parts_of_cameras;
CREATE TABLE parts(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, kind INTEGER NOT NULL,
  y0 INTEGER NOT NULL, x0 INTEGER NOT NULL, first INTEGER NOT NULL, count INTEGER NOT NULL,
  cells INTEGER NOT NULL, y1 INTEGER NOT NULL, x1 INTEGER NOT NULL, cell_size_px INTEGER NOT NULL,
  sha256 TEXT NOT NULL, size_bytes INTEGER NOT NULL, worker_id TEXT NOT NULL,
  ray_count INTEGER NOT NULL, nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL,
  identity TEXT NOT NULL, seal INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number, kind, y0, x0, first, count, cells)) WITHOUT ROWID;
INSERT INTO parts SELECT job_id, frame_number, 0, y0, x0, first, count, cells, y1, x1,
  cell_size_px, sha256, size_bytes, worker_id, ray_count, nonfinite_count, cpu_ns, identity, 0
  FROM parts_of_cameras;
DROP TABLE parts_of_cameras;
CREATE INDEX parts_by_identity ON parts(identity);
)sql";
// Frames of before have no guiding fields. The seals of earlier rows do not cover the new column.
constexpr char kAddedBy22[] = R"sql(
ALTER TABLE parts ADD COLUMN field TEXT NOT NULL DEFAULT '';
UPDATE parts SET seal = 0;
)sql";
// The seals of earlier rows do not cover the new column.
constexpr char kAddedBy23[] = R"sql(
ALTER TABLE frames ADD COLUMN light_samples_max INTEGER NOT NULL DEFAULT 0;
UPDATE frames SET seal = 0;
)sql";
constexpr char kAddedBy24[] = R"sql(
CREATE TABLE task_failures(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, task_kind INTEGER NOT NULL,
  x0 INTEGER NOT NULL, y0 INTEGER NOT NULL, x1 INTEGER NOT NULL, y1 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, cell_size_px INTEGER NOT NULL,
  cells INTEGER NOT NULL, worker_id TEXT NOT NULL, identity TEXT NOT NULL, kind INTEGER NOT NULL,
  times INTEGER NOT NULL, words TEXT NOT NULL, seal INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number, task_kind, y0, x0, first, count, cells, worker_id, kind))
  WITHOUT ROWID;
)sql";
// The ids of jobs that were removed: of those whose files may be left, and of the last ones, so
// that no id is given twice.
constexpr char kAddedBy25[] = R"sql(
ALTER TABLE jobs ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN parts_removed_ns INTEGER NOT NULL DEFAULT 9223372036854775807;
CREATE TABLE removed_jobs(job_id INTEGER PRIMARY KEY);
)sql";
constexpr char kAddedBy26[] = "ALTER TABLE jobs ADD COLUMN state_seal INTEGER NOT NULL DEFAULT 0;";
// Images do not depend on these columns: no seal covers them.
constexpr char kAddedBy27[] = R"sql(
ALTER TABLE jobs ADD COLUMN show TEXT NOT NULL DEFAULT 'default';
ALTER TABLE jobs ADD COLUMN pool TEXT NOT NULL DEFAULT 'default';
ALTER TABLE jobs ADD COLUMN required_tags TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN memory_min_bytes INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN memory_expected_bytes INTEGER NOT NULL DEFAULT 0;
CREATE TABLE shares(
  kind INTEGER NOT NULL, name TEXT NOT NULL, weight REAL NOT NULL, threads_max INTEGER NOT NULL,
  PRIMARY KEY(kind, name)) WITHOUT ROWID;
)sql";
// The accounts begin with this version.
constexpr char kAddedBy28[] = R"sql(
CREATE TABLE usage(
  day INTEGER NOT NULL, owner TEXT NOT NULL, show TEXT NOT NULL, job_id INTEGER NOT NULL,
  result_count INTEGER NOT NULL, sample_count INTEGER NOT NULL, ray_count INTEGER NOT NULL,
  cpu_ns INTEGER NOT NULL, repeated_count INTEGER NOT NULL, repeated_cpu_ns INTEGER NOT NULL,
  lost_count INTEGER NOT NULL, lost_cpu_ns INTEGER NOT NULL, upload_bytes INTEGER NOT NULL,
  part_bytes INTEGER NOT NULL, image_bytes INTEGER NOT NULL,
  PRIMARY KEY(day, owner, show, job_id)) WITHOUT ROWID;
)sql";
constexpr char kAddedBy29[] = R"sql(
CREATE TABLE dependencies(
  job_id INTEGER NOT NULL, on_job_id INTEGER NOT NULL, by_frame INTEGER NOT NULL,
  released INTEGER NOT NULL, removed INTEGER NOT NULL, PRIMARY KEY(job_id, on_job_id))
  WITHOUT ROWID;
CREATE INDEX dependencies_by_job ON dependencies(on_job_id);
CREATE TABLE approvals(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, samples INTEGER NOT NULL,
  approved INTEGER NOT NULL, seal INTEGER NOT NULL, PRIMARY KEY(job_id, frame_number))
  WITHOUT ROWID;
CREATE TABLE drains(
  worker_id TEXT PRIMARY KEY, then_exit INTEGER NOT NULL, time_ns INTEGER NOT NULL) WITHOUT ROWID;
)sql";
// Images do not depend on these columns: no seal covers them.
constexpr char kAddedBy30[] = R"sql(
ALTER TABLE jobs ADD COLUMN deadline_ns INTEGER NOT NULL DEFAULT 9223372036854775807;
ALTER TABLE jobs ADD COLUMN quoted_cpu_seconds REAL NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN quoted_cpu_seconds_low REAL NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN quoted_cpu_seconds_high REAL NOT NULL DEFAULT 0;
)sql";

}  // namespace

absl::Status MigrateSchema(Database* database) {
  const absl::StatusOr<int64_t> version = database->SchemaVersion();
  if (!version.ok()) return version.status();
  if (*version > kSchemaVersion) {
    return absl::FailedPreconditionError(
        absl::StrCat(database->Name(), ": written by a later version of Sheaf (schema ", *version,
                     ", this version supports up to ", kSchemaVersion, ")"));
  }
  if (*version == kSchemaVersion) return absl::OkStatus();
  std::string statements = *version == 0 ? kSchema : "";
  const char* const added[] = {kAddedBy2,  kAddedBy3,  kAddedBy4,  kAddedBy5,  kAddedBy6,
                               kAddedBy7,  kAddedBy8,  kAddedBy9,  kAddedBy10, kAddedBy11,
                               kAddedBy12, kAddedBy13, kAddedBy14, kAddedBy15, kAddedBy16,
                               kAddedBy17, kAddedBy18, kAddedBy19, kAddedBy20, kAddedBy21,
                               kAddedBy22, kAddedBy23, kAddedBy24, kAddedBy25, kAddedBy26,
                               kAddedBy27, kAddedBy28, kAddedBy29, kAddedBy30};
  int64_t adds = 2;
  for (const char* of_version : added) {
    if (*version > 0 && *version < adds) statements += of_version;
    ++adds;
  }
  return database->InTransaction([database, &statements] {
    absl::Status status = database->Execute(statements);
    return status.ok() ? database->SetSchemaVersion(kSchemaVersion) : status;
  });
}

namespace {

absl::StatusOr<std::set<std::string>> ColumnsOfNewDatabase() {
  absl::StatusOr<std::unique_ptr<SqliteDatabase>> made =
      SqliteDatabase::Open(":memory:", Durability::kProcess);
  if (!made.ok()) return made.status();
  if (absl::Status status = MigrateSchema(made->get()); !status.ok()) return status;
  return (*made)->TableColumns();
}

}  // namespace

absl::Status CheckSchema(Database* database) {
  // Made once in a process.
  static const absl::StatusOr<std::set<std::string>> wanted = ColumnsOfNewDatabase();
  if (!wanted.ok()) return wanted.status();
  const absl::StatusOr<std::set<std::string>> found = database->TableColumns();
  if (!found.ok()) return found.status();
  std::vector<std::string> differing;
  std::ranges::set_symmetric_difference(*wanted, *found, std::back_inserter(differing));
  if (differing.empty()) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("the names of its tables changed: ", differing.front(),
                   wanted->contains(differing.front()) ? " is missing" : " is unknown"));
}

}  // namespace sheaf::coordinator
