// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/tests/test_databases.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class JobStoreTest : public JobStoreFixture {
 protected:
  static JobSpec MakeSpec() {
    JobSpec spec;
    spec.title = "a 'title' with \xC3\xA4";
    spec.priority = -3;
    spec.numeric_profile = "profile";
    spec.partition = {16, 4, 2, 8};
    for (int32_t number : {-5, 7}) {
      FrameSpec frame;
      frame.frame_number = number;
      frame.scene = {std::string(64, 'a'), 12};
      frame.frame_digest = std::string(64, 'f');
      frame.settings.width_px = 640;
      frame.settings.height_px = 480;
      frame.settings.window = {1, 2, 3, 4};
      frame.settings.samples = 77;
      frame.settings.max_depth = 9;
      frame.settings.seed = UINT64_MAX - 1;
      frame.settings.color = ColorTransport::kSpectral;
      frame.settings.single_scattering = true;
      frame.settings.outputs.Add(Aov::kUv);
      frame.settings.primaries = Primaries::kRec2020;
      frame.settings.white_balance_k = 3200.5f;
      frame.settings.one_sequence = true;
      frame.settings.similarity_after = 24;
      frame.settings.light_samples = 8;
      frame.settings.techniques =
          number == 7 ? TechniqueSet::kCameraAndLightGuided : TechniqueSet::kLight;
      frame.settings.sensor = "nikon_d850";
      frame.settings.max_component_value = 12.5f;
      frame.settings.lattice = {8, frame.settings.seed};
      frame.resumed = {std::string(64, 'd'), 55};
      frame.stop = {.target_error = 0.25, .cpu_max = absl::Hours(3)};
      spec.frames.push_back(frame);
    }
    spec.effect_costs = {{"lens", "", "a pinhole", 0.25, 0.01, -0.002, 0.003, 1e-4, 1.5},
                         {"indirect light", "the time limit was reached", "", 0, 0, 0, 0, 0, 0}};
    return spec;
  }
  uint64_t CreateJob(const std::string& request_id = "r") {
    return store_->CreateJob(MakeSpec(), request_id, absl::FromUnixSeconds(100))->job_id;
  }
  static PartRow MakePart(uint64_t job, uint64_t first, const std::string& bytes) {
    PartRow row;
    row.key = {{job, 7}, {0, 16, 16, 32}, {first, 16}};
    row.digest = {Sha256Hex(bytes), bytes.size()};
    row.worker_id = "w";
    row.cost = {11, 1, absl::Milliseconds(5)};
    return row;
  }
};

TEST_P(JobStoreTest, FailuresSurviveAReopen) {
  const uint64_t other = CreateJob("other"), job = CreateJob();
  const FailureRecord first{7,  {0, 16, 16, 32},       {16, 32}, "w", FailureKind::kLost,
                            "", absl::FromUnixNanos(9)};
  FailureRecord second = first;
  second.message = "the 'second'";
  ASSERT_TRUE(store_->WriteFailures(job, {{first}, 1}).ok());
  ASSERT_TRUE(store_->WriteFailures(job, {{second, first}, 40}).ok());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  ASSERT_EQ(jobs->at(0).spec.job_id, other);
  EXPECT_EQ(jobs->at(0).failures.count, 0);
  EXPECT_TRUE(jobs->at(0).failures.last.empty());
  EXPECT_EQ(jobs->at(1).failures.count, 40);
  EXPECT_EQ(jobs->at(1).failures.last, (std::deque<FailureRecord>{second, first}));
}

