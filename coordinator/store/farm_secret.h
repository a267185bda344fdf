// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The farm's secret: 32 random bytes in the state directory. The coordinator uses it to recognize
// its own leases (lease_token.h) and to choose the results that it checks. A reader of the secret
// can forge both.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sheaf::coordinator {

// Reads DIRECTORY/lease.key, or creates it at the first start, readable only by its owner.
// Errors: kFailedPrecondition (others may read it, or it is not a secret of this form); those of
// reading and writing files.
absl::StatusOr<std::string> LoadOrMakeSecret(const std::string& directory);

}  // namespace sheaf::coordinator
