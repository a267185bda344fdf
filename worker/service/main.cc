// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf-worker: parses its command line, connects, and works until it is requested to stop.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/kept_memory.h"
#include "common/base/label.h"
#include "common/base/log.h"
#include "common/base/open_files.h"
#include "common/base/surroundings/standard_streams.h"
#include "common/command_line/command_line.h"
#include "common/command_line/completion.h"
#include "common/rpc/address.h"
#include "common/rpc/address_list.h"
#include "common/rpc/certificate_renewal.h"
#include "common/rpc/enrolment.h"
#include "common/rpc/farm_connection.h"
#include "common/rpc/protocol_version.h"
#include "common/service_manager/service_manager.h"
#include "common/service_manager/watchdog.h"
#include "worker/sandbox/scene_server.h"
#include "worker/service/embedded_worker.h"
#include "worker/service/stop_signals.h"
#include "worker/service/yield_command_line.h"

namespace sheaf::worker {
namespace {

constexpr int kExitCannotStart = 1;
constexpr double kSecondsMax = 1e6;

struct Arguments {
  WorkerOptions worker;
  bool insecure = false;
  std::string token_file;
  std::string identity_directory = CredentialStore::WorkerDirectory();
  std::string log_level = "info";
  double grace_seconds = 10;
  double exit_when_idle_seconds = 0;
  std::string sandbox = "best";
  std::optional<double> load_seconds_max;
  double task_seconds_max = 3600;
  bool no_peers = false;
  YieldArguments yield;
};

void AddPeerOptions(CLI::App* app, Arguments* arguments) {
  app->add_flag("--no-peers", arguments->no_peers,
                "Fetch scene files from the coordinator alone, and serve none to other workers");
  app->add_option("--peer-port", arguments->worker.peers.port,
                  "Port at which other workers of the farm fetch scene files from this one, over\n"
                  "mutual TLS; 0: the system chooses")
      ->check(InRange(0, 65535))
      ->capture_default_str();
  app->add_option("--peer-bytes-per-second-max", arguments->worker.peers.bytes_per_second_max,
                  "Limit of what they fetch, e.g. 100M (default: none)")
      ->transform(AsBytes());
}

// As the coordinator checks them.
const CLI::Validator CheckLabel([](const std::string& text) { return WhyNoLabel(text); }, "");

void AddSandboxOptions(CLI::App* app, Arguments* arguments) {
  app->add_option("--sandbox", arguments->sandbox,
                  "Each scene renders in a process of its own, without network, that sees no\n"
                  "files but the scene's. required: with all protections, or not at all;\n"
                  "best: with those that this system permits, which the log names;\n"
                  "none: in the worker's process, only for scenes that you trust")
      ->check(IsOneOf({"required", "best", "none"}))
      ->capture_default_str();
  app->add_option("--load-seconds-max", arguments->load_seconds_max,
                  "Time to load a scene, after which its process is killed (default: 120, and\n"
                  "1 for each megabyte of the scene's files)")
      ->check(InRange(1.0, kSecondsMax));
  app->add_option("--task-seconds-max", arguments->task_seconds_max,
                  "Time to render a task, after which its scene's process is killed")
      ->check(InRange(1.0, kSecondsMax))
      ->capture_default_str();
}

void AddOptions(CLI::App* app, Arguments* arguments) {
  WorkerOptions& worker = arguments->worker;
  app->add_option(
         "--coordinator", arguments->worker.coordinator,
         absl::StrCat("Address of the coordinator, HOST:PORT or HOST (port ", kCoordinatorPort,
                      "); of several that share a farm: all, separated by commas"))
      ->transform(CLI::Validator(CompleteCoordinatorAddress, ""))
      ->envname("SHEAF_COORDINATOR")
      ->capture_default_str();
  app->add_flag("--insecure", arguments->insecure,
                "For experiments: connect without encryption to a coordinator on another machine");
  app->add_option("--token", arguments->token_file,
                  "File with the token that sheaf-coordinator enroll worker NAME printed; -: "
                  "standard input. Needed once: later starts use the certificate that it gives")
      ->envname("SHEAF_TOKEN_FILE")
      ->type_name("FILE");
  app->add_option("--identity-dir", arguments->identity_directory,
                  "Directory of this machine's key and certificate, shared by its workers")
      ->type_name("DIR")
      ->capture_default_str();
  app->add_option("--threads", worker.thread_count, "Threads that render; 0: all processors")
      ->check(InRange(0, 4096))
      ->capture_default_str();
  app->add_option("--pool", worker.pool,
                  "Pool of this machine: it renders only jobs of this pool (default: default)")
      ->check(CheckLabel)
      ->type_name("NAME");
  app->add_option("--tag", worker.tags,
                  "Something that this machine has and jobs may require (sheaf submit --require);\n"
                  "may be given several times")
      ->allow_extra_args(false)
      ->check(CheckLabel)
      ->type_name("NAME");
  app->add_option("--cache-dir", worker.cache_directory,
                  "Directory of scene files, shared by all workers of this machine")
      ->default_str(DefaultCacheDirectory());
  app->add_option("--cache-bytes-max", worker.cache_bytes_max,
                  "Limit of that directory, e.g. 20G (default 20G)")
      ->transform(AsBytes());
  app->add_option("--scene-memory-max", worker.scene_memory_bytes_max,
                  "Limit of memory for loaded scenes, e.g. 4G (default 4G, and never more than\n"
                  "the machine, its control group or ulimit -v leave)")
      ->transform(AsBytes());
  app->add_option("--texture-memory-max", worker.texture_memory_bytes_max,
                  "Limit of memory for texture tiles, e.g. 512M (default 512M)")
      ->transform(AsBytes());
  app->add_option("--volume-memory-max", worker.volume_memory_bytes_max,
                  "Limit of memory for volumes that sheaf pack made, e.g. 2G (default 512M);\n"
                  "other volumes are read into the memory for scenes")
      ->transform(AsBytes());
  app->add_option("--queued-leases-max", worker.leases_ahead,
                  "Tasks to queue while all threads are busy")
      ->check(InRange(0, 1024))
      ->capture_default_str();
  app->add_option("--grace-seconds", arguments->grace_seconds,
                  "Time to finish running tasks after a request to stop")
      ->check(InRange(0.0, kSecondsMax))
      ->capture_default_str();
  app->add_option("--exit-when-idle-seconds", arguments->exit_when_idle_seconds,
                  "Exit after this time without work; 0: never")
      ->check(InRange(0.0, kSecondsMax))
      ->capture_default_str();
  app->add_option("--log-level", arguments->log_level, "debug, info, warning, error or off")
      ->check(IsOneOf({"debug", "info", "warning", "error", "off"}))
      ->capture_default_str();
}

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<int64_t>(seconds * 1000));
}

