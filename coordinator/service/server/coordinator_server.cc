// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/coordinator_server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>

#include <algorithm>
#include <stop_token>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/rpc/address.h"
#include "common/rpc/channel.h"
#include "common/rpc/plain_credentials.h"
#include "common/rpc/protocol_calls.h"
#include "common/rpc/tls_credentials.h"
#include "coordinator/service/grpc/call_gate.h"
#include "coordinator/service/grpc/call_timer.h"
#include "coordinator/service/server/dropped_jobs.h"
#include "coordinator/store/sql_job_store.h"

namespace sheaf::coordinator {
namespace {

// How long calls in progress may take when the server stops.
constexpr absl::Duration kStopGrace = absl::Seconds(2);

absl::Status PortInUseError(const std::string& address) {
  return absl::UnavailableError(
      absl::StrCat("cannot listen on ", address,
                   ": the port is in use or the address does not belong to this machine"));
}

// Renews the server's certificate in time, until it is stopped.
void KeepServerCertified(const std::stop_token& stop, const CertificateAuthority& authority) {
  while (SleepUnlessStopped(kServerCertificateInterval, stop)) {
    const absl::StatusOr<bool> renewed = authority.RenewServerCertificate(absl::Now());
    if (renewed.ok() && *renewed) LogInfo("the coordinator's certificate is renewed");
    if (!renewed.ok()) {
      LogWarning(absl::StrCat("the coordinator's certificate cannot be renewed: ",
                              renewed.status().message()));
    }
  }
}

// Listening without protection is never silent.
void WarnOfInsecureAddress(const std::string& address) {
  const absl::StatusOr<Address> parsed = ParseAddress(address);
  if (!parsed.ok() || IsLoopback(*parsed)) return;
  LogWarning(absl::StrCat("INSECURE: everyone who reaches ", address,
                          " controls this farm and reads its scenes and images; run "
                          "sheaf-coordinator init to make certificates"));
}

// The page's actions on the farm.
FarmActions ActionsOn(Farm* farm) {
  FarmActions actions;
  actions.change_job = [farm](JobVerb verb, const std::string& job_id,
                              const JobArguments& arguments) -> absl::Status {
    uint64_t id = 0;
    if (absl::SimpleAtoi(job_id, &id)) return farm->ChangeJob(verb, id, arguments);
    return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": there is no such job"));
  };
  actions.drain_worker = [farm](const std::string& worker_id, bool drain) -> absl::Status {
    const ChosenWorkers chosen{.worker_ids = {worker_id}, .host = ""};
    if (drain) return farm->drains().Drain(chosen, /*then_exit=*/false).status();
    return farm->drains().Undrain(chosen).status();
  };
  actions.read_pixel = [farm](const std::string& job, int32_t frame, int32_t x_px, int32_t y_px) {
    return farm->previews().ReadPixel(job, frame, x_px, y_px);
  };
  actions.list_usage = [farm](const UsageQuery& query) { return farm->ListUsage(query); };
  actions.collect_garbage = [farm](bool dry_run) {
    return farm->keeper().CollectForPeople(dry_run);
  };
  return actions;
}

// database: null: a file of the state directory.
absl::StatusOr<std::unique_ptr<Farm>> OpenFarm(const FarmOptions& options,
                                               std::unique_ptr<Database> database) {
  if (database == nullptr) return Farm::Open(options);
  absl::StatusOr<std::unique_ptr<SqlJobStore>> store = SqlJobStore::Open(
      options.state_directory, std::move(database), options.durability, options.parts);
  if (!store.ok()) return store.status();
  return Farm::Open(options, *std::move(store));
}

}  // namespace

absl::StatusOr<std::unique_ptr<CoordinatorServer>> CoordinatorServer::Start(
    const CoordinatorOptions& options, std::unique_ptr<Database> database) {
  const bool certified = AccessControl::Exists(options.farm.state_directory);
  for (const std::string& address : {options.listen_address, options.http_address}) {
    if (address.empty() || certified) continue;
    absl::Status safe = RequireSafeAddress(address, options.insecure_remote_allowed);
    if (!safe.ok()) return safe;
    WarnOfInsecureAddress(address);
  }
  std::unique_ptr<CoordinatorServer> server(new CoordinatorServer());
  FarmOptions farm_options = options.farm;
  if (!options.objects_url.empty()) {
    absl::StatusOr<FarmObjects> objects =
        OpenFarmObjects(options.objects_url, options.farm.state_directory, options.environment);
    if (!objects.ok()) return objects.status();
    server->objects_ = *std::move(objects);
    farm_options.parts = server->objects_.parts.get();
    farm_options.content = server->objects_.content.get();
  }
  absl::StatusOr<std::unique_ptr<Farm>> farm = OpenFarm(farm_options, std::move(database));
  if (!farm.ok()) return farm.status();
  server->farm_ = std::move(*farm);
  if (certified) {
    if (absl::Status status = server->OpenAccess(options); !status.ok()) return status;
  }
  server->job_service_ = std::make_unique<JobService>(server->farm_.get(), server->access_.get());
  if (absl::Status status = server->StartSubmissions(options); !status.ok()) return status;
  if (absl::Status status = server->StartHttp(options); !status.ok()) return status;
  if (absl::Status status = server->StartGrpc(options); !status.ok()) return status;
  return server;
}

