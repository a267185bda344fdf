// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/coordinator_server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/rpc/address.h"
#include "common/rpc/channel.h"

namespace sheaf::coordinator {
namespace {

// How long calls under way may take when the server stops.
constexpr absl::Duration kStopGrace = absl::Seconds(2);

absl::Status PortInUseError(const std::string& address) {
  return absl::UnavailableError(
      absl::StrCat("cannot listen on ", address,
                   ": the port is in use or the address does not belong to this machine"));
}

// The page's actions on the farm.
FarmActions ActionsOn(Farm* farm) {
  const auto by_number = [](const std::string& job_id,
                            const std::function<absl::Status(uint64_t)>& act) -> absl::Status {
    uint64_t id = 0;
    if (absl::SimpleAtoi(job_id, &id)) return act(id);
    return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": there is no such job"));
  };
  FarmActions actions;
  actions.cancel_job = [=](const std::string& job) {
    return by_number(job, [=](uint64_t id) { return farm->CancelJob(id); });
  };
  actions.pause_job = [=](const std::string& job) {
    return by_number(job, [=](uint64_t id) { return farm->PauseJob(id); });
  };
  actions.resume_job = [=](const std::string& job) {
    return by_number(job, [=](uint64_t id) { return farm->ResumeJob(id); });
  };
  actions.set_job_priority = [=](const std::string& job, int32_t priority) {
    return by_number(job, [=](uint64_t id) { return farm->SetJobPriority(id, priority); });
  };
  actions.refine_job = [=](const std::string& job, const Refinement& refinement) {
    return by_number(job, [=](uint64_t id) { return farm->RefineJob(id, refinement); });
  };
  return actions;
}

}  // namespace

absl::StatusOr<std::unique_ptr<CoordinatorServer>> CoordinatorServer::Start(
    const CoordinatorOptions& options) {
  for (const std::string& address : {options.listen_address, options.http_address}) {
    if (address.empty()) continue;
    absl::Status safe = RequireSafeAddress(address, options.insecure_remote_allowed);
    if (!safe.ok()) return safe;
  }
  absl::StatusOr<std::unique_ptr<Farm>> farm = Farm::Open(options.farm);
  if (!farm.ok()) return farm.status();
  std::unique_ptr<CoordinatorServer> server(new CoordinatorServer());
  server->farm_ = std::move(*farm);
  if (absl::Status status = server->StartGrpc(options); !status.ok()) return status;
  if (absl::Status status = server->StartHttp(options); !status.ok()) return status;
  return server;
}

absl::Status CoordinatorServer::StartGrpc(const CoordinatorOptions& options) {
  job_service_ = std::make_unique<JobService>(farm_.get());
  worker_service_ = std::make_unique<WorkerService>(farm_.get());
  content_service_ = std::make_unique<ContentService>(&farm_->blobs());
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  ApplyServerLimits(&builder);
  if (!options.listen_address.empty()) {
    builder.AddListeningPort(options.listen_address, grpc::InsecureServerCredentials(), &port_);
  }
  builder.RegisterService(job_service_.get());
  builder.RegisterService(worker_service_.get());
  builder.RegisterService(content_service_.get());
  server_ = builder.BuildAndStart();
  const bool listens = options.listen_address.empty() || port_ != 0;
  if (server_ == nullptr || !listens) return PortInUseError(options.listen_address);
  return absl::OkStatus();
}

absl::Status CoordinatorServer::StartHttp(const CoordinatorOptions& options) {
  if (options.http_address.empty()) return absl::OkStatus();
  const absl::StatusOr<Address> address = ParseAddress(options.http_address);
  if (!address.ok()) return address.status();
  HttpServiceOptions http;
  http.server.address = address->host == "localhost" ? "127.0.0.1" : address->host;
  http.server.port = address->port;
  http.allowed_hosts = options.allowed_hosts;
  http.server.allow_remote = options.insecure_remote_allowed;
  absl::StatusOr<std::unique_ptr<HttpService>> service =
      HttpService::Start(http, *farm_, ActionsOn(farm_.get()));
  if (!service.ok()) return service.status();
  http_ = std::move(*service);
  return absl::OkStatus();
}

CoordinatorServer::~CoordinatorServer() { Stop(); }

void CoordinatorServer::Stop() {
  http_.reset();
  if (job_service_ != nullptr) job_service_->Stop();
  if (server_ == nullptr) return;
  server_->Shutdown(std::chrono::system_clock::now() + absl::ToChronoNanoseconds(kStopGrace));
  server_->Wait();
  server_.reset();
}

std::shared_ptr<grpc::Channel> CoordinatorServer::InProcessChannel() {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMessageBytesMax);
  arguments.SetMaxSendMessageSize(kMessageBytesMax);
  return server_->InProcessChannel(arguments);
}

}  // namespace sheaf::coordinator