// The way to the coordinator: enrolled earlier, enrolled now with the token, or in plain text.
absl::StatusOr<FarmConnection> Connect(const Arguments& arguments) {
  const std::string& address = arguments.worker.coordinator;
  const CredentialStore store(arguments.identity_directory);
  if (!arguments.token_file.empty() && !HasValidCertificate(store.Find(address))) {
    const absl::StatusOr<EnrolmentToken> token = ReadTokenFile(arguments.token_file);
    if (!token.ok()) return token.status();
    const absl::StatusOr<Enrolment> enrolled = Enroll(address, *token, store);
    if (!enrolled.ok()) return enrolled.status();
    LogInfo(absl::StrCat("enrolled as ", enrolled->identity, " at ", address));
  }
  return ConnectionTo(address, store, arguments.insecure);
}

// Without certificates workers talk to each other on their own machine alone.
bool MayUsePeers(const FarmConnection& connection) {
  return connection.files ||
         std::ranges::all_of(SplitAddresses(connection.address), [](const std::string& address) {
           const absl::StatusOr<Address> coordinator = ParseAddress(address);
           return coordinator.ok() && IsLoopback(*coordinator);
         });
}

// Why the worker takes no work now, which the service manager hears as well.
std::function<std::string(uint64_t)> TellWhyAway(const ServiceManager& manager,
                                                 std::function<std::string(uint64_t)> why_away,
                                                 const std::string& at_work) {
  if (!why_away) return nullptr;
  return [&manager, at_work, told = at_work,
          why_away = std::move(why_away)](uint64_t scene_bytes) mutable {
    std::string reason = why_away(scene_bytes);
    const std::string status = reason.empty() ? at_work : "takes no work: " + reason;
    if (status != std::exchange(told, status)) manager.Status(status);
    return reason;
  };
}

