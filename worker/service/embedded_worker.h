// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmbeddedWorker: a complete worker over a channel. sheaf-worker runs one over the network; sheaf
// render runs one in its own process, over an in-process channel.
#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/content/content_cache.h"
#include "worker/agent/agent.h"
#include "worker/sandbox/sandboxed_scenes.h"
#include "worker/sandbox/scene_opener.h"
#include "worker/service/frame_loader.h"
#include "worker/service/grpc_coordinator_link.h"
#include "worker/service/peer_exchange.h"

namespace sheaf::worker {

struct WorkerOptions {
  std::string coordinator = "this process";  // Its name in messages.
  std::string pool;                          // Empty: the default one.
  std::vector<std::string> tags;             // Tags that jobs may require.
  int32_t thread_count = 0;                  // 0: as many as this process may use.
  std::string cache_directory;
  uint64_t cache_bytes_max = uint64_t{20} << 30;
  const BlobStore* cache_lender = nullptr;  // ContentCacheLimits::lender.
  uint64_t scene_memory_bytes_max = uint64_t{4} << 30;
  uint64_t texture_memory_bytes_max = uint64_t{512} << 20;
  uint64_t volume_memory_bytes_max = uint64_t{512} << 20;
  int32_t leases_ahead = 2;
  std::chrono::milliseconds grace{10'000};
  std::chrono::milliseconds exit_when_idle{0};
  std::function<std::string(uint64_t scene_bytes)> why_away;  // As in AgentOptions.
  // Whether the coordinator is told where scene files came from; without it no peers are asked.
  bool reports_content = false;
  bool warns_of_failed_leases = true;  // As in AgentOptions.
  PeerOptions peers;
  SandboxOptions sandbox;  // By default scenes render in this process: they are the user's own.
  std::shared_ptr<SceneOpener> scenes;  // Opens them; null: as `sandbox` says.
};

// A turn of the agent waits for one call of Synchronize, which has a deadline of 10 s, and freeing
// scenes takes a moment; what takes longer than this will not end.
inline constexpr std::chrono::seconds kTurnMax{60};

// Number of processors that this process may use.
int32_t AvailableThreadCount();

// "$XDG_CACHE_HOME/sheaf", or "~/.cache/sheaf", or a directory below the system's temporary one.
std::string DefaultCacheDirectory();

class EmbeddedWorker {
 public:
  // Scenes and results use the channel data, so that no heartbeat waits behind them on a slow link.
  // Errors: those of ContentCache::Open and SandboxedScenes::Make.
  static absl::StatusOr<std::unique_ptr<EmbeddedWorker>> Open(
      const std::shared_ptr<grpc::Channel>& control, const std::shared_ptr<grpc::Channel>& data,
      const WorkerOptions& options);

  // As Agent::Run.
  absl::Status Run(std::stop_token stop) { return agent_.Run(stop); }
  const std::string& worker_id() const { return worker_id_; }
  // Whether Run still takes turns. Blocks where the agent's lock is never released.
  bool IsAlive() const { return agent_.SinceLastTurn() < kTurnMax; }
  AgentCounts counts() const { return agent_.counts(); }

 private:
  EmbeddedWorker(const std::shared_ptr<grpc::Channel>& control,
                 const std::shared_ptr<grpc::Channel>& data, std::unique_ptr<ContentCache> cache,
                 std::shared_ptr<SceneOpener> scenes, const WorkerOptions& options,
                 const AgentOptions& agent_options);

  const std::string worker_id_;
  const std::unique_ptr<ContentCache> cache_;
  const std::shared_ptr<SceneOpener> scenes_;
  const std::unique_ptr<PeerExchange> exchange_;  // Null without reports.
  FrameLoader loader_;
  GrpcCoordinatorLink link_;
  Agent agent_;
};

}  // namespace sheaf::worker
