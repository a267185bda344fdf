// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/embedded_worker.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/base/memory_room.h"
#include "common/base/surroundings/home_directory.h"
#include "common/base/surroundings/host_name.h"
#include "common/rpc/address_list.h"
#include "common/scene/settings/render_settings.h"
#include "worker/sandbox/direct_scenes.h"

namespace sheaf::worker {
namespace {

AgentOptions MakeAgentOptions(const WorkerOptions& options) {
  AgentOptions agent;
  agent.host = HostName();
  std::random_device random;
  agent.worker_id =
      absl::StrCat(agent.host, "-", ::getpid(), "-", absl::Hex(random(), absl::kZeroPad8));
  agent.numeric_profile = NumericProfile();
  agent.thread_count = options.thread_count > 0 ? options.thread_count : AvailableThreadCount();
  agent.pool = options.pool;
  agent.tags = options.tags;
  agent.memory_bytes = std::min(options.scene_memory_bytes_max, FindMemoryRoom().bytes);
  agent.leases_ahead = options.leases_ahead;
  agent.warns_of_failed_leases = options.warns_of_failed_leases;
  agent.scene_memory_bytes_max = options.scene_memory_bytes_max;
  agent.grace = options.grace;
  agent.exit_when_idle = options.exit_when_idle;
  agent.why_away = options.why_away;
  if (HasSeveralAddresses(options.coordinator)) {
    agent.backoff_max = absl::ToChronoMilliseconds(kFollowInterval);
  }
  return agent;
}

absl::StatusOr<std::shared_ptr<SceneOpener>> MakeScenes(const WorkerOptions& options) {
  if (options.scenes != nullptr) return options.scenes;
  if (options.sandbox.mode == SandboxMode::kNone) return std::make_shared<DirectScenes>();
  absl::StatusOr<std::unique_ptr<SceneOpener>> scenes = SandboxedScenes::Make(options.sandbox);
  if (!scenes.ok()) return scenes.status();
  return std::shared_ptr<SceneOpener>(*std::move(scenes));
}

}  // namespace

int32_t AvailableThreadCount() {
  return std::max(1, static_cast<int32_t>(std::thread::hardware_concurrency()));
}

std::string DefaultCacheDirectory() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && cache[0] == '/') {
    return absl::StrCat(cache, "/sheaf");
  }
  const std::string home = HomeDirectory();
  if (!home.empty()) return absl::StrCat(home, "/.cache/sheaf");
  std::error_code error;
  const std::filesystem::path temporary = std::filesystem::temp_directory_path(error);
  return absl::StrCat(error ? std::string("/var/tmp") : temporary.string(), "/sheaf-cache-",
                      ::getuid());
}

absl::StatusOr<std::unique_ptr<EmbeddedWorker>> EmbeddedWorker::Open(
    const std::shared_ptr<grpc::Channel>& control, const std::shared_ptr<grpc::Channel>& data,
    const WorkerOptions& options) {
  absl::StatusOr<std::unique_ptr<ContentCache>> cache =
      ContentCache::Open(options.cache_directory,
                         {.bytes_max = options.cache_bytes_max, .lender = options.cache_lender});
  if (!cache.ok()) {
    return absl::Status(cache.status().code(),
                        absl::StrCat(std::string(cache.status().message()),
                                     "; choose another directory with --cache-dir"));
  }
  absl::StatusOr<std::shared_ptr<SceneOpener>> scenes = MakeScenes(options);
  if (!scenes.ok()) return scenes.status();
  return std::unique_ptr<EmbeddedWorker>(new EmbeddedWorker(
      control, data, *std::move(cache), *std::move(scenes), options, MakeAgentOptions(options)));
}

EmbeddedWorker::EmbeddedWorker(const std::shared_ptr<grpc::Channel>& control,
                               const std::shared_ptr<grpc::Channel>& data,
                               std::unique_ptr<ContentCache> cache,
                               std::shared_ptr<SceneOpener> scenes, const WorkerOptions& options,
                               const AgentOptions& agent_options)
    : worker_id_(agent_options.worker_id),
      cache_(std::move(cache)),
      scenes_(std::move(scenes)),
      exchange_(options.reports_content ? std::make_unique<PeerExchange>(
                                              control, worker_id_, options.peers, &cache_->blobs())
                                        : nullptr),
      loader_(data, cache_.get(), scenes_.get(),
              {options.scene_memory_bytes_max, options.texture_memory_bytes_max,
               static_cast<uint32_t>(agent_options.thread_count),
               static_cast<uint32_t>(agent_options.thread_count), options.volume_memory_bytes_max},
              exchange_.get()),
      link_(control, data, options.coordinator),
      agent_(agent_options, &link_, &loader_) {}

}  // namespace sheaf::worker
