// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LocalFarm: a farm of one. Coordinator and worker live in this process and talk over a channel
// that never leaves it; the code is that of the large farm.
#pragma once

#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "coordinator/service/server/coordinator_server.h"
#include "worker/service/embedded_worker.h"

namespace sheaf::cli {

struct LocalFarmOptions {
  worker::WorkerOptions worker;  // Its cache folder is that of the farm.
  std::string http_address;      // Empty: no page.
  std::string kept_state;        // Folder that stays; empty: a temporary one.
};

class LocalFarm {
 public:
  // Errors: those of making folders and of CoordinatorServer::Start.
  static absl::StatusOr<std::unique_ptr<LocalFarm>> Open(const LocalFarmOptions& options);
  // Stops the worker, then the coordinator; removes the folder unless it shall stay.
  ~LocalFarm();
  LocalFarm(const LocalFarm&) = delete;
  LocalFarm& operator=(const LocalFarm&) = delete;

  std::shared_ptr<grpc::Channel> channel() { return channel_; }
  std::string http_url() const { return server_->http_url(); }
  // The folder stays, to go on from as LocalFarmOptions::kept_state. Returns it.
  const std::string& KeepState();
  // Begins to render, and waits until the worker has reported.
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
