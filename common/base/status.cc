// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/status.h"

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace sheaf {

absl::Status Annotate(const absl::Status& status, const std::string& context) {
  if (status.ok()) return status;
  return absl::Status(status.code(), absl::StrCat(context, ": ", status.message()));
}

absl::Status StatusFromErrno(int error_number, const std::string& context) {
  absl::StatusCode code = absl::StatusCode::kUnavailable;
  if (error_number == ENOENT) code = absl::StatusCode::kNotFound;
  // EFBIG is the limit of ulimit -f.
  if (error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG) {
    code = absl::StatusCode::kResourceExhausted;
  }
  if (error_number == EACCES || error_number == EPERM) code = absl::StatusCode::kPermissionDenied;
  return absl::Status(code,
                      absl::StrCat(context, ": ", std::generic_category().message(error_number)));
}

}  // namespace sheaf
