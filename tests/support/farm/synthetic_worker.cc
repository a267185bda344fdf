// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/farm/synthetic_worker.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/light/light_image.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/film/tile_cells.h"
#include "common/math/mix_bits.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/settings_codec.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::coordinator {
namespace {

float Unit(uint64_t bits) { return static_cast<float>(bits & 0xffffff) * 0x1p-24f; }

}  // namespace

std::string SyntheticField(uint64_t seed) { return absl::StrCat("field of ", seed); }

uint64_t GuidedSeed(uint64_t seed, const std::string& field) {
  uint64_t bits = seed + 1;
  for (const char c : field) bits = MixBits(bits + static_cast<uint8_t>(c));
  return bits;
}

FilmSample SyntheticSample(uint64_t seed, int32_t x, int32_t y, uint64_t sample_index) {
  const uint64_t pixel = static_cast<uint64_t>(y) * 65536 + static_cast<uint64_t>(x);
  const uint64_t bits = MixBits(MixBits(MixBits(seed + 1) + pixel) + sample_index);
  FilmSample sample;
  // Magnitudes far apart, so that another order of additions gives other bits.
  const float scale = (bits >> 60) == 0 ? 1000.0f : 1.0f;
  sample.radiance = {Unit(bits) * scale, Unit(bits >> 8) * scale, Unit(bits >> 16)};
  sample.alpha = (bits & 1) != 0 ? 1.0f : 0.0f;
  sample.albedo = {Unit(bits >> 12), Unit(bits >> 20), Unit(bits >> 28)};
  sample.normal = {Unit(bits >> 5), 0.5f, 0.25f};
  sample.depth = 1 + Unit(bits >> 3);
  return sample;
}

FilmTile SyntheticPart(uint64_t seed, PixelRect rect, SampleBlock block) {
  FilmTile tile(rect, block);
  PixelAccumulator accumulator(&tile);
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t i = block.first; i < block.End(); ++i) {
        accumulator.Add(i, SyntheticSample(seed, x, y, i));
      }
      accumulator.End();
    }
  }
  return tile;
}

FilmTile SyntheticLightPart(uint64_t seed, PixelRect window, SampleBlock block) {
  FilmTile part(window, block);
  LightPassAccumulator film(&part);
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (int32_t y = window.y0; y < window.y1; ++y) {
      for (int32_t x = window.x0; x < window.x1; ++x) {
        film.Add(x, y, SyntheticSample(seed + 77, x, y, pass).radiance, 0.25f, std::nullopt);
      }
    }
    film.EndPass();
  }
  film.Finish();
  return part;
}

FrameImage SyntheticImage(const FrameSettings& settings) {
  FrameImage image = MakeFrameImage(settings.window, settings.width_px, settings.height_px);
  const uint64_t seed = NeedsTraining(settings.techniques)
                            ? GuidedSeed(settings.seed, SyntheticField(settings.seed))
                            : settings.seed;
  TileTree tree(settings.window);
  for (const SampleBlock& block : CutSamples(0, settings.samples, uint64_t{1} << 40)) {
    if (!tree.Insert(SyntheticPart(seed, settings.window, block)).ok()) return {};
  }
  DevelopTile(tree.Root(), &image);
  if (!HasLightPaths(settings.techniques)) return image;
  TileTree passes(settings.window);
  for (const SampleBlock& block :
       CutSamples(0, settings.samples, LightPassAccumulator::kPassesMax)) {
    FilmTile part = SyntheticLightPart(seed, settings.window, block);
    if (!passes.Insert(std::move(part)).ok()) return {};
  }
  FrameImage light = MakeFrameImage(settings.window, settings.width_px, settings.height_px),
             sum = light;
  DevelopTile(passes.Root(), &light);
  AddLight(image, light, settings.window, &sum);
  SetLightLayer(light, &sum);
  return sum;
}

void ScalePixelColors(size_t pixel, float factor, FilmTile* part) {
  constexpr std::array kColors = {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi,
                                  FilmChannel::kRedLo, FilmChannel::kGreenLo, FilmChannel::kBlueLo};
  for (const FilmChannel channel : kColors) part->channel(channel)[pixel] *= factor;
  for (uint32_t slot = 0; slot < part->replicate_count(); ++slot) {
    for (size_t color = 0; color < 3; ++color) part->replicate(slot, color)[pixel] *= factor;
  }
}

