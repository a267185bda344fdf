// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Operating errors are absl::Status; these helpers add the caller's context.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sheaf {

// The same code with "context: " before the message. OK stays OK.
absl::Status Annotate(const absl::Status& status, const std::string& context);

// A status for errno after a failed system call: "CONTEXT: No space left on device". ENOENT becomes
// kNotFound, ENOSPC and EDQUOT kResourceExhausted, EACCES kPermissionDenied, else kUnavailable.
absl::Status StatusFromErrno(int error_number, const std::string& context);

}  // namespace sheaf
