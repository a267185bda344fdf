// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What vectors hold of memory, for the accounts of compiled scenes.
#pragma once

#include <cstdint>
#include <vector>

namespace sheaf {

// Of each its room, without what its elements hold in turn.
template <typename... T>
uint64_t VectorBytes(const std::vector<T>&... vectors) {
  return (uint64_t{0} + ... + (vectors.capacity() * sizeof(T)));
}

}  // namespace sheaf
