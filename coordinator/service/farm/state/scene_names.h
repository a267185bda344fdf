// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneNames: file names of scenes by the digests of their manifests. Caches names.
#pragma once

#include <map>
#include <string>

#include "common/base/mutex.h"
#include "common/content/blob_store.h"

namespace sheaf::coordinator {

// Cached names; beyond the limit the cache is cleared.
inline constexpr size_t kSceneNamesMax = 10'000;

class SceneNames {
 public:
  // `blobs` must outlive the object.
  explicit SceneNames(const BlobStore* blobs) : blobs_(blobs) {}

  // "room.pbrt"; a few digits of the digest if the manifest cannot be read.
  // Thread safety: may be called concurrently.
  std::string Find(const std::string& scene_digest);

 private:
  std::string Read(const std::string& scene_digest) const;

  const BlobStore* const blobs_;
  Mutex mutex_;
  std::map<std::string, std::string> names_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
