// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileServer: opens files of a scene for its process, which cannot fetch them. Several are fetched
// at once, while the process's other messages are received.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/volume/file_bytes.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

// Files that one process waits for. More than it has threads come from no renderer.
inline constexpr size_t kAskedFilesMax = 4'096;
// Files of one process that are fetched at once.
inline constexpr size_t kFilesOpenedAtOnceMax = 4;

// Thread safety: members may be called concurrently.
class FileServer {
 public:
  // Called by threads of the server.
  using Answer = std::function<void(uint64_t ask_id, absl::StatusOr<volume::FileBytes> file)>;

  FileServer(OpenOnDemand open, Answer answer)
      : open_(std::move(open)), answer_(std::move(answer)) {}
  // Stops what is being fetched. No answer follows.
  ~FileServer() = default;
  FileServer(const FileServer&) = delete;
  FileServer& operator=(const FileServer&) = delete;

  // False if too many files are asked for.
  bool Ask(uint64_t ask_id, std::string name);

 private:
  void Work(const std::stop_token& stop);

  const OpenOnDemand open_;
  const Answer answer_;
  Mutex mutex_;
  CondVar asked_;
  std::deque<std::pair<uint64_t, std::string>> queue_ ABSL_GUARDED_BY(mutex_);
  size_t idle_threads_ ABSL_GUARDED_BY(mutex_) = 0;
  std::vector<std::jthread> threads_ ABSL_GUARDED_BY(mutex_);  // Last, so that they end first.
};

}  // namespace sheaf::worker
