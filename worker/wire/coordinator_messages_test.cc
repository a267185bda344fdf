// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/wire/coordinator_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace sheaf::worker {
namespace {

void SetRect(v1::PixelRect* rect, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
  rect->set_x0_px(x0);
  rect->set_y0_px(y0);
  rect->set_x1_px(x1);
  rect->set_y1_px(y1);
}

v1::SynchronizeResponse OneLease() {
  v1::SynchronizeResponse response;
  v1::Lease* lease = response.add_leases();
  lease->set_lease_id(7);
  lease->set_frame_name("jobs/1/frames/1");
  lease->mutable_key()->set_frame_digest("frame");
  SetRect(lease->mutable_key()->mutable_tile(), 0, 16, 16, 32);
  lease->mutable_key()->mutable_block()->set_first(8);
  lease->mutable_key()->mutable_block()->set_count(8);
  lease->mutable_scene()->set_sha256_hex(std::string(64, 'a'));
  lease->mutable_settings()->set_width_px(64);
  lease->mutable_settings()->set_height_px(48);
  SetRect(lease->mutable_settings()->mutable_window(), 0, 0, 64, 48);
  lease->mutable_settings()->set_sample_count(16);
  lease->mutable_settings()->set_depth_max(3);
  lease->mutable_settings()->set_seed(5);
  response.mutable_next_synchronize_duration()->set_nanos(250'000'000);
  response.mutable_lease_duration()->set_seconds(30);
  return response;
}

TEST(WireTest, ReadsALease) {
  const absl::StatusOr<DesiredState> state = FromWire(OneLease());
  ASSERT_TRUE(state.ok()) << state.status();
  ASSERT_EQ(state->leases.size(), 1u);
  const Lease& lease = state->leases[0];
  EXPECT_EQ(lease.lease_id, 7u);
  EXPECT_EQ(lease.tile, (PixelRect{0, 16, 16, 32}));
  EXPECT_EQ(lease.block, (SampleBlock{8, 8}));
  EXPECT_EQ(lease.settings.samples, 16u);
  EXPECT_EQ(lease.settings.max_depth, 3);
  EXPECT_EQ(lease.settings.seed, 5u);
  EXPECT_EQ(state->next_synchronize, std::chrono::milliseconds(250));
  EXPECT_EQ(state->lease_duration, std::chrono::seconds(30));
}

v1::SynchronizeResponse OneLightLease() {
  v1::SynchronizeResponse response = OneLease();
  v1::Lease* lease = response.mutable_leases(0);
  lease->mutable_key()->set_kind(v1::TASK_KIND_LIGHT);
  *lease->mutable_key()->mutable_tile() = lease->settings().window();
  lease->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
  return response;
}

TEST(WireTest, LightPassesKeepTheirKind) {
  const absl::StatusOr<DesiredState> state = FromWire(OneLightLease());
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->leases[0].kind, TaskKind::kLight);
  v1::SynchronizeResponse guided = OneLightLease();
  guided.mutable_leases(0)->mutable_settings()->set_techniques(
      v1::TECHNIQUES_CAMERA_AND_LIGHT_GUIDED);
  guided.mutable_leases(0)->mutable_guiding_field()->set_sha256_hex(std::string(64, 'b'));
  guided.mutable_leases(0)->mutable_guiding_field()->set_size_bytes(9);
  EXPECT_TRUE(FromWire(guided).ok());
  EXPECT_EQ(FromWire(OneLease())->leases[0].kind, TaskKind::kCamera);
  FinishedPart part;
  EXPECT_EQ(ToWire(part, "w").key().kind(), v1::TASK_KIND_CAMERA);
  part.kind = TaskKind::kLight;
  EXPECT_EQ(ToWire(part, "w").key().kind(), v1::TASK_KIND_LIGHT);
}

TEST(WireTest, RefusesLightPassesOfOtherFrames) {
  using Change = void (*)(v1::Lease*);
  const Change changes[] = {
      [](v1::Lease* l) { l->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA); },
      [](v1::Lease* l) { l->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_GUIDED); },
      [](v1::Lease* l) { SetRect(l->mutable_key()->mutable_tile(), 0, 0, 16, 16); },
      [](v1::Lease* l) { l->mutable_key()->set_kind(static_cast<v1::TaskKind>(9)); },
      [](v1::Lease* l) {
        l->mutable_key()->set_cell_size_px(16);
        l->mutable_key()->set_cells(1);
      },
  };
  for (const Change& change : changes) {
    v1::SynchronizeResponse response = OneLightLease();
    change(response.mutable_leases(0));
    EXPECT_FALSE(FromWire(response).ok()) << response.leases(0).ShortDebugString();
  }
}

v1::SynchronizeResponse OneTraining() {
  v1::SynchronizeResponse response = OneLease();
  v1::Lease* lease = response.mutable_leases(0);
  lease->mutable_key()->set_kind(v1::TASK_KIND_TRAINING);
  lease->mutable_key()->mutable_block()->set_first(0);
  lease->mutable_key()->mutable_block()->set_count(1);
  *lease->mutable_key()->mutable_tile() = lease->settings().window();
  lease->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_GUIDED);
  return response;
}

