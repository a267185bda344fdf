// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Manifest: the files of one frame's scene, by name and digest. Stored as a blob itself
// (common/rpc/manifest_codec.h defines its bytes); the digest of that blob is the scene digest.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/content/blob_digest.h"

namespace sheaf {

inline constexpr size_t kManifestFilesMax = 1'000'000;
inline constexpr uint64_t kManifestBytesMax = uint64_t{256} << 20;  // Size of its serialized form.

struct ManifestFile {
  std::string name;  // Canonical name, as in common/scene/file_source.h, in UTF-8.
  BlobDigest digest;
  bool is_on_demand = false;  // A worker fetches it when a task reads it.
  friend bool operator==(const ManifestFile&, const ManifestFile&) = default;
};

struct Manifest {
  std::string main_file;            // One of `files`.
  std::vector<ManifestFile> files;  // In ascending order of name, no name twice.
  // The camera's matrices for images (common/scene/camera_matrices.h): 16 finite numbers, or none.
  std::vector<float> world_to_camera = {}, world_to_ndc = {};
  friend bool operator==(const Manifest&, const Manifest&) = default;
};

// Sorts the files by name. Requires: names are unique.
Manifest MakeManifest(std::string main_file, std::vector<ManifestFile> files);

// Errors: kInvalidArgument, naming the first violation of the rules above.
absl::Status CheckManifest(const Manifest& manifest);

}  // namespace sheaf
