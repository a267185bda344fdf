// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/scene_names.h"

#include "absl/status/statusor.h"
#include "common/base/file.h"
#include "common/rpc/manifest_codec.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kDigestDigitsShown = 12;

}  // namespace

std::string SceneNames::Find(const std::string& scene_digest) {
  {
    const MutexLock lock(&mutex_);
    if (const auto found = names_.find(scene_digest); found != names_.end()) return found->second;
  }
  std::string name = Read(scene_digest);
  const MutexLock lock(&mutex_);
  if (names_.size() >= kSceneNamesMax) names_.clear();
  names_[scene_digest] = name;
  return name;
}

std::string SceneNames::Read(const std::string& scene_digest) const {
  const BlobDigest digest{scene_digest, 0};
  std::string unknown = scene_digest.substr(0, kDigestDigitsShown);
  if (!CheckDigest(digest).ok()) return unknown;  // Workers name digests too.
  const absl::StatusOr<std::string> bytes =
      ReadWholeFile(blobs_->FinalPath(digest), kManifestBytesMax);
  if (!bytes.ok()) return unknown;
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*bytes);
  return manifest.ok() ? manifest->main_file : unknown;
}

}  // namespace sheaf::coordinator