TEST_P(JobStoreTest, JobsSurviveAReopen) {
  const uint64_t job = CreateJob();
  ASSERT_TRUE(
      store_
          ->DeliverFrame({job, 7}, {.image_digest = "digest",
                                    .relative_mse = 0.5,
                                    .left_eye_relative_mse = 0.5,
                                    .right_eye_relative_mse = 0.25,
                                    .eye_difference_relative_mse = 0.125,
                                    .flip = 0.0625,
                                    .one_sequence_gain = 1.5,
                                    .relative_mse_upper = 0.75,
                                    .stop_reason = StopReason::kTime,
                                    .sample_count = 1234,
                                    .tile_count = 12,
                                    .unreliable_tile_count = 3,
                                    .unreliable_layers = {{"caustic", 7}, {"volume-single", 2}},
                                    .wall_duration = absl::Seconds(3),
                                    .cost = {1, 2, absl::Seconds(4), 5}})
          .ok());
  ASSERT_TRUE(store_->EndJob(job, JobPhase::kFailed, "why", absl::FromUnixSeconds(200), {}).ok());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  ASSERT_EQ(jobs->size(), 1u);
  const StoredJob& stored = jobs->front();
  const JobSpec spec = MakeSpec();
  EXPECT_EQ(stored.spec.title, spec.title);
  EXPECT_EQ(stored.spec.priority, -3);
  EXPECT_EQ(stored.spec.partition.lease_pass_count, 2u);
  EXPECT_EQ(stored.spec.partition.cell_size_px, 8);
  EXPECT_EQ(stored.spec.effect_costs, spec.effect_costs);
  EXPECT_EQ(stored.phase, JobPhase::kFailed);
  EXPECT_EQ(stored.failure, "why");
  EXPECT_EQ(stored.create_time, absl::FromUnixSeconds(100));
  EXPECT_EQ(stored.end_time, absl::FromUnixSeconds(200));
  ASSERT_EQ(stored.spec.frames.size(), 2u);
  EXPECT_EQ(stored.spec.frames[0].frame_number, -5);
  EXPECT_EQ(stored.spec.frames[1].settings.seed, UINT64_MAX - 1);
  EXPECT_EQ(stored.spec.frames[1].settings.color, ColorTransport::kSpectral);
  EXPECT_TRUE(stored.spec.frames[1].settings.single_scattering);
  EXPECT_TRUE(stored.spec.frames[1].settings.outputs.Has(Aov::kUv));
  EXPECT_EQ(stored.spec.frames[1].settings.primaries, Primaries::kRec2020);
  EXPECT_EQ(stored.spec.frames[1].settings.white_balance_k, 3200.5f);
  EXPECT_TRUE(stored.spec.frames[1].settings.one_sequence);
  EXPECT_EQ(stored.spec.frames[1].settings.similarity_after, 24);
  EXPECT_EQ(stored.spec.frames[1].settings.light_samples, 8);
  EXPECT_EQ(stored.spec.frames[0].settings.techniques, TechniqueSet::kLight);
  EXPECT_EQ(stored.spec.frames[1].settings.techniques, TechniqueSet::kCameraAndLightGuided);
  EXPECT_EQ(stored.spec.frames[1].settings.sensor, "nikon_d850");
  EXPECT_EQ(stored.spec.frames[1].settings.max_component_value, 12.5f);
  EXPECT_EQ(stored.spec.frames[1].settings.lattice, (PixelLattice{8, UINT64_MAX - 1}));
  EXPECT_EQ(stored.spec.frames[1].resumed, MakeSpec().frames[1].resumed);
  EXPECT_EQ(stored.spec.frames[1].settings.window, (PixelRect{1, 2, 3, 4}));
  ASSERT_EQ(stored.delivered.size(), 1u);
  EXPECT_EQ(stored.spec.frames[1].stop, MakeSpec().frames[1].stop);
  const DeliveredFrame& delivered = stored.delivered[0].delivered;
  EXPECT_EQ(delivered.relative_mse_upper, 0.75);
  EXPECT_EQ(delivered.stop_reason, StopReason::kTime);
  EXPECT_EQ(delivered.left_eye_relative_mse, 0.5);
  EXPECT_EQ(delivered.right_eye_relative_mse, 0.25);
  EXPECT_EQ(delivered.eye_difference_relative_mse, 0.125);
  EXPECT_EQ(delivered.flip, 0.0625);
  EXPECT_EQ(delivered.one_sequence_gain, 1.5);
  EXPECT_EQ(delivered.unreliable_layers,
            (std::vector<LayerCount>{{"caustic", 7}, {"volume-single", 2}}));
  EXPECT_EQ(delivered.sample_count, 1234u);
  EXPECT_EQ(delivered.tile_count, 12u);
  EXPECT_EQ(delivered.unreliable_tile_count, 3u);
  EXPECT_EQ(delivered.cost.cpu_duration, absl::Seconds(4));
  EXPECT_EQ(delivered.cost.part_bytes, 5u);
}

