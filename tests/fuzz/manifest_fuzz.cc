// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the decoder of manifests. An accepted manifest keeps the rules of
// common/content/manifest.h, and its encoding decodes to an equal one.
#include "common/rpc/manifest_codec.h"

#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(manifest) {
  const absl::StatusOr<Manifest> manifest = DecodeManifest(std::string(bytes));
  if (!manifest.ok()) return;
  SHEAF_CHECK(CheckManifest(*manifest).ok());
  const absl::StatusOr<Manifest> again = DecodeManifest(EncodeManifest(*manifest));
  SHEAF_CHECK(again.ok() && *again == *manifest);
}

}  // namespace sheaf
