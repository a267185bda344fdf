// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SHEAF_LONG_TESTS=1 gives randomized tests as many draws as the catalog of hard cases requires;
// otherwise they use a fraction suitable for every build.
#pragma once

#include <cstdlib>

namespace sheaf {

inline bool LongTests() { return std::getenv("SHEAF_LONG_TESTS") != nullptr; }
inline int DrawCount(int in_short, int in_long) { return LongTests() ? in_long : in_short; }

}  // namespace sheaf