TEST_P(JobStoreTest, PauseAndPrioritySurviveAReopenUntilTheEnd) {
  const uint64_t job = CreateJob();
  ASSERT_TRUE(store_->ChangeJob(job, {.paused = true}).ok());
  ASSERT_TRUE(store_->ChangeJob(job, {.priority = 17}).ok());
  Reopen();
  EXPECT_TRUE((*store_->LoadJobs())[0].paused);
  EXPECT_EQ((*store_->LoadJobs())[0].spec.priority, 17);
  ASSERT_TRUE(store_->EndJob(job, JobPhase::kCancelled, "", absl::UnixEpoch(), {}).ok());
  EXPECT_FALSE((*store_->LoadJobs())[0].paused);
}

TEST_P(JobStoreTest, RoundsSurviveAReopen) {
  const uint64_t job = CreateJob();
  RoundRecord round;
  round.round = 0;
  round.cells = {{16, {256, 0.5, 0.25}}, {16, {128, 1.5, 1.25}}};
  round.samples_next = {32, 48};
  round.relative_mse = 0.125;
  round.relative_mse_upper = 0.5;
  round.predicted_relative_mse = 0.0625;
  round.sample_count = 6144;
  round.sample_count_expected = 9999;
  round.wall_duration = absl::Seconds(7);
  round.cost = {11, 1, absl::Milliseconds(5), 99};
  RoundRecord last = round;
  last.round = 1;
  last.samples_next.clear();
  last.stop_reason = StopReason::kTargetError;
  ASSERT_TRUE(store_->AddRound({job, 7}, last).ok());
  ASSERT_TRUE(store_->AddRound({job, 7}, round).ok());
  RoundRecord again = round;
  again.relative_mse = 0.75;  // A stored decision is never changed.
  ASSERT_TRUE(store_->AddRound({job, 7}, again).ok());
  Reopen();
  const auto rounds = store_->LoadRounds(job, /*with_cells=*/true);
  ASSERT_TRUE(rounds.ok()) << rounds.status();
  ASSERT_EQ(rounds->size(), 2u);
  const RoundRecord& first = rounds->front().record;
  EXPECT_EQ(rounds->front().frame_number, 7);
  EXPECT_EQ(first.samples_next, round.samples_next);
  ASSERT_EQ(first.cells.size(), 2u);
  EXPECT_EQ(first.cells[1].samples, 16u);
  EXPECT_EQ(first.cells[1].error.pixel_count, 128);
  EXPECT_EQ(first.cells[1].error.sum, 1.5);
  EXPECT_EQ(first.cells[1].error.square_sum, 1.25);
  EXPECT_EQ(first.relative_mse, 0.125);
  EXPECT_EQ(first.relative_mse_upper, 0.5);
  EXPECT_EQ(first.predicted_relative_mse, 0.0625);
  EXPECT_EQ(first.sample_count, 6144u);
  EXPECT_EQ(first.sample_count_expected, 9999u);
  EXPECT_EQ(first.wall_duration, absl::Seconds(7));
  EXPECT_EQ(first.cost.part_bytes, 99u);
  EXPECT_EQ(first.cost.cpu_duration, absl::Milliseconds(5));
  EXPECT_TRUE(rounds->back().record.samples_next.empty());
  EXPECT_EQ(rounds->back().record.stop_reason, StopReason::kTargetError);
  EXPECT_TRUE(store_->LoadRounds(job, /*with_cells=*/false)->front().record.cells.empty());
  EXPECT_EQ(store_->LoadFrameRounds({job, 7})->at(1).cells.size(), 2u);
  EXPECT_TRUE(store_->LoadFrameRounds({job, -5})->empty());
}

