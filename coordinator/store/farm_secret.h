// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The farm's secret: 32 random bytes in the state directory, by which the coordinator knows its own
// leases again (lease_token.h) and chooses which results it checks. Who can read it can forge both.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sheaf::coordinator {

// Reads DIRECTORY/lease.key, or makes it: at the first start, readable for its owner alone.
// Errors: kFailedPrecondition (others may read it, or it is not a secret of this form); those of
// reading and writing files.
absl::StatusOr<std::string> LoadOrMakeSecret(const std::string& directory);

}  // namespace sheaf::coordinator