int Work(const Arguments& arguments) {
  // Before any thread exists, as it changes the environment.
  const ServiceManager manager;
  std::stop_source stop;
  // Before any other thread exists, so that all threads block these signals.
  const StopSignals signals([&stop, &manager](int, int count) {
    manager.Stopping();
    if (count > 1) {
      LogWarning(
          "second request to stop: exiting at once; leases expire and other workers take them");
      ::_exit(1);
    }
    stop.request_stop();
  });
  const absl::StatusOr<FarmConnection> connection = Connect(arguments);
  if (!connection.ok()) {
    LogError(std::string(connection.status().message()));
    return kExitCannotStart;
  }
  std::optional<CertificateRenewal> renewal;
  if (connection->files) renewal.emplace(connection->address, *connection->files);
  WorkerOptions options = arguments.worker;
  options.reports_content = true;
  options.peers.files = connection->files;
  options.peers.enabled = !arguments.no_peers && MayUsePeers(*connection);
  const std::string at_work = absl::StrCat("works for ", arguments.worker.coordinator);
  options.why_away = TellWhyAway(manager, WhyAwayBy(arguments.yield), at_work);
  const absl::StatusOr<std::unique_ptr<EmbeddedWorker>> worker =
      EmbeddedWorker::Open(connection->Open(), connection->Open(), options);
  if (!worker.ok()) {
    LogError(std::string(worker.status().message()));
    return kExitCannotStart;
  }
  if (arguments.worker.sandbox.mode == SandboxMode::kNone) {
    LogInfo("scenes render in this process, unprotected (--sandbox=none)");
  }
  LogInfo(absl::StrCat((*worker)->worker_id(), " ", at_work));
  // Ready as soon as it waits for work: the coordinator may be away for long.
  manager.Ready(at_work);
  const Watchdog watchdog(&manager, [&worker] { return (*worker)->IsAlive(); });
  const absl::Status status = (*worker)->Run(stop.get_token());
  if (!status.ok()) LogWarning(std::string(status.message()));
  const AgentCounts counts = (*worker)->counts();
  LogInfo(absl::StrCat("stopped: ", counts.accepted, " results accepted, ",
                       counts.duplicate_equal + counts.superseded, " not needed, ", counts.failed,
                       " failed"));
  return 0;
}

void Report(const std::string& text) { std::fprintf(stderr, "sheaf-worker: %s\n", text.c_str()); }

int Main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == kSceneProcessFlag) return RunDirectSceneProcess();
  KeepFreedMemory();
  Arguments arguments;
  arguments.worker.coordinator = kCoordinatorAddress;
  arguments.worker.cache_directory = DefaultCacheDirectory();
  CLI::App app(
      "Renders tasks of a Sheaf coordinator. Start any number of workers, on any machine, at any\n"
      "time; on SIGTERM a worker finishes its tasks or returns them.",
      "sheaf-worker");
  app.footer(
      "Examples:\n"
      "  sheaf-worker --coordinator farm.example.org:7400 --threads 16\n"
      "  sheaf-worker --coordinator farm.example.org --token token\n"
      "  sheaf-worker --coordinator farm.example.org --hours 19:00-07:00,Sat-Sun --yield-load 1");
  app.set_version_flag("--version",
                       absl::StrCat("sheaf-worker " SHEAF_VERSION ", ", DescribeProtocol()));
  AddOptions(&app, &arguments);
  AddSandboxOptions(&app, &arguments);
  AddPeerOptions(&app, &arguments);
  AddYieldOptions(&app, &arguments.yield);
  AddCompletionOption(&app);
  if (const std::optional<int> code = ParseCommandLine(&app, argc, argv, Report)) return *code;
  LogLevel level = LogLevel::kInfo;
  LogLevelFromName(arguments.log_level, &level);
  SetLogLevel(level);
  SetLogName("sheaf-worker");
  // Our own errors are one line each; gRPC's internal ones beside them help no user.
  setenv("GRPC_VERBOSITY", "NONE", /*replace=*/0);
  RaiseOpenFileLimit();
  if (const absl::Status applied = ApplyNice(arguments.yield); !applied.ok()) {
    Report(std::string(applied.message()));
    return absl::IsInvalidArgument(applied) ? kUsageExitCode : kExitCannotStart;
  }
  arguments.worker.grace = Milliseconds(arguments.grace_seconds);
  arguments.worker.exit_when_idle = Milliseconds(arguments.exit_when_idle_seconds);
  SandboxOptions& sandbox = arguments.worker.sandbox;
  sandbox.mode = SandboxModeFromName(arguments.sandbox).value();
  sandbox.program.arguments = {"sheaf-worker", kSceneProcessFlag};
  if (arguments.load_seconds_max.has_value()) {
    sandbox.load_time_max = absl::Seconds(*arguments.load_seconds_max);
  }
  sandbox.task_time_max = absl::Seconds(arguments.task_seconds_max);
  return Work(arguments);
}

}  // namespace
}  // namespace sheaf::worker

int main(int argc, char** argv) {
  return sheaf::CodeAfterOutput(sheaf::worker::Main(argc, argv), sheaf::worker::Report);
}