TEST_P(JobStoreTest, EqualRequestIdsMeanTheSameJob) {
  const uint64_t job = CreateJob("r1");
  const auto again = store_->CreateJob(MakeSpec(), "r1", absl::FromUnixSeconds(300));
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->job_id, job);
  EXPECT_FALSE(again->is_new);
  EXPECT_NE(CreateJob("r2"), job);
}

TEST_P(JobStoreTest, PartsSurviveAReopen) {
  const uint64_t job = CreateJob();
  const PartRow row = MakePart(job, 16, "some bytes");
  ASSERT_TRUE(store_->WritePart(row, "some bytes").ok());
  EXPECT_EQ(store_->WritePart(row, "some bytes").code(), absl::StatusCode::kAlreadyExists);
  Reopen();
  const auto parts = store_->LoadParts(job);
  ASSERT_TRUE(parts.ok() && parts->rows.size() == 1u);
  EXPECT_TRUE(parts->lost.empty());
  EXPECT_EQ(parts->rows[0].key, row.key);
  EXPECT_EQ(parts->rows[0].cost.ray_count, 11u);
  EXPECT_EQ(*store_->ReadPart(parts->rows[0]), "some bytes");
  EXPECT_EQ(store_->PartsBytes(), 10u);
}

TEST_P(JobStoreTest, PartsAreKeyedByCells) {
  Reopen(Durability::kProcess);  // As in a single-machine farm.
  const uint64_t job = CreateJob();
  std::vector<PartRow> rows;
  for (const TileCells& cells : {TileCells{}, {8, 5}, {8, uint64_t{1} << 63}}) {
    PartRow row = MakePart(job, 16, absl::StrCat("bytes ", cells.mask));
    row.key.cells = cells;
    ASSERT_TRUE(store_->WritePart(row, absl::StrCat("bytes ", cells.mask)).ok());
    rows.push_back(row);
  }
  Reopen();
  for (int twice = 0; twice < 2; ++twice) ASSERT_TRUE(store_->RemovePart(rows[1]).ok());
  EXPECT_EQ(store_->PartsBytes(), rows[0].digest.size_bytes + rows[2].digest.size_bytes);
  EXPECT_FALSE(store_->FindPart(rows[1].key)->has_value());
  for (const size_t i : {0, 2}) {
    const auto found = store_->FindPart(rows[i].key);
    ASSERT_TRUE(found->has_value());
    EXPECT_EQ(*store_->ReadPart(**found), absl::StrCat("bytes ", rows[i].key.cells.mask));
  }
  EXPECT_EQ(store_->FindTileParts(rows[0].key.frame, rows[0].key.tile, TaskKind::kCamera)->size(),
            2u);
}

// A light part may have the rectangle and the passes of a tile's part.
TEST_P(JobStoreTest, PartsAreKeyedByTheKindOfTheirTask) {
  const uint64_t job = CreateJob();
  const PartRow camera = MakePart(job, 16, "camera");
  PartRow light = MakePart(job, 16, "light");
  light.key.kind = TaskKind::kLight;
  ASSERT_TRUE(store_->WritePart(camera, "camera").ok());
  ASSERT_TRUE(store_->WritePart(light, "light").ok());
  Reopen();
  EXPECT_EQ(store_->LoadParts(job)->rows.size(), 2u);
  const auto of_light = store_->FindTileParts(light.key.frame, light.key.tile, TaskKind::kLight);
  ASSERT_TRUE(of_light.ok() && of_light->size() == 1u);
  EXPECT_EQ(of_light->front().key, light.key);
  EXPECT_EQ(*store_->ReadPart(of_light->front()), "light");
  // The time of the light tile is that of no place in the image.
  const auto costs = store_->TileCosts(light.key.frame);
  ASSERT_TRUE(costs.ok() && costs->size() == 1u);
  EXPECT_EQ(costs->front().cpu_duration, camera.cost.cpu_duration);
  ASSERT_TRUE(store_->RemovePart(light).ok());
  EXPECT_FALSE(store_->FindPart(light.key)->has_value());
  EXPECT_TRUE(store_->FindPart(camera.key)->has_value());
}

