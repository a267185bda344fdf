// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LocalFarm: a farm of one machine. Coordinator and worker run in this process and talk over an
// in-process channel; they use the same code as a large farm.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "cli/job/prepared_job.h"
#include "common/content/blob_store.h"
#include "coordinator/service/server/coordinator_server.h"
#include "worker/sandbox/direct_scenes.h"
#include "worker/sandbox/scene_opener.h"
#include "worker/service/embedded_worker.h"

namespace sheaf::cli {

struct LocalFarmOptions {
  worker::WorkerOptions worker;  // Its cache folder is the farm's.
  std::string http_address;      // Empty: no dashboard.
  std::string kept_state;        // A folder to keep; empty: a temporary one.
};

// Opens the scenes of a job for the worker of a LocalFarm. Takes the job's description, so that its
// scene is not read again. watch: as for DirectScenes.
std::shared_ptr<worker::DirectScenes> ScenesOf(PreparedJob* job,
                                               worker::DirectScenes::MemoryWatch watch = nullptr);

class LocalFarm {
 public:
  // Errors: those of creating folders and of CoordinatorServer::Start.
  static absl::StatusOr<std::unique_ptr<LocalFarm>> Open(const LocalFarmOptions& options);
  // Stops the worker, then the coordinator; removes the folder unless it is kept.
  ~LocalFarm();
  LocalFarm(const LocalFarm&) = delete;
  LocalFarm& operator=(const LocalFarm&) = delete;

  std::shared_ptr<grpc::Channel> channel() { return channel_; }
  // The store of the coordinator.
  const BlobStore* blobs() const { return &server_->farm().blobs(); }
  std::string http_url() const { return server_->http_url(); }
  // Memory of the film: tiles that are not finished.
  uint64_t film_bytes() const;
  // Keeps the folder, so that a later run can resume with it as LocalFarmOptions::kept_state.
  // Returns its path.
  const std::string& KeepState();
  // Starts the worker and waits until it has reported.
  absl::Status StartWorker();

 private:
  class StateDirectory;
  LocalFarm();

  LocalFarmOptions options_;
  std::unique_ptr<StateDirectory> state_;
  std::unique_ptr<coordinator::CoordinatorServer> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<worker::EmbeddedWorker> worker_;
  std::jthread working_;
};

}  // namespace sheaf::cli
