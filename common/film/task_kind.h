// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TaskKind: the kind of path that a task traces, and so what its samples are. Paths from the camera
// are samples of one pixel each; a tile's task traces those of its pixels. Light paths reach any
// pixel of the frame, so the tasks of a frame's light paths share one tile, the light tile: its
// rectangle is the frame's window, and its sample n of a pixel is the sum of all splats of light
// pass n there (light_pass_accumulator.h, docs/adr/0063).
#pragma once

#include <cstdint>

namespace sheaf {

// The numbers are those of messages and of stored parts.
enum class TaskKind : uint8_t { kCamera = 0, kLight = 1 };

// "camera", "light".
constexpr const char* TaskKindName(TaskKind kind) {
  return kind == TaskKind::kLight ? "light" : "camera";
}

}  // namespace sheaf