TEST_P(JobStoreTest, GuidingFieldsAreKeptBesideParts) {
  const uint64_t job = CreateJob();
  const std::string bytes = "a field";
  PartRow field = MakePart(job, 0, bytes);
  field.key.kind = TaskKind::kTraining;
  PartRow part = MakePart(job, 0, "part");
  part.field = field.digest.sha256_hex;
  ASSERT_TRUE(store_->WritePart(field, bytes).ok());
  ASSERT_TRUE(store_->WritePart(part, "part").ok());
  EXPECT_EQ(std::filesystem::path(store_->PartPath(field)).extension(), ".field");
  Reopen();
  const auto loaded = store_->LoadParts(job);
  ASSERT_TRUE(loaded.ok() && loaded->rows.size() == 2u);
  EXPECT_TRUE(loaded->lost.empty());
  EXPECT_EQ(*store_->ReadPart(**store_->FindPart(field.key)), bytes);
  EXPECT_EQ((*store_->FindPart(part.key))->field, field.digest.sha256_hex);
  EXPECT_EQ((*store_->FindPart(field.key))->field, "");
  std::filesystem::resize_file(store_->PartPath(field), 2);
  EXPECT_TRUE(absl::IsDataLoss(store_->ReadPart(field).status()));
  ASSERT_TRUE(store_->RemoveFrameParts(field.key.frame).ok());
  EXPECT_FALSE(std::filesystem::exists(store_->PartPath(field)));
  EXPECT_EQ(store_->PartsBytes(), 0u);
}

TEST_P(JobStoreTest, FilesWithoutRowsAreRemoved) {
  const uint64_t job = CreateJob();
  const PartRow kept = MakePart(job, 0, "kept");
  ASSERT_TRUE(store_->WritePart(kept, "kept").ok());
  // A killed process leaves behind a part's file without its row, and a half-written file.
  const PartRow orphan = MakePart(job, 16, "orphan");
  std::ofstream(store_->PartPath(orphan)) << "orphan";
  std::ofstream(store_->PartPath(orphan) + ".tmp-1-1") << "orp";
  Reopen();
  const auto parts = store_->LoadParts(job);
  ASSERT_TRUE(parts.ok());
  EXPECT_EQ(parts->rows.size(), 1u);
  EXPECT_EQ(parts->files_without_row, 1);
  EXPECT_FALSE(std::filesystem::exists(store_->PartPath(orphan)));
  EXPECT_FALSE(std::filesystem::exists(store_->PartPath(orphan) + ".tmp-1-1"));
  EXPECT_TRUE(store_->WritePart(orphan, "orphan").ok());
}

TEST_P(JobStoreTest, RowsWithoutFilesAreLost) {
  const uint64_t job = CreateJob();
  const PartRow row = MakePart(job, 0, "bytes");
  ASSERT_TRUE(store_->WritePart(row, "bytes").ok());
  std::filesystem::resize_file(store_->PartPath(row), 2);
  Reopen();
  auto parts = store_->LoadParts(job);
  ASSERT_TRUE(parts.ok());
  EXPECT_TRUE(parts->rows.empty());
  EXPECT_EQ(parts->files_without_row, 0);
  ASSERT_EQ(parts->lost.size(), 1u);
  EXPECT_EQ(parts->lost[0].key, row.key);
  ASSERT_TRUE(store_->RemovePart(parts->lost[0]).ok());
  EXPECT_TRUE(store_->LoadParts(job)->lost.empty());
}

