// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SyntheticWorker, for tests: a worker that speaks the real protocol and whose samples are a cheap,
// deterministic function of frame, pixel and index, so that an image's digest can be computed
// directly and compared.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "common/scene/settings/render_settings.h"
#include "sheaf/v1/worker.grpc.pb.h"

namespace sheaf::coordinator {

// The guiding field of frames with the seed, and the seed of the samples that are rendered with it.
std::string SyntheticField(uint64_t seed);
uint64_t GuidedSeed(uint64_t seed, const std::string& field);
// The sample that every renderer of the tests agrees on.
FilmSample SyntheticSample(uint64_t seed, int32_t x, int32_t y, uint64_t sample_index);
// A part made of such samples.
FilmTile SyntheticPart(uint64_t seed, PixelRect rect, SampleBlock block);
// The same of light passes.
FilmTile SyntheticLightPart(uint64_t seed, PixelRect window, SampleBlock block);
// The image of such samples, added up without any farm.
FrameImage SyntheticImage(const FrameSettings& settings);

// Makes a part false in a way that checks of its values do not detect: all colors brighter, or
// those of one pixel.
void ScaleColors(float factor, FilmTile* part);
void ScalePixelColors(size_t pixel, float factor, FilmTile* part);

class SyntheticWorker {
 public:
  SyntheticWorker(std::shared_ptr<grpc::Channel> channel, std::string worker_id);

  // One Synchronize with everything it holds; keeps the answer.
  absl::Status Synchronize(int requested_lease_count);
  // Renders and uploads one held lease. Errors: those of the call.
  absl::StatusOr<v1::UploadResultsResponse::Outcome> RenderOne();
  // Renders until there is nothing to do; returns how many results were accepted.
  absl::StatusOr<int> RenderAll();

  // The upload of a result as it goes over the wire, for tests that bend it.
  struct Upload {
    v1::ResultHeader header;
    std::string bytes;
  };
  // For a guided frame, it reads the field first.
  Upload MakeUpload(const v1::Lease& lease) const;
  // The bytes of the lease's guiding field. Errors: those of the call; kDataLoss.
  absl::StatusOr<std::string> ReadField(const v1::Lease& lease) const;
  absl::StatusOr<v1::UploadResultsResponse::Outcome> Send(const Upload& upload) const;
  // The results and one Synchronize in one call; keeps its answer. Returns one outcome per result.
  absl::StatusOr<std::vector<v1::UploadResultsResponse::Outcome>> Deliver(
      const std::vector<Upload>& uploads, int requested_lease_count);

  const std::vector<v1::Lease>& leases() const { return leases_; }
  void ReportFailure(uint64_t lease_id, v1::LeaseFailure::Kind kind, const std::string& message);
  // Changes each part before it is sent; guiding fields are then false, too.
  void set_falsify(std::function<void(FilmTile*)> falsify) { falsify_ = std::move(falsify); }
  void set_numeric_profile(const std::string& profile) { numeric_profile_ = profile; }

 private:
  v1::SynchronizeRequest MakeState(int requested_lease_count) const;
  void TakeState(const v1::SynchronizeResponse& response);
  Upload MakeUploadOf(const v1::Lease& lease, std::string bytes) const;

  std::unique_ptr<v1::WorkerService::Stub> stub_;
  const std::string worker_id_;
  std::string numeric_profile_;
  std::vector<v1::Lease> leases_;
  std::vector<v1::LeaseFailure> failures_;
  std::function<void(FilmTile*)> falsify_;
};

}  // namespace sheaf::coordinator