absl::Status CoordinatorServer::OpenAccess(const CoordinatorOptions& options) {
  absl::StatusOr<std::unique_ptr<AccessControl>> access = AccessControl::Open(
      options.farm.state_directory, options.certificate_lifetimes, options.identity_limits);
  if (!access.ok()) return access.status();
  access_ = *std::move(access);
  const absl::Status renewed = access_->authority().RenewServerCertificate(absl::Now()).status();
  if (!renewed.ok()) return renewed;
  certificate_upkeep_ = std::jthread(
      [this](const std::stop_token& stop) { KeepServerCertified(stop, access_->authority()); });
  return absl::OkStatus();
}

void CoordinatorServer::AddListeningPort(const CoordinatorOptions& options,
                                         grpc::ServerBuilder* builder) {
  if (options.listen_address.empty()) return;
  if (access_ == nullptr) {
    builder->AddListeningPort(options.listen_address, PlainServerCredentials(), &port_);
    return;
  }
  const CertificateLifetimes& lifetimes = options.certificate_lifetimes;
  const absl::Duration age_max =
      std::min({kConnectionAgeMax, lifetimes.worker / 8, lifetimes.user / 8});
  builder->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS,
                              static_cast<int>(absl::ToInt64Milliseconds(age_max)));
  builder->AddListeningPort(options.listen_address,
                            TlsServerCredentials(access_->authority().server_files(),
                                                 std::make_shared<CallGate>(access_.get())),
                            &port_);
}

absl::Status CoordinatorServer::StartSubmissions(const CoordinatorOptions& options) {
  if (options.http_address.empty()) return absl::OkStatus();
  SubmissionOptions dropped;
  dropped.folder = absl::StrCat(options.farm.state_directory, "/dropped");
  dropped.program = options.scene_reader;
  dropped.limits.bytes_max = options.drop_bytes_max;
  if (options.drop_bytes_max == 0) {
    dropped.why_not = "this coordinator takes no dropped scenes (--drop-bytes-max 0)";
  } else if (options.scene_reader.empty()) {
    dropped.why_not =
        "this coordinator reads no scenes: the program sheaf is not installed beside "
        "sheaf-coordinator";
  }
  dropped.write_with_space = [farm = farm_.get()](uint64_t bytes,
                                                  const std::function<absl::Status()>& write) {
    const absl::StatusOr<UploadClaim> claim = farm->keeper().ClaimUpload("", bytes);
    return claim.ok() ? write() : claim.status();
  };
  const DroppedJobsTo to{farm_.get(), job_service_.get(), access_.get()};
  absl::StatusOr<std::unique_ptr<Submissions>> submissions = Submissions::Start(
      std::move(dropped),
      [to](const SubmissionCaller& caller, const std::string& folder,
           const v1::PrepareReply& reply) { return MakeDroppedJob(to, caller, folder, reply); });
  if (!submissions.ok()) return submissions.status();
  submissions_ = *std::move(submissions);
  return absl::OkStatus();
}

absl::Status CoordinatorServer::StartGrpc(const CoordinatorOptions& options) {
  worker_service_ = std::make_unique<WorkerService>(farm_.get(), access_.get());
  content_service_ = std::make_unique<ContentService>(farm_.get(), access_.get());
  transfer_service_ = std::make_unique<TransferService>(farm_.get(), access_.get());
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  ApplyServerLimits(&builder);
  TimeCalls(&metrics_.grpc_calls, &builder);
  AddListeningPort(options, &builder);
  if (access_ != nullptr) {
    access_service_ = std::make_unique<AccessService>(access_.get(), http_port());
    builder.RegisterService(access_service_.get());
  }
  builder.RegisterService(job_service_.get());
  builder.RegisterService(worker_service_.get());
  builder.RegisterService(content_service_.get());
  builder.RegisterService(transfer_service_.get());
  server_ = builder.BuildAndStart();
  const bool listens = options.listen_address.empty() || port_ != 0;
  if (server_ == nullptr || !listens) return PortInUseError(options.listen_address);
  shown_port_ = port_;
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
  http.metrics = &metrics_;
  http.submissions = submissions_.get();
  http.server.allow_remote = options.insecure_remote_allowed || access_ != nullptr;
  if (access_ != nullptr) {
    http.access = access_.get();
    http.server.tls = access_->authority().server_files();
    // Browsers reach the page under the names that the certificate states.
    const absl::StatusOr<std::vector<std::string>> hosts = access_->authority().Hosts();
    if (!hosts.ok()) return hosts.status();
    http.allowed_hosts.insert(http.allowed_hosts.end(), hosts->begin(), hosts->end());
  }
  FarmActions actions = ActionsOn(farm_.get());
  actions.address = [this] { return FarmAddress{shown_port_, access_ != nullptr}; };
  absl::StatusOr<std::unique_ptr<HttpService>> service =
      HttpService::Start(http, farm_->view(), std::move(actions));
  if (!service.ok()) return service.status();
  http_ = std::move(*service);
  return absl::OkStatus();
}

CoordinatorServer::~CoordinatorServer() { Stop(); }

void CoordinatorServer::Stop() {
  http_.reset();
  submissions_.reset();
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
  return server_->experimental().InProcessChannelWithInterceptors(arguments, ProtocolOfClient());
}

}  // namespace sheaf::coordinator
