// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DirectLight: the techniques by which a path finds light.
#pragma once

#include <cstdint>

namespace sheaf::render {

// Which of the techniques finds the light that arrives at a vertex. Pictures are made with all;
// others have the same expectation, and are there for tests of that. Lights without size can only
// be sampled, and what is seen directly or along perfect reflections can only be met. kByLines: as
// kByBoth, but what can be gathered along a line through a medium is.
enum class DirectLight : uint8_t { kByBoth, kBySampling, kByMeeting, kByLines };

}  // namespace sheaf::render