TEST(WireTest, GuidedLeasesHaveAField) {
  const absl::StatusOr<DesiredState> training = FromWire(OneTraining());
  ASSERT_TRUE(training.ok()) << training.status();
  EXPECT_EQ(training->leases[0].kind, TaskKind::kTraining);
  v1::SynchronizeResponse response = OneLease();
  v1::Lease* lease = response.mutable_leases(0);
  lease->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_GUIDED);
  EXPECT_FALSE(FromWire(response).ok()) << "without a field";
  lease->mutable_guiding_field()->set_sha256_hex(std::string(64, 'b'));
  lease->mutable_guiding_field()->set_size_bytes(9);
  const absl::StatusOr<DesiredState> guided = FromWire(response);
  ASSERT_TRUE(guided.ok()) << guided.status();
  EXPECT_EQ(guided->leases[0].field, (BlobDigest{std::string(64, 'b'), 9}));
  FinishedPart part;
  EXPECT_FALSE(ToWire(part, "w").has_guiding_field());
  part.field = guided->leases[0].field;
  EXPECT_EQ(ToWire(part, "w").guiding_field().sha256_hex(), std::string(64, 'b'));
  lease->mutable_guiding_field()->set_size_bytes(kGuidingFieldBytesMax + 1);
  EXPECT_FALSE(FromWire(response).ok());
  lease->mutable_guiding_field()->set_size_bytes(9);
  lease->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA);
  EXPECT_FALSE(FromWire(response).ok()) << "a field for nothing";
}

TEST(WireTest, RefusesTrainingsOfOtherFrames) {
  using Change = void (*)(v1::Lease*);
  const Change changes[] = {
      [](v1::Lease* l) { l->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA); },
      [](v1::Lease* l) { SetRect(l->mutable_key()->mutable_tile(), 0, 0, 16, 16); },
      [](v1::Lease* l) { l->mutable_key()->mutable_block()->set_count(2); },
      [](v1::Lease* l) { l->mutable_guiding_field()->set_sha256_hex(std::string(64, 'b')); },
  };
  for (const Change& change : changes) {
    v1::SynchronizeResponse response = OneTraining();
    change(response.mutable_leases(0));
    EXPECT_FALSE(FromWire(response).ok()) << response.leases(0).ShortDebugString();
  }
}

TEST(WireTest, RefusesInvalidLeases) {
  using Change = void (*)(v1::Lease*);
  const Change changes[] = {
      [](v1::Lease* l) { l->mutable_key()->mutable_block()->set_first(4); },
      [](v1::Lease* l) { l->mutable_key()->mutable_block()->set_count(0); },
      [](v1::Lease* l) { l->mutable_key()->mutable_block()->set_first(16); },
      [](v1::Lease* l) { SetRect(l->mutable_key()->mutable_tile(), 8, 8, 8, 16); },
      [](v1::Lease* l) { SetRect(l->mutable_key()->mutable_tile(), 48, 0, 80, 16); },
      [](v1::Lease* l) { l->mutable_key()->set_cells(1); },
      [](v1::Lease* l) { l->mutable_key()->set_cell_size_px(8); },
      [](v1::Lease* l) { l->mutable_settings()->set_width_px(1 << 30); },
      [](v1::Lease* l) { l->mutable_settings()->clear_window(); },
      [](v1::Lease* l) { l->mutable_settings()->set_depth_max(-1); },
      [](v1::Lease* l) { l->mutable_settings()->set_similarity_after_count(-1); },
      [](v1::Lease* l) { l->mutable_scene()->set_sha256_hex("../../secret"); },
  };
  for (const Change change : changes) {
    v1::SynchronizeResponse response = OneLease();
    change(response.mutable_leases(0));
    const absl::Status status = FromWire(response).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("lease 7"));
  }
}

TEST(WireTest, BoundsTheNextCallTime) {
  v1::SynchronizeResponse response;
  EXPECT_GT(FromWire(response)->next_synchronize.count(), 0);
  response.mutable_next_synchronize_duration()->set_seconds(1'000'000'000);
  EXPECT_LE(FromWire(response)->next_synchronize, std::chrono::minutes(1));
  EXPECT_FALSE(FromWire(response)->exit);
  response.set_exit(true);
  EXPECT_TRUE(FromWire(response)->exit);
}

TEST(WireTest, DurationsSaturate) {
  v1::SynchronizeResponse response;
  response.mutable_next_synchronize_duration()->set_seconds(std::numeric_limits<int64_t>::max());
  response.mutable_lease_duration()->set_seconds(std::numeric_limits<int64_t>::min());
  const absl::StatusOr<DesiredState> state = FromWire(response);
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->next_synchronize, std::chrono::minutes(1));
  EXPECT_EQ(state->lease_duration, std::chrono::milliseconds::zero());
}

TEST(WireTest, WritesStateAndHeader) {
  WorkerState state;
  state.worker_id = "host-1-x";
  state.leases = {{3, LeasePhase::kRendering}};
  state.failures = {{4, FailureKind::kMemory, "too large"}};
  state.draining = true;
  const v1::SynchronizeRequest request = ToWire(state);
  EXPECT_EQ(request.leases(0).phase(), v1::LeaseState::PHASE_RENDERING);
  EXPECT_EQ(request.failures(0).kind(), v1::LeaseFailure::KIND_MEMORY);
  EXPECT_TRUE(request.draining());
  FinishedPart part;
  part.cpu_seconds = 2.25;
  part.cells = {8, uint64_t{1} << 63};
  const v1::ResultHeader header = ToWire(part, "host-1-x");
  EXPECT_EQ(header.cpu_duration().seconds(), 2);
  EXPECT_EQ(header.cpu_duration().nanos(), 250'000'000);
  EXPECT_EQ(header.key().cell_size_px(), 8);
  EXPECT_EQ(header.key().cells(), uint64_t{1} << 63);
  EXPECT_FALSE(FromWire(0).ok());
}

}  // namespace
}  // namespace sheaf::worker
