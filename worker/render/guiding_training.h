// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Training: learns the guiding field of a scene from paths of its own, before the first sample of
// the image. Each iteration traces twice as many paths as the last, guided by the field that the
// last has made. The paths are spread over the whole frame, and their number does not depend on it
// nor on its samples, so that a crop, a refinement and a rendering in rounds have the same field.
// docs/adr/0065.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "worker/render/scene/compile_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {

// Learns the fields, as bytes. A pure function of the scene and its settings, to the bit, whatever
// `threads`. Adds rays and CPU time (of all threads) to *stats; may be null. Errors: kCancelled
// when stop was requested; kInvalidArgument where the frame needs no training.
absl::StatusOr<std::string> TrainGuiding(const CompiledScene& scene, uint32_t threads,
                                         std::stop_token stop, RenderStats* stats);

// A training of other sizes than the frame's own: paths of the first iteration.
struct TrainingPaths {
  uint64_t first = 0;           // 0: as many as the scene says.
  uint64_t emission_first = 0;  // 0: as `first`; where emission is guided.
  // 0: as `first`, times 2^kLightsShift; where lights are learned without guiding.
  uint64_t lights = 0;
};
// Rays of a training, by what they learned.
struct TrainingRays {
  uint64_t camera = 0, emission = 0;
};
// As TrainGuiding on the calling thread, with other sizes.
absl::StatusOr<std::string> TrainGuidingOfSize(const CompiledScene& scene,
                                               const TrainingPaths& paths, TrainingRays* rays);

// Gives the scene the fields that TrainGuiding made, unless it has some. Thread-safe; call before
// the first pass is rendered. Errors: kDataLoss for other bytes.
absl::Status SetGuiding(const CompiledScene& scene, std::string_view fields);

// Learns the fields on all of the machine's threads, unless the scene is not guided or has fields.
// Thread-safe: callers wait for the one that learns. Errors: as TrainGuiding.
absl::Status EnsureGuiding(const CompiledScene& scene, std::stop_token stop);

}  // namespace sheaf::render
