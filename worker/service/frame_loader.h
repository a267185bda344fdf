// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameLoader: loads a lease's scene from the coordinator's blobs into a CompiledScene.
//
//     manifest blob > files in the content cache > SceneDescription > CompiledScene
#pragma once

#include <grpcpp/channel.h>

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>

#include "absl/status/status.h"
#include "common/base/memory_room.h"
#include "common/content/content_cache.h"
#include "sheaf/v1/content.grpc.pb.h"
#include "worker/agent/scene_loader.h"

namespace sheaf::worker {

struct FrameLoaderOptions {
  uint64_t scene_memory_bytes_max = uint64_t{4} << 30;  // For one scene, read or compiled.
  uint64_t texture_memory_bytes_max = uint64_t{512} << 20;
  uint32_t build_threads = 0;  // 0: the machine's number of threads.
};

// Thread safety: Load may be called concurrently.
class FrameLoader : public SceneLoader {
 public:
  // Requires: cache outlives this and every scene it loaded.
  FrameLoader(const std::shared_ptr<grpc::Channel>& channel, ContentCache* cache,
              FrameLoaderOptions options);

  LoadResult Load(const Lease& lease, std::stop_token stop) override;

 private:
  // The memory that a scene may take now, by this worker's limit and the machine's.
  MemoryRoom RoomForScene() const;
  ContentCache::Fetch FetchFromCoordinator(std::stop_token stop) const;

  const std::unique_ptr<v1::ContentService::Stub> stub_;
  ContentCache* const cache_;
  const FrameLoaderOptions options_;
};

}  // namespace sheaf::worker
