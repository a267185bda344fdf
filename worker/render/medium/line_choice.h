// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LinesInVarying: in which heterogeneous media equiangular sampling is used.
#pragma once

#include <cstdint>

namespace sheaf::render {

// Whether lines through heterogeneous media gather light.
enum class LinesInVarying : uint8_t { kWhereItPays, kAlways, kNever };

}  // namespace sheaf::render
