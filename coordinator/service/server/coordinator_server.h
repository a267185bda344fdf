// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CoordinatorServer: a whole coordinator, to be run by its own program or inside another one.
// `sheaf render` embeds it: the farm of one uses the same code as the farm of a thousand.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/dropped/submissions.h"
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/grpc/access_service.h"
#include "coordinator/service/grpc/content_service.h"
#include "coordinator/service/grpc/job_service.h"
#include "coordinator/service/grpc/transfer_service.h"
#include "coordinator/service/grpc/worker_service.h"
#include "coordinator/service/http/http_service.h"
#include "coordinator/service/server/build_info.h"
#include "coordinator/service/server/farm_objects.h"
#include "coordinator/store/database/database.h"

namespace sheaf::coordinator {

// How often the server's own certificate is checked.
inline constexpr absl::Duration kServerCertificateInterval = absl::Hours(1);
// A connection keeps its first certificate, and ends after at most this time; clients then
// reconnect without losing a call. With short lifetimes, after an eighth of one.
inline constexpr absl::Duration kConnectionAgeMax = absl::Hours(1);

struct CoordinatorOptions {
  FarmOptions farm;
  // "s3://BUCKET/PREFIX": the store of parts and files of scenes; empty: the state directory.
  std::string objects_url;
  Environment environment = ProcessEnvironment;  // Has the key of the store.
  // Lifetimes of issued certificates; unused if the state directory has no authority.
  CertificateLifetimes certificate_lifetimes;
  // For each user and worker; unused likewise.
  IdentityLimits identity_limits;
  // "host:port" of gRPC; port 0 lets the system choose, empty does not listen (InProcessChannel
  // always works).
  std::string listen_address = "127.0.0.1:0";
  // "host:port" of HTTP; empty serves none.
  std::string http_address;
  // Names, beside localhost and addresses, under which browsers may reach HTTP.
  std::vector<std::string> allowed_hosts;
  // Listen without encryption even if other machines can connect. gRPC and HTTP are always
  // encrypted if the state directory has a certificate authority.
  bool insecure_remote_allowed = false;
  // The program `sheaf`, which reads scenes that are dropped on the page; empty: takes none.
  std::string scene_reader;
  uint64_t drop_bytes_max = uint64_t{4} << 30;  // Limit of one scene's files; 0: none taken.
};

class CoordinatorServer {
 public:
  // Loads the state, then serves until destroyed or stopped. database: the jobs database, which
  // other coordinators may share (shared_database.h); null: a file of the state directory.
  // Errors: those of OpenFarmObjects, SqlJobStore::Open, Farm::Open, AccessControl::Open and
  // RequireSafeAddress; kUnavailable (a port is taken), with the address. One line each.
  static absl::StatusOr<std::unique_ptr<CoordinatorServer>> Start(
      const CoordinatorOptions& options, std::unique_ptr<Database> database = nullptr);
  ~CoordinatorServer();

  // Gives calls in progress a moment to finish, then stops. Acknowledged results are always
  // durable.
  void Stop();

  // gRPC's port; 0 if it does not listen.
  int port() const { return port_; }
  // HTTP's port; 0 if there is none.
  int http_port() const { return http_ == nullptr ? 0 : http_->port(); }
  // "http://127.0.0.1:7480" or "https://..."; empty if there is none.
  std::string http_url() const { return http_ == nullptr ? "" : http_->Url(); }
  // A channel that reaches this server without a socket.
  std::shared_ptr<grpc::Channel> InProcessChannel();
  Farm& farm() { return *farm_; }
  // Null if the state directory has no certificate authority.
  AccessControl* access() { return access_.get(); }

 private:
  CoordinatorServer() = default;
  absl::Status OpenAccess(const CoordinatorOptions& options);
  void AddListeningPort(const CoordinatorOptions& options, grpc::ServerBuilder* builder);
  absl::Status StartGrpc(const CoordinatorOptions& options);
  absl::Status StartHttp(const CoordinatorOptions& options);
  absl::Status StartSubmissions(const CoordinatorOptions& options);

  ServerMetrics metrics_{CoordinatorBuild()};  // Metrics of the services below.
  std::unique_ptr<AccessControl> access_;
  FarmObjects objects_;  // The farm's; none without an object store.
  std::unique_ptr<Farm> farm_;
  std::unique_ptr<AccessService> access_service_;
  std::unique_ptr<JobService> job_service_;
  std::unique_ptr<WorkerService> worker_service_;
  std::unique_ptr<ContentService> content_service_;
  std::unique_ptr<TransferService> transfer_service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<Submissions> submissions_;
  std::unique_ptr<HttpService> http_;
  std::jthread certificate_upkeep_;
  int port_ = 0;
  std::atomic<int> shown_port_ = 0;  // The same, for the threads of http_.
};

}  // namespace sheaf::coordinator
