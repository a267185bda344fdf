// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderFailureKind: the class of a failure of LoadedScene::Render.
#pragma once

#include "absl/status/status.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

// Requires: an error of LoadedScene::Render, other than kCancelled.
FailureKind RenderFailureKind(const absl::Status& status);

}  // namespace sheaf::worker
