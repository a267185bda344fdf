// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CatchOutOfMemory: a scene that runs out of memory ends its task, never the worker.
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"

namespace sheaf::worker {

// Runs the step. Returns kResourceExhausted, with what could not be done, if it ran out of memory
// or threads; else kOk, whatever the step's own result.
absl::Status CatchOutOfMemory(const std::string& what, const std::function<void()>& step);

}  // namespace sheaf::worker
