// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sqlite_job_store.h"

#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "coordinator/store/part_rows.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {
namespace {

// "caustic 12 direct 3": names of layers have no spaces.
std::string FormatLayers(const std::vector<LayerCount>& counts) {
  return absl::StrJoin(counts, " ", [](std::string* text, const LayerCount& count) {
    absl::StrAppend(text, count.layer, " ", count.tile_count);
  });
}

std::vector<LayerCount> ParseLayers(const std::string& text) {
  const std::vector<std::string> words = absl::StrSplit(text, ' ', absl::SkipEmpty());
  std::vector<LayerCount> counts;
  for (size_t i = 0; i + 1 < words.size(); i += 2) {
    LayerCount& count = counts.emplace_back(LayerCount{words[i]});
    if (!absl::SimpleAtoi(words[i + 1], &count.tile_count)) count.tile_count = 0;
  }
  return counts;
}

}  // namespace

std::string SqliteJobStore::FrameDirectory(const FrameId& frame) const {
  return absl::StrCat(directory_, "/parts/", frame.job_id, "/", frame.frame_number);
}

std::string SqliteJobStore::PartPath(const PartRow& row) const {
  const PixelRect& t = row.key.tile;
  return absl::StrCat(FrameDirectory(row.key.frame), "/", t.x0, "_", t.y0, "_", t.x1, "_", t.y1,
                      "-", row.key.block.first, "-", row.key.block.count, "-",
                      row.digest.sha256_hex.substr(0, 16), ".exr");
}

absl::Status SqliteJobStore::LoadFrames(StoredJob* job) {
  SqliteStatement query = database_->Prepare(
      "SELECT frame_number, scene_sha256, scene_bytes, frame_digest, width_px, height_px, x0, y0, "
      "x1, "
      "y1, samples, max_depth, seed, force_generic, delivered, picture_digest, relative_mse, "
      "wall_ns, "
      "ray_count, nonfinite_count, cpu_ns, color, single_scattering, outputs, primaries, "
      "white_balance_k, one_sequence, similarity_after, target_error, time_max_ns, cpu_max_ns, "
      "sample_count, part_bytes, relative_mse_upper, stop_reason, first_round_samples, "
      "tile_count, unreliable_tile_count, pixel_stride_px, flip, resumed_sha256, resumed_bytes, "
      "unreliable_layers, one_sequence_gain, sensor, max_component_value FROM frames WHERE job_id "
      "= ? "
      "ORDER BY frame_number");
  query.Bind(job->spec.job_id);
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return absl::OkStatus();
    const auto edge = [&](int column) { return static_cast<int32_t>(query.Int64(column)); };
    FrameSpec frame;
    frame.frame_number = edge(0);
    frame.scene = {query.Text(1), static_cast<uint64_t>(query.Int64(2))};
    frame.frame_digest = query.Text(3);
    if (!IsSha256Hex(frame.scene.sha256_hex) || !IsSha256Hex(frame.frame_digest)) {
      return absl::DataLossError("a stored frame has an invalid digest");
    }
    frame.resumed = {query.Text(40), static_cast<uint64_t>(query.Int64(41))};
    FrameSettings& s = frame.settings;
    s.width_px = edge(4);
    s.height_px = edge(5);
    s.window = {edge(6), edge(7), edge(8), edge(9)};
    s.samples = static_cast<uint64_t>(query.Int64(10));
    s.max_depth = edge(11);
    s.seed = static_cast<uint64_t>(query.Int64(12));
    s.force_generic_variant = query.Int64(13) != 0;
    s.color = static_cast<ColorTransport>(query.Int64(21));
    s.single_scattering = query.Int64(22) != 0;
    absl::StatusOr<FilmOutputs> outputs = ParseOutputs(query.Text(23));
    if (!outputs.ok()) {
      return absl::DataLossError(absl::StrCat("a stored frame: ", outputs.status().message()));
    }
    s.outputs = *std::move(outputs);
    s.primaries = static_cast<Primaries>(query.Int64(24));
    s.white_balance_k = static_cast<float>(query.Double(25));
    s.one_sequence = query.Int64(26) != 0;
    s.similarity_after = edge(27);
    s.sensor = query.Text(44);
    s.max_component_value = static_cast<float>(query.Double(45));
    if (const int32_t stride_px = edge(38); stride_px != 1) s.lattice = {stride_px, s.seed};
    frame.stop = {query.Double(28), DurationFromNanoseconds(query.Int64(29)),
                  DurationFromNanoseconds(query.Int64(30)), static_cast<uint64_t>(query.Int64(35))};
    if (query.Int64(14) != 0) {
      StoredFrame stored{frame.frame_number, {}};
      DeliveredFrame& delivered = stored.delivered;
      delivered.picture_digest = query.Text(15);
      delivered.relative_mse = query.Double(16);
      delivered.wall_duration = absl::Nanoseconds(query.Int64(17));
      delivered.cost = {static_cast<uint64_t>(query.Int64(18)),
                        static_cast<uint64_t>(query.Int64(19)), absl::Nanoseconds(query.Int64(20)),
                        static_cast<uint64_t>(query.Int64(32))};
      delivered.sample_count = static_cast<uint64_t>(query.Int64(31));
      delivered.relative_mse_upper = query.Double(33);
      delivered.stop_reason = static_cast<StopReason>(query.Int64(34));
      delivered.tile_count = static_cast<uint32_t>(query.Int64(36));
      delivered.unreliable_tile_count = static_cast<uint32_t>(query.Int64(37));
      delivered.flip = query.Double(39);
      delivered.unreliable_layers = ParseLayers(query.Text(42));
      delivered.one_sequence_gain = query.Double(43);
      job->delivered.push_back(std::move(stored));
    }
    job->spec.frames.push_back(std::move(frame));
  }
}