void ScaleColors(float factor, FilmTile* part) {
  for (size_t pixel = 0; pixel < part->plane_size(); ++pixel) {
    ScalePixelColors(pixel, factor, part);
  }
}

SyntheticWorker::SyntheticWorker(std::shared_ptr<grpc::Channel> channel, std::string worker_id)
    : stub_(v1::WorkerService::NewStub(std::move(channel))),
      worker_id_(std::move(worker_id)),
      numeric_profile_(NumericProfile()) {}

v1::SynchronizeRequest SyntheticWorker::MakeState(int requested_lease_count) const {
  v1::SynchronizeRequest request;
  request.set_worker_id(worker_id_);
  request.set_host("test");
  request.set_numeric_profile(numeric_profile_);
  request.set_thread_count(1);
  request.set_requested_lease_count(requested_lease_count);
  for (const v1::Lease& lease : leases_) {
    v1::LeaseState* state = request.add_leases();
    state->set_lease_id(lease.lease_id());
    state->set_phase(v1::LeaseState::PHASE_RENDERING);
  }
  for (const v1::LeaseFailure& failure : failures_) *request.add_failures() = failure;
  return request;
}

void SyntheticWorker::TakeState(const v1::SynchronizeResponse& response) {
  leases_.assign(response.leases().begin(), response.leases().end());
  failures_.clear();
}

