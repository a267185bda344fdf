// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of bundles. Each file that an accepted bundle names can be
// read.
#include <string>

#include "cli/bundle/bundle_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf::cli {

SHEAF_FUZZ_TARGET(bundle) {
  const auto read = [bytes](uint64_t offset, uint64_t size) -> absl::StatusOr<std::string> {
    SHEAF_CHECK(offset <= bytes.size() && size <= bytes.size() - offset);
    return std::string(bytes.substr(offset, size));
  };
  const absl::StatusOr<Bundle> bundle = Bundle::Open(read, bytes.size());
  if (!bundle.ok()) return;
  for (const ManifestFile& file : bundle->manifest().files) {
    uint64_t size_bytes = 0;
    const absl::Status fetched = bundle->Fetcher()(file.digest, 0, [&](std::string_view chunk) {
      size_bytes += chunk.size();
      return absl::OkStatus();
    });
    SHEAF_CHECK(fetched.ok() && size_bytes == file.digest.size_bytes);
  }
}

}  // namespace sheaf::cli
