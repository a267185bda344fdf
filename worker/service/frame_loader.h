// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameLoader: loads a lease's scene from blobs of the coordinator and of other workers. The
// guiding field of a guided frame follows with the first lease that names it, once a scene.
//
//     manifest blob > files in the content cache > OpenScene > files that its tasks read
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"
#include "common/content/content_cache.h"
#include "common/content/manifest.h"
#include "sheaf/v1/worker.grpc.pb.h"
#include "worker/agent/scene_loader.h"
#include "worker/sandbox/scene_opener.h"
#include "worker/service/blob_fetcher.h"
#include "worker/service/on_demand_files.h"

namespace sheaf::worker {

// Thread safety: Load may be called concurrently.
class FrameLoader : public SceneLoader {
 public:
  // Requires: cache, scenes and exchange outlive this, and this outlives every scene it loaded.
  // exchange: null where all blobs come from the coordinator.
  FrameLoader(const std::shared_ptr<grpc::Channel>& channel, ContentCache* cache,
              SceneOpener* scenes, SceneLimits limits, PeerExchange* exchange = nullptr);

  LoadResult Load(const Lease& lease, std::stop_token stop) override;

 private:
  // The verified bytes of the lease's guiding field. Errors: those of LoadedScene::Render.
  absl::StatusOr<std::string> FetchField(const Lease& lease, std::stop_token stop) const;
  SceneInputs InputsOf(const Manifest& manifest, const ContentLease& files, const Lease& lease,
                       const std::shared_ptr<OnDemandFiles>& on_demand) const;

  BlobFetcher fetcher_;
  PeerExchange* const exchange_;
  const std::unique_ptr<v1::WorkerService::Stub> worker_stub_;
  ContentCache* const cache_;
  SceneOpener* const scenes_;
  const SceneLimits limits_;
};

}  // namespace sheaf::worker
