// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/delivery/image_attributes.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/rpc/manifest_codec.h"

#ifndef SHEAF_VERSION
#error "CMakeLists.txt defines SHEAF_VERSION"
#endif

namespace sheaf::coordinator {
namespace {

// Matrix text as described in exr_attributes.h.
std::string MatrixText(const std::vector<float>& rows) {
  return absl::StrJoin(
      rows, " ", [](std::string* out, float value) { absl::StrAppendFormat(out, "%.9g", value); });
}

}  // namespace

std::map<std::string, std::string> ImageAttributes::Of(const BlobDigest& scene) const {
  std::map<std::string, std::string> attributes{{"software", "Sheaf " SHEAF_VERSION}};
  const absl::StatusOr<std::string> bytes =
      ReadWholeFile(blobs_->FinalPath(scene), kManifestBytesMax);
  const absl::StatusOr<Manifest> manifest =
      bytes.ok() ? DecodeManifest(*bytes) : absl::StatusOr<Manifest>(bytes.status());
  if (!manifest.ok()) {
    LogWarning(
        absl::StrCat("an image has no matrices of its camera: ", manifest.status().message()));
    return attributes;
  }
  if (!manifest->world_to_camera.empty()) {
    attributes["worldToCamera"] = MatrixText(manifest->world_to_camera);
  }
  if (!manifest->world_to_ndc.empty()) {
    attributes["worldToNDC"] = MatrixText(manifest->world_to_ndc);
  }
  return attributes;
}

}  // namespace sheaf::coordinator