absl::Status SyntheticWorker::Synchronize(int requested_lease_count) {
  grpc::ClientContext context;
  SetDeadline(&context, kUnaryDeadline);
  v1::SynchronizeResponse response;
  const grpc::Status status =
      stub_->Synchronize(&context, MakeState(requested_lease_count), &response);
  if (!status.ok()) return FromGrpcStatus(status);
  TakeState(response);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::UploadResultsResponse::Outcome>> SyntheticWorker::Deliver(
    const std::vector<Upload>& uploads, int requested_lease_count) {
  grpc::ClientContext context;
  SetDeadline(&context, kUnaryDeadline);
  v1::DeliverResultsRequest request;
  *request.mutable_state() = MakeState(requested_lease_count);
  for (const Upload& upload : uploads) {
    v1::DeliveredResult* const result = request.add_results();
    *result->mutable_header() = upload.header;
    result->set_part(upload.bytes);
  }
  v1::DeliverResultsResponse response;
  const grpc::Status status = stub_->DeliverResults(&context, request, &response);
  if (!status.ok()) return FromGrpcStatus(status);
  TakeState(response.desired());
  std::vector<v1::UploadResultsResponse::Outcome> outcomes;
  for (const int outcome : response.outcomes()) {
    outcomes.push_back(static_cast<v1::UploadResultsResponse::Outcome>(outcome));
  }
  return outcomes;
}

SyntheticWorker::Upload SyntheticWorker::MakeUpload(const v1::Lease& lease) const {
  const PixelRect rect = sheaf::FromWire(lease.key().tile());
  const SampleBlock block{lease.key().block().first(), lease.key().block().count()};
  const TileCells cells{lease.key().cell_size_px(), lease.key().cells()};
  if (lease.key().kind() == v1::TASK_KIND_TRAINING) {
    return MakeUploadOf(lease, falsify_ ? "false" : SyntheticField(lease.settings().seed()));
  }
  uint64_t seed = lease.settings().seed();
  if (lease.has_guiding_field()) {
    const absl::StatusOr<std::string> field = ReadField(lease);
    seed = GuidedSeed(seed, field.ok() ? *field : "none");
  }
  const bool is_light = lease.key().kind() == v1::TASK_KIND_LIGHT;
  FilmTile part = is_light ? SyntheticLightPart(seed, rect, block) : FilmTile(rect, block);
  for (const PixelRect& cell : is_light ? std::vector<PixelRect>() : RectsOf(rect, cells)) {
    Paste(SyntheticPart(seed, cell, block), &part);
  }
  if (falsify_) falsify_(&part);
  return MakeUploadOf(lease, EncodePart(part, {lease.key().frame_digest(),
                                               numeric_profile_,
                                               {},
                                               cells,
                                               is_light ? TaskKind::kLight : TaskKind::kCamera}));
}

SyntheticWorker::Upload SyntheticWorker::MakeUploadOf(const v1::Lease& lease,
                                                      std::string bytes) const {
  Upload upload;
  upload.bytes = std::move(bytes);
  if (lease.has_guiding_field()) {
    *upload.header.mutable_guiding_field() = lease.guiding_field();
  }
  *upload.header.mutable_key() = lease.key();
  upload.header.set_lease_id(lease.lease_id());
  upload.header.set_worker_id(worker_id_);
  upload.header.set_token(lease.token());
  upload.header.mutable_digest()->set_sha256_hex(Sha256Hex(upload.bytes));
  upload.header.mutable_digest()->set_size_bytes(upload.bytes.size());
  upload.header.set_ray_count(10);
  upload.header.mutable_cpu_duration()->set_nanos(1'000'000);
  return upload;
}

absl::StatusOr<std::string> SyntheticWorker::ReadField(const v1::Lease& lease) const {
  grpc::ClientContext context;
  SetDeadline(&context, kUnaryDeadline);
  v1::ReadGuidingFieldRequest request;
  request.set_frame_name(lease.frame_name());
  *request.mutable_digest() = lease.guiding_field();
  const auto reader = stub_->ReadGuidingField(&context, request);
  v1::ReadGuidingFieldResponse response;
  std::string bytes;
  while (reader->Read(&response)) bytes += response.chunk();
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return FromGrpcStatus(status);
  if (Sha256Hex(bytes) == lease.guiding_field().sha256_hex()) return bytes;
  return absl::DataLossError("these are not the bytes of the field");
}

absl::StatusOr<v1::UploadResultsResponse::Outcome> SyntheticWorker::Send(
    const Upload& upload) const {
  grpc::ClientContext context;
  SetDeadline(&context, kUnaryDeadline);
  v1::UploadResultsResponse response;
  const auto writer = stub_->UploadResults(&context, &response);
  // In at least two messages, to test assembly.
  const size_t half = upload.bytes.size() / 2;
  v1::UploadResultsRequest message;
  *message.mutable_header() = upload.header;
  size_t length = std::min(half, kStreamChunkBytesMax);
  message.set_chunk(upload.bytes.substr(0, length));
  for (size_t offset = length; writer->Write(message) && offset < upload.bytes.size();
       offset += length) {
    length = std::min(upload.bytes.size() - offset, kStreamChunkBytesMax);
    message.clear_header();
    message.set_chunk(upload.bytes.substr(offset, length));
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (!status.ok()) return FromGrpcStatus(status);
  if (response.outcomes_size() != 1)
    return absl::InternalError("expected one outcome for one result");
  return response.outcomes(0);
}

absl::StatusOr<v1::UploadResultsResponse::Outcome> SyntheticWorker::RenderOne() {
  const v1::Lease lease = leases_.front();
  leases_.erase(leases_.begin());
  return Send(MakeUpload(lease));
}

absl::StatusOr<int> SyntheticWorker::RenderAll() {
  int accepted = 0;
  while (true) {
    if (absl::Status status = Synchronize(4); !status.ok()) return status;
    if (leases_.empty()) return accepted;
    while (!leases_.empty()) {
      const absl::StatusOr<v1::UploadResultsResponse::Outcome> outcome = RenderOne();
      if (!outcome.ok()) return outcome.status();
      accepted += *outcome == v1::UploadResultsResponse::OUTCOME_ACCEPTED ? 1 : 0;
    }
  }
}

void SyntheticWorker::ReportFailure(uint64_t lease_id, v1::LeaseFailure::Kind kind,
                                    const std::string& message) {
  v1::LeaseFailure failure;
  for (const v1::Lease& lease : leases_) {
    if (lease.lease_id() == lease_id) failure.set_token(lease.token());
  }
  std::erase_if(leases_, [&](const v1::Lease& lease) { return lease.lease_id() == lease_id; });
  failure.set_lease_id(lease_id);
  failure.set_kind(kind);
  failure.set_message(message);
  failures_.push_back(failure);
}

}  // namespace sheaf::coordinator
