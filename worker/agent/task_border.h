// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The border of a task: what a scene lacks of memory ends the task, never the worker.
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"

namespace sheaf::worker {

// Runs the step. Returns kResourceExhausted, saying what could not be done, where it ran out of
// memory or of threads; else kOk, whatever the step itself says.
absl::Status CatchOutOfMemory(const std::string& what, const std::function<void()>& step);

}  // namespace sheaf::worker
