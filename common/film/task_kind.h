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

namespace sheaf {

// The numbers are those of messages and of stored parts.
enum class TaskKind : uint8_t { kCamera = 0, kLight = 1, kTraining = 2 };

// A guiding field has at most so many bytes.
inline constexpr size_t kGuidingFieldBytesMax = size_t{32} << 20;

// "camera", "light", "training".
constexpr const char* TaskKindName(TaskKind kind) {
  if (kind == TaskKind::kTraining) return "training";
  return kind == TaskKind::kLight ? "light" : "camera";
}

}  // namespace sheaf
