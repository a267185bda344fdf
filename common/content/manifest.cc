// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/manifest.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/status.h"
#include "common/base/text/utf8.h"

namespace sheaf {
namespace {

constexpr size_t kMatrixNumbers = 16;

}  // namespace

absl::Status CheckDigest(const BlobDigest& digest) {
  if (IsSha256Hex(digest.sha256_hex)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("digest \"", digest.sha256_hex.substr(0, 80),
                                                 "\" is not 64 lower-case hexadecimal digits"));
}

Manifest MakeManifest(std::string main_file, std::vector<ManifestFile> files) {
  std::sort(files.begin(), files.end(),
            [](const ManifestFile& a, const ManifestFile& b) { return a.name < b.name; });
  for (size_t i = 1; i < files.size(); ++i) SHEAF_CHECK(files[i - 1].name < files[i].name);
  return {std::move(main_file), std::move(files)};
}

absl::Status CheckManifest(const Manifest& manifest) {
  if (manifest.files.size() > kManifestFilesMax) {
    return absl::InvalidArgumentError(absl::StrCat("scene manifest: ", manifest.files.size(),
                                                   " files, the limit is ", kManifestFilesMax));
  }
  bool has_main_file = false;
  const std::string* previous = nullptr;
  for (const ManifestFile& file : manifest.files) {
    if (file.name.empty()) {
      return absl::InvalidArgumentError("scene manifest: a file without a name");
    }
    if (!IsUtf8(file.name)) {
      return absl::InvalidArgumentError(absl::StrCat("scene manifest: file ", file.name,
                                                     ": its name is not UTF-8; rename the file"));
    }
    if (absl::Status status = CheckDigest(file.digest); !status.ok()) {
      return Annotate(status, absl::StrCat("scene manifest: file ", file.name));
    }
    if (previous != nullptr && !(*previous < file.name)) {
      return absl::InvalidArgumentError(
          absl::StrCat("scene manifest: file ", file.name, " is listed twice or out of order"));
    }
    previous = &file.name;
    has_main_file = has_main_file || file.name == manifest.main_file;
  }
  for (const std::vector<float>* matrix : {&manifest.world_to_camera, &manifest.world_to_ndc}) {
    const bool is_finite = std::ranges::all_of(*matrix, [](float v) { return std::isfinite(v); });
    if ((matrix->empty() || matrix->size() == kMatrixNumbers) && is_finite) continue;
    return absl::InvalidArgumentError("scene manifest: a matrix is not 16 finite numbers");
  }
  if (has_main_file) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("scene manifest: the main file \"",
                                                 manifest.main_file, "\" is not among the files"));
}

}  // namespace sheaf
