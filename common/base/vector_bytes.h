// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VectorBytes: memory use of vectors, for the memory accounts of compiled scenes.
#pragma once

#include <cstdint>
#include <vector>

namespace sheaf {

// Sum of the capacities, without memory that elements own.
template <typename... T>
uint64_t VectorBytes(const std::vector<T>&... vectors) {
  return (uint64_t{0} + ... + (vectors.capacity() * sizeof(T)));
}

}  // namespace sheaf
