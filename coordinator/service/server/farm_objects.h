// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmObjects: the stores of a coordinator's parts and scenes on a server that speaks S3. An object
// names their owner: two coordinators with the same stores would take each other's parts for
// left-overs and remove them.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "common/objects/s3_objects.h"

namespace sheaf::coordinator {

struct FarmObjects {
  std::unique_ptr<S3Server> server;
  std::unique_ptr<S3Objects> parts, content;
};

// Records in the store that it belongs to the farm of the state directory, identified by its secret
// (farm_secret.h). Errors: kFailedPrecondition (it belongs to another one, with what to do); those
// of the store and of LoadOrMakeSecret.
absl::Status ClaimObjects(const std::string& state_directory, ObjectStore* objects);

// Finds key and server (s3_options.h), checks that the store can be used, and claims it. url:
// "s3://BUCKET/PREFIX". Errors: those of ReadS3Options, ObjectStore and ClaimObjects, one line
// each.
absl::StatusOr<FarmObjects> OpenFarmObjects(const std::string& url,
                                            const std::string& state_directory,
                                            const Environment& environment);

}  // namespace sheaf::coordinator
