// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightPartBytes: the size of a part of light passes, which is as large as the frame.
#pragma once

#include <cstdint>

#include "common/film/film_outputs.h"

namespace sheaf {

// The most bytes that `pass_count` light passes of `pixel_count` pixels take as a part, but for a
// few percent. Requires: pass_count is at most kReplicateCount.
uint64_t LightPartBytes(int64_t pixel_count, const FilmOutputs& outputs, uint64_t pass_count);

}  // namespace sheaf