absl::StatusOr<std::vector<StoredJob>> SqliteJobStore::LoadJobs() {
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<std::vector<StoredJob>> jobs = ReadJobs();
  if (!jobs.ok()) return Explained(jobs.status());
  return jobs;
}

absl::StatusOr<std::vector<StoredJob>> SqliteJobStore::ReadJobs() {
  std::vector<StoredJob> jobs;
  SqliteStatement query = database_->Prepare(
      "SELECT job_id, request_id, title, priority, numeric_profile, tile_size_px, "
      "pass_sample_count, "
      "lease_pass_count, phase, failure, create_ns, end_ns, paused, failure_count, cell_size_px, "
      "wall_ns FROM jobs "
      "ORDER BY job_id");
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) break;
    StoredJob job;
    job.spec.job_id = static_cast<uint64_t>(query.Int64(0));
    job.request_id = query.Text(1);
    job.spec.title = query.Text(2);
    job.spec.priority = static_cast<int32_t>(query.Int64(3));
    job.spec.numeric_profile = query.Text(4);
    job.spec.partition = {
        static_cast<int32_t>(query.Int64(5)), static_cast<uint64_t>(query.Int64(6)),
        static_cast<uint64_t>(query.Int64(7)), static_cast<int32_t>(query.Int64(14))};
    job.phase = static_cast<JobPhase>(query.Int64(8));
    job.failure = query.Text(9);
    job.create_time = FromNanoseconds(query.Int64(10));
    job.end_time = FromNanoseconds(query.Int64(11));
    job.paused = query.Int64(12) != 0;
    job.failures.count = query.Int64(13);
    job.wall_duration = DurationFromNanoseconds(query.Int64(15));
    jobs.push_back(std::move(job));
  }
  for (StoredJob& job : jobs) {
    if (absl::Status status = LoadFrames(&job); !status.ok()) return status;
  }
  if (absl::Status status = LoadEffects(&jobs); !status.ok()) return status;
  if (absl::Status status = LoadFailures(&jobs); !status.ok()) return status;
  return jobs;
}

absl::Status SqliteJobStore::ReadRowsOfJobs(
    SqliteStatement query, std::vector<StoredJob>* jobs,
    const std::function<void(SqliteStatement*, StoredJob*)>& read) {
  std::map<uint64_t, StoredJob*> by_id;
  for (StoredJob& job : *jobs) by_id[job.spec.job_id] = &job;
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return absl::OkStatus();
    const auto job = by_id.find(static_cast<uint64_t>(query.Int64(0)));
    if (job != by_id.end()) read(&query, job->second);
  }
}

