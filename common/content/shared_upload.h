// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SharedUploadError: several clients upload the same blob, and one of them writes it.
#pragma once

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/base/retry_after.h"

namespace sheaf {

// Between looks at a blob that another client uploads.
inline constexpr absl::Duration kSharedUploadWait = absl::Seconds(1);

// kResourceExhausted, and not kUnavailable, which means to clients that the coordinator is silent.
inline absl::Status SharedUploadError() {
  return RetryAfterError("another client uploads the same file", kSharedUploadWait);
}

}  // namespace sheaf