TEST_P(JobStoreTest, DamagedBytesAreDataLoss) {
  const uint64_t job = CreateJob();
  const PartRow row = MakePart(job, 0, "bytes");
  ASSERT_TRUE(store_->WritePart(row, "bytes").ok());
  std::ofstream(store_->PartPath(row)) << "bytez";
  EXPECT_EQ(store_->ReadPart(row).status().code(), absl::StatusCode::kDataLoss);
  std::filesystem::remove(store_->PartPath(row));
  EXPECT_EQ(store_->ReadPart(row).status().code(), absl::StatusCode::kNotFound);
}

TEST_P(JobStoreTest, ConcurrentWritesShareCommits) {
  const uint64_t job = CreateJob();
  std::vector<std::thread> threads;
  for (uint64_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (uint64_t i = 0; i < 8; ++i) {
        const std::string bytes = absl::StrCat("part ", t, " ", i);
        EXPECT_TRUE(store_->WritePart(MakePart(job, (t * 8 + i) * 16, bytes), bytes).ok());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  Reopen();
  EXPECT_EQ(store_->LoadParts(job)->rows.size(), 32u);
  ASSERT_TRUE(store_->RemoveFrameParts({job, 7}).ok());
  EXPECT_EQ(store_->LoadParts(job)->rows.size(), 0u);
}

TEST_P(JobStoreTest, TileCostsAreSummed) {
  const uint64_t job = CreateJob();
  PartRow row = MakePart(job, 0, "one");
  ASSERT_TRUE(store_->WritePart(row, "one").ok());
  PartRow next = MakePart(job, 16, "two");
  ASSERT_TRUE(store_->WritePart(next, "two").ok());
  const auto costs = store_->TileCosts(row.key.frame);
  ASSERT_TRUE(costs.ok());
  ASSERT_EQ(costs->size(), 1u);
  EXPECT_EQ(costs->at(0).tile, row.key.tile);
  EXPECT_EQ(costs->at(0).cpu_duration, row.cost.cpu_duration + next.cost.cpu_duration);
  EXPECT_TRUE(store_->TileCosts({job, 99})->empty());
}

// A job whose rows are lost has an image, which another job must not replace.
TEST_P(JobStoreTest, IdsOfJobsWithFilesAreNotGivenAgain) {
  const uint64_t job = CreateJob("r1");
  std::filesystem::create_directory(absl::StrCat(directory_, "/outputs/", job + 3));
  std::filesystem::create_directory(absl::StrCat(directory_, "/parts/", kFirstPilotId + 5));
  Reopen();
  EXPECT_EQ(CreateJob("r2"), job + 4);
  EXPECT_EQ(CreateJob("r3"), job + 5);
  JobSpec pilot = MakeSpec();
  pilot.pilot = true;
  EXPECT_EQ(store_->CreateJob(pilot, "r4", absl::UnixEpoch())->job_id, kFirstPilotId + 6);
}

TEST_P(JobStoreTest, LeaseIdsAreUniqueAcrossRestarts) {
  const uint64_t first = store_->FirstLeaseId();
  Reopen();
  EXPECT_GE(store_->FirstLeaseId(), first + (uint64_t{1} << 40));
}

TEST_P(JobStoreTest, SecondStoreOnADirectoryIsRefused) {
  // With PostgreSQL the epoch protects it (ownership_test.cc).
  if (GetParam() == DatabaseKind::kPostgres) {
    GTEST_SKIP() << "with PostgreSQL the epoch protects the state (ownership_test.cc)";
  }
  const absl::Status status = OpenStore().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr(directory_));
}

SHEAF_ON_ALL_DATABASES(JobStoreTest);

}  // namespace
}  // namespace sheaf::coordinator