absl::StatusOr<JobStore::LoadedParts> SqliteJobStore::LoadParts(uint64_t job_id) {
  std::vector<PartRow> rows;
  {
    const MutexLock lock(&database_mutex_);
    SqliteStatement query = database_->Prepare(absl::StrCat(kPartColumns, "WHERE job_id = ?"));
    query.Bind(job_id);
    absl::StatusOr<std::vector<PartRow>> all = ReadPartRows(&query);
    if (!all.ok()) return all.status();
    rows = std::move(*all);
  }
  LoadedParts loaded;
  std::set<std::string> known;
  for (PartRow& row : rows) {
    std::error_code error;
    const std::string path = PartPath(row);
    const uintmax_t size = std::filesystem::file_size(path, error);
    if (error || size != row.digest.size_bytes) {
      ++loaded.rows_lost;
      if (absl::Status status = RemovePart(row); !status.ok()) return status;
      continue;
    }
    known.insert(path);
    loaded.rows.push_back(std::move(row));
  }
  std::error_code error;
  const std::string directory = absl::StrCat(directory_, "/parts/", job_id);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory, error)) {
    std::error_code ignored;
    if (entry.is_regular_file(ignored) && !known.contains(entry.path().string())) {
      std::filesystem::remove(entry.path(), ignored);
    }
  }
  return loaded;
}

absl::StatusOr<std::optional<uint64_t>> SqliteJobStore::FindRequest(const std::string& request_id) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare("SELECT job_id FROM jobs WHERE request_id = ?");
  const absl::StatusOr<bool> row = query.Bind(request_id).Step();
  if (!row.ok()) return row.status();
  if (!*row) return std::optional<uint64_t>();
  return std::optional<uint64_t>(static_cast<uint64_t>(query.Int64(0)));
}

absl::StatusOr<JobStore::CreatedJob> SqliteJobStore::CreateJob(const JobSpec& spec,
                                                               const std::string& request_id,
                                                               absl::Time create_time) {
  const absl::StatusOr<std::optional<uint64_t>> existing = FindRequest(request_id);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return CreatedJob{**existing, false};
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<CreatedJob> created;
  absl::Status status = InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    created = InsertJob(spec, request_id, create_time);
    return created.status();
  });
  if (!status.ok()) return status;
  return created;
}

absl::StatusOr<JobStore::CreatedJob> SqliteJobStore::InsertJob(const JobSpec& spec,
                                                               const std::string& request_id,
                                                               absl::Time create_time) {
  absl::Status status =
      database_
          ->Prepare(absl::StrCat(
              "INSERT INTO jobs(job_id, request_id, title, priority, numeric_profile, "
              "tile_size_px, pass_sample_count, lease_pass_count, cell_size_px, phase, failure, "
              "create_ns, end_ns) SELECT COALESCE(MAX(job_id) + 1, ",
              spec.pilot ? kFirstPilotId : 1, "), ?,?,?,?,?,?,?,?,0,'',?,? FROM jobs WHERE job_id ",
              spec.pilot ? ">=" : "<", kFirstPilotId))
          .Bind(request_id)
          .Bind(spec.title)
          .Bind(spec.priority)
          .Bind(spec.numeric_profile)
          .Bind(spec.partition.tile_size_px)
          .Bind(spec.partition.pass_sample_count)
          .Bind(spec.partition.lease_pass_count)
          .Bind(spec.partition.cell_size_px)
          .Bind(ToNanoseconds(create_time))
          .Bind(ToNanoseconds(absl::InfiniteFuture()))
          .Run();
  if (!status.ok()) return status;
  const CreatedJob created{static_cast<uint64_t>(database_->LastInsertId()), true};
  if (status = InsertFrames(created.job_id, spec.frames); !status.ok()) return status;
  if (status = InsertEffects(created.job_id, spec.effect_costs); !status.ok()) return status;
  return created;
}

