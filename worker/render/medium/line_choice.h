// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LinesInVarying: in which heterogeneous media equiangular sampling is used.
#pragma once

#include <cstdint>

namespace sheaf::render {

// Whether light is gathered along lines through media that vary.
enum class LinesInVarying : uint8_t { kWhereItPays, kAlways, kNever };

}  // namespace sheaf::render
