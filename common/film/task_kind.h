// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TaskKind: the kind of path that a task traces, and so what its result is. Paths from the camera
// are samples of one pixel each; a tile's task traces those of its pixels. Light paths reach any
// pixel of the frame, so the tasks of a frame's light paths share one tile, the light tile: its
// rectangle is the frame's window, and its sample n of a pixel is the sum of all splats of light
// pass n there (light_pass_accumulator.h, docs/adr/0063). Training paths are no part of the image:
// the one task of a frame's training yields the bytes of its guiding field (docs/adr/0066). It has
// the frame's window as its tile and one sample, which counts as none of the frame's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/film/film_outputs.h"

namespace sheaf {

// The numbers are those of messages and of stored parts.
enum class TaskKind : uint8_t { kCamera = 0, kLight = 1, kTraining = 2 };

// The most bytes of a guiding field.
inline constexpr size_t kGuidingFieldBytesMax = size_t{32} << 20;

// "camera", "light", "training".
constexpr const char* TaskKindName(TaskKind kind) {
  if (kind == TaskKind::kTraining) return "training";
  return kind == TaskKind::kLight ? "light" : "camera";
}

// --- The bias of merging. Light passes whose paths are merged with camera paths blur the light,
// and estimate by how much. The estimate is an output of the light tile alone, at the end of its
// means: of all passes, and of those of even replicates, so that the two halves are independent.

// The bit of FilmOutputs::aovs, beside those of Aov and kDenoisedBit.
inline constexpr uint32_t kMergeBiasBit = 1U << 30;
static_assert(kAovCount <= 30);
inline bool HasMergeBias(const FilmOutputs& outputs) { return (outputs.aovs & kMergeBiasBit) != 0; }
inline void AddMergeBias(FilmOutputs* outputs) { outputs->aovs |= kMergeBiasBit; }
inline constexpr size_t kMergeBiasMeanCount = 6;
// component: "R", "G" or "B".
inline std::string MergeBiasChannel(const std::string& component) {
  return "merge.bias." + component;
}
inline std::string EvenMergeBiasChannel(const std::string& component) {
  return "merge.bias.even." + component;
}

}  // namespace sheaf