absl::Status SqliteJobStore::InsertFrames(uint64_t job_id, const std::vector<FrameSpec>& frames) {
  SqliteStatement insert = database_->Prepare(
      "INSERT INTO frames(job_id, frame_number, scene_sha256, scene_bytes, frame_digest, "
      "width_px, height_px, x0, y0, x1, y1, samples, max_depth, seed, force_generic, color, "
      "single_scattering, outputs, primaries, white_balance_k, one_sequence, similarity_after, "
      "target_error, time_max_ns, cpu_max_ns, first_round_samples, pixel_stride_px, "
      "resumed_sha256, resumed_bytes, sensor, max_component_value) "
      "VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)");
  for (const FrameSpec& frame : frames) {
    const FrameSettings& s = frame.settings;
    absl::Status status = insert.Bind(job_id)
                              .Bind(frame.frame_number)
                              .Bind(frame.scene.sha256_hex)
                              .Bind(frame.scene.size_bytes)
                              .Bind(frame.frame_digest)
                              .Bind(s.width_px)
                              .Bind(s.height_px)
                              .Bind(s.window.x0)
                              .Bind(s.window.y0)
                              .Bind(s.window.x1)
                              .Bind(s.window.y1)
                              .Bind(s.samples)
                              .Bind(s.max_depth)
                              .Bind(s.seed)
                              .Bind(s.force_generic_variant ? 1 : 0)
                              .Bind(static_cast<int32_t>(s.color))
                              .Bind(s.single_scattering ? 1 : 0)
                              .Bind(FormatOutputs(s.outputs))
                              .Bind(static_cast<int32_t>(s.primaries))
                              .Bind(double{s.white_balance_k})
                              .Bind(s.one_sequence ? 1 : 0)
                              .Bind(s.similarity_after)
                              .Bind(frame.stop.target_error)
                              .Bind(ToNanoseconds(frame.stop.time_max))
                              .Bind(ToNanoseconds(frame.stop.cpu_max))
                              .Bind(frame.stop.first_round_samples)
                              .Bind(s.lattice.stride_px)
                              .Bind(frame.resumed.sha256_hex)
                              .Bind(frame.resumed.size_bytes)
                              .Bind(s.sensor)
                              .Bind(double{s.max_component_value})
                              .Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status SqliteJobStore::InTransaction(const std::function<absl::Status()>& body) {
  absl::Status status = database_->Execute("BEGIN IMMEDIATE");
  if (!status.ok()) return status;
  status = body();
  if (status.ok()) status = database_->Execute("COMMIT");
  if (!status.ok()) database_->Execute("ROLLBACK").IgnoreError();
  return status;
}

absl::Status SqliteJobStore::EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                                    absl::Time end_time, absl::Duration wall) {
  const MutexLock lock(&database_mutex_);
  return database_
      ->Prepare(
          "UPDATE jobs SET phase = ?, failure = ?, end_ns = ?, wall_ns = ?, paused = 0 "
          "WHERE job_id = ?")
      .Bind(static_cast<int32_t>(phase))
      .Bind(failure)
      .Bind(ToNanoseconds(end_time))
      .Bind(ToNanoseconds(wall))
      .Bind(job_id)
      .Run();
}

absl::Status SqliteJobStore::SetPaused(uint64_t job_id, bool paused) {
  const MutexLock lock(&database_mutex_);
  return database_->Prepare("UPDATE jobs SET paused = ? WHERE job_id = ?")
      .Bind(paused ? 1 : 0)
      .Bind(job_id)
      .Run();
}

absl::Status SqliteJobStore::SetPriority(uint64_t job_id, int32_t priority) {
  const MutexLock lock(&database_mutex_);
  return database_->Prepare("UPDATE jobs SET priority = ? WHERE job_id = ?")
      .Bind(priority)
      .Bind(job_id)
      .Run();
}

absl::StatusOr<std::string> SqliteJobStore::OutputPath(const FrameId& frame) {
  const std::string directory = absl::StrCat(directory_, "/outputs/", frame.job_id);
  if (absl::Status status = MakeDirectories(directory); !status.ok()) return status;
  return absl::StrCat(directory, "/", frame.frame_number, ".exr");
}

absl::Status SqliteJobStore::DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) {
  const MutexLock lock(&database_mutex_);
  return database_
      ->Prepare(
          "UPDATE frames SET delivered = 1, picture_digest = ?, relative_mse = ?, wall_ns = ?, "
          "ray_count = ?, nonfinite_count = ?, cpu_ns = ?, sample_count = ?, part_bytes = ?, "
          "relative_mse_upper = ?, stop_reason = ?, tile_count = ?, unreliable_tile_count = ?, "
          "flip = ?, unreliable_layers = ?, one_sequence_gain = ? "
          "WHERE job_id = ? AND frame_number = ?")
      .Bind(delivered.picture_digest)
      .Bind(delivered.relative_mse)
      .Bind(absl::ToInt64Nanoseconds(delivered.wall_duration))
      .Bind(delivered.cost.ray_count)
      .Bind(delivered.cost.nonfinite_count)
      .Bind(absl::ToInt64Nanoseconds(delivered.cost.cpu_duration))
      .Bind(delivered.sample_count)
      .Bind(delivered.cost.part_bytes)
      .Bind(delivered.relative_mse_upper)
      .Bind(static_cast<int32_t>(delivered.stop_reason))
      .Bind(int64_t{delivered.tile_count})
      .Bind(int64_t{delivered.unreliable_tile_count})
      .Bind(delivered.flip)
      .Bind(FormatLayers(delivered.unreliable_layers))
      .Bind(delivered.one_sequence_gain)
      .Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Run();
}

}  // namespace sheaf::coordinator
