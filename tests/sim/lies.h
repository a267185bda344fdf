// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Falsify: parts that are not what their description says.
#pragma once

#include <cstdint>

#include "worker/agent/work.h"

namespace sheaf::sim {

inline constexpr uint64_t kLieKinds = 8;
// The bytes are not those of the part's digest.
inline constexpr uint64_t kLieAboutDigest = 3;

// kind: below kLieKinds; one of another block, place or frame, of fewer or other bytes, or of
// values that are impossible.
void Falsify(uint64_t kind, worker::FinishedPart* part);

}  // namespace sheaf::sim
