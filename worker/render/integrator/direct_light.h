// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DirectLight: the techniques by which a path finds light.
#pragma once

#include <cstdint>

namespace sheaf::render {

// The techniques that find the light at a vertex. Images are made with kByBoth, which combines all;
// the others have the same expectation and exist for tests. Delta lights can only be sampled, and
// lights seen directly or along specular reflections can only be hit. kByEquiangular: as kByBoth,
// but light that line sampling can find in a medium is found by it alone.
enum class DirectLight : uint8_t { kByBoth, kBySampling, kByHitting, kByEquiangular };

}  // namespace sheaf::render
