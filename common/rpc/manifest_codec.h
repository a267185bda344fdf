// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Encodes a Manifest to the bytes of its blob (sheaf.v1.SceneManifest) and decodes it. Equal scenes
// give equal bytes.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/content/manifest.h"

namespace sheaf {

// Requires: CheckManifest is OK.
std::string EncodeManifest(const Manifest& manifest);

// The bytes are untrusted. Errors: kInvalidArgument.
absl::StatusOr<Manifest> DecodeManifest(const std::string& bytes);

}  // namespace sheaf
