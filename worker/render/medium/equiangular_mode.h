// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EquiangularMode: in which heterogeneous media equiangular sampling is used.
#pragma once

#include <cstdint>

namespace sheaf::render {

// Whether lines through heterogeneous media gather light.
enum class EquiangularMode : uint8_t { kWhereEfficient, kAlways, kNever };

}  // namespace sheaf::render
