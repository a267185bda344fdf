// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SHEAF_LONG_TESTS=1 gives the tests that draw numbers as many draws as the catalogue of hard cases
// asks; without it they take the part of them that a build can wait for.
#pragma once

#include <cstdlib>

namespace sheaf {

inline bool LongTests() { return std::getenv("SHEAF_LONG_TESTS") != nullptr; }
inline int DrawCount(int in_short, int in_long) { return LongTests() ? in_long : in_short; }

}  // namespace sheaf
