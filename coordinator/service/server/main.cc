// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf-coordinator: reads its command line, serves until SIGTERM or SIGINT.
// Exit codes: 0 stopped as asked; 1 could not run (one line says why); 2 wrong usage.
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/open_files.h"
#include "common/base/steady_time.h"
#include "common/base/surroundings/home_directory.h"
#include "common/base/surroundings/ignored_signals.h"
#include "common/base/surroundings/standard_streams.h"
#include "common/command_line/command_line.h"
#include "common/command_line/completion.h"
#include "common/rpc/address.h"
#include "common/rpc/protocol_version.h"
#include "common/scene/settings/render_settings.h"
#include "common/service_manager/service_manager.h"
#include "common/service_manager/watchdog.h"
#include "coordinator/service/server/access_commands.h"
#include "coordinator/service/server/coordinator_server.h"
#include "coordinator/service/server/shared_database.h"
#include "coordinator/service/server/state_privacy.h"

namespace sheaf::coordinator {
namespace {

struct CommandLine {
  CoordinatorOptions server;
  double lease_seconds = 30;
  std::string log_level = "info";
  std::string port_file;
  std::string database;  // The URL of a PostgreSQL database; empty: SQLite in the state directory.
  double takeover_seconds = absl::ToDoubleSeconds(kOwnerSilenceMax);
};

// A hard disk reads fifty times as fast; a terabyte takes three days.
constexpr uint64_t kScrubBytesPerSecondDefault = uint64_t{4} << 20;

// How long a coordinator that takes a farm over may load it, with a watchdog; as TimeoutStartSec of
// its unit (deploy/systemd).
constexpr absl::Duration kLoadMax = absl::Minutes(15);

// The program sheaf beside this one; empty if it is not there.
std::string SceneReaderBeside() {
  std::error_code error;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return "";
  std::string path = (own.parent_path() / "sheaf").string();
  return ::access(path.c_str(), X_OK) == 0 ? path : "";
}

std::string DefaultStateDirectory() {
  const std::string home = HomeDirectory();
  return home.empty() ? "" : absl::StrCat(home, "/.local/state/sheaf/coordinator");
}

// The options of limits for each identity.
void AddLimitOptions(CoordinatorOptions* server, CLI::App* app) {
  IdentityLimits& identity = server->identity_limits;
  Limits& farm = server->farm.limits;
  const char* const group = "Limits of each user and worker, with certificates";
  app->add_option("--calls-per-second-max", identity.calls_per_second_max,
                  "Calls and requests of an identity, after a burst of five times as many")
      ->check(InRange(1.0, 1e6))
      ->capture_default_str()
      ->group(group);
  app->add_option("--upload-per-day-max", identity.upload_bytes_per_day_max,
                  "Bytes of scenes that an identity uploads in a day, e.g. 2T (default 1T)")
      ->transform(AsBytes())
      ->group(group);
  app->add_option("--user-jobs-max", farm.owner_jobs_max, "Unfinished jobs of a user")
      ->check(InRange(int64_t{1}, int64_t{1'000'000}))
      ->capture_default_str()
      ->group(group);
  app->add_option("--user-bytes-max", farm.owner_bytes_max,
                  "Stored bytes of a user on the coordinator, e.g. 200G (default none): parts, "
                  "images, previews and files of scenes that no other user's jobs need. Beyond it "
                  "uploads and new jobs are refused")
      ->transform(AsBytes())
      ->group(group);
  app->add_option("--user-frames-max", farm.owner_frames_max, "Frames of a user's unfinished jobs")
      ->check(InRange(int64_t{1}, int64_t{1'000'000'000}))
      ->capture_default_str()
      ->group(group);
  app->add_option("--user-samples-max", farm.owner_samples_max,
                  "Pixels x samples of a user's unfinished jobs")
      ->check(InRange(int64_t{1}))
      ->capture_default_str()
      ->group(group);
}

// "7d", "12h", "90 min" or "forever". Errors: a message for users.
std::string ParseKeptDuration(const std::string& text, absl::Duration* duration) {
  if (text == "forever") {
    *duration = absl::InfiniteDuration();
    return "";
  }
  int64_t days = 0;
  if (text.ends_with('d') && absl::SimpleAtoi(text.substr(0, text.size() - 1), &days)) {
    *duration = absl::Hours(24) * days;
  } else if (!absl::ParseDuration(text, duration)) {
    return absl::StrCat("\"", text,
                        "\" is not a duration; use a form such as 7d, 12h, 30m or forever");
  }
  return *duration < absl::ZeroDuration() ? absl::StrCat(text, " is below 0") : "";
}

void AddDurationOption(const char* name, absl::Duration* duration, const char* help,
                       const char* group, CLI::App* app) {
  app->add_option_function<std::string>(
         name,
         [duration, name](const std::string& text) {
           const std::string problem = ParseKeptDuration(text, duration);
           if (!problem.empty()) throw CLI::ValidationError(name, problem);
         },
         help)
      ->type_name("DURATION")
      ->group(group);
}

// The options of retention.
void AddRetentionOptions(FarmOptions* farm, CLI::App* app) {
  RetentionLimits& limits = farm->retention;
  farm->scrub_bytes_per_second = kScrubBytesPerSecondDefault;
  farm->disk_reserve_bytes = kDiskReserveDefault;
  const char* const group = "Retention of jobs that have ended and are not pinned";
  AddDurationOption("--keep-parts", &limits.parts_age_max,
                    "Parts, with which sheaf refine continues, e.g. 12h (default 7d)", group, app);
  AddDurationOption("--keep-jobs", &limits.jobs_age_max,
                    "Jobs with their images, e.g. 90d (default forever)", group, app);
  app->add_option("--disk-limit", limits.bytes_max,
                  "Size of the state directory, e.g. 500G (default none). Above it the oldest are "
                  "removed: parts first, then files of scenes, previews, and jobs with their "
                  "images")
      ->transform(AsBytes())
      ->group(group);
  app->add_option(
         "--disk-free-min", limits.free_bytes_min,
         "Free space of its file system, e.g. 10G (default 1G, at most 1/20 of it): uploads leave "
         "it to jobs. Below it the oldest are removed, but not jobs")
      ->transform(AsBytes())
      ->group(group);
  app->add_option("--disk-reserve", farm->disk_reserve_bytes,
                  "Free space reserved for the database, e.g. 256M (default 64M, at most "
                  "1/8 of the file system), so that a coordinator with a full disk works and "
                  "starts. 0: none")
      ->transform(AsBytes())
      ->group(group);
  app->add_option("--kept-parts-max", farm->kept_parts_bytes_max,
                  "Disk space for parts, e.g. 20G: parts of delivered frames, also of unfinished "
                  "jobs, are kept within it for sheaf refine; the oldest are deleted first")
      ->transform(AsBytes())
      ->capture_default_str()
      ->group(group);
  app->add_option("--scrub-rate", farm->scrub_bytes_per_second,
                  "Bytes a second that are compared with their digests, e.g. 20M (default 4M); "
                  "repairs damage. 0 disables it")
      ->transform(AsBytes())
      ->group(group);
  app->add_option("--round-previews-max", farm->round_previews_bytes_max,
                  "Disk space for small images of the ends of rounds, e.g. 2G; the oldest are "
                  "deleted first, 0 keeps none")
      ->transform(AsBytes())
      ->capture_default_str()
      ->group(group);
}

void AddOptions(CommandLine* line, CLI::App* app) {
  FarmOptions& farm = line->server.farm;
  farm.state_directory = DefaultStateDirectory();
  line->server.scene_reader = SceneReaderBeside();
  line->server.listen_address = kCoordinatorAddress;
  line->server.http_address = "127.0.0.1:7480";
  app->add_option("--listen", line->server.listen_address,
                  "Address on which gRPC listens; port 0: any free port")
      ->capture_default_str();
  app->add_option("--http", line->server.http_address,
                  "Address of the web page, JSON and metrics; \"\": none")
      ->capture_default_str();
  app->add_option("--allow-host", line->server.allowed_hosts,
                  "A name under which browsers reach the page, besides localhost and addresses; "
                  "repeat it for more. Requests for other names are refused (DNS rebinding)")
      ->type_name("NAME")
      ->allow_extra_args(false);
  app->add_option("--state-dir", farm.state_directory,
                  "Directory of jobs, parts, scenes and images")
      ->capture_default_str();
  app->add_option("--database", line->database,
                  "PostgreSQL database of jobs, e.g. postgresql://sheaf@db.example.org/farm, for "
                  "several coordinators: one owns the farm, and another one takes over when it is "
                  "silent. All have the same state directory, on a disk that they share (default: "
                  "SQLite in the state directory)")
      ->envname("SHEAF_DATABASE")
      ->type_name("URL");
  app->add_option("--takeover-seconds", line->takeover_seconds,
                  "With --database: a coordinator that does not reach the database for longer "
                  "loses the farm to one that stands by")
      ->check(InRange(0.5, 3600.0))
      ->capture_default_str();
  app->add_option("--objects", line->server.objects_url,
                  "Bucket of an S3 server in which parts and files of scenes lie, as "
                  "s3://BUCKET/PREFIX (default: the state directory). Key, endpoint and region "
                  "come from AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_ENDPOINT_URL and "
                  "AWS_REGION, or from ~/.aws")
      ->type_name("URL");
  app->add_option("--lease-seconds", line->lease_seconds,
                  "A worker that is silent for longer counts as lost; its work goes to others")
      ->check(InRange(0.5, 86400.0))
      ->capture_default_str();
  app->add_option("--check-fraction", farm.limits.check_fraction,
                  "Fraction of tasks that two workers render, to detect false results; larger for "
                  "a worker's first results. 0: none")
      ->check(InRange(0.0, 1.0))
      ->capture_default_str();
  app->add_option("--poison-workers", farm.limits.poison_workers_max,
                  "Set a task aside after this many workers failed it (by a crash, lack of memory "
                  "or an invalid result); each worker tries once. 1: for a farm of one worker")
      ->check(InRange(1, 1000))
      ->capture_default_str();
  AddLimitOptions(&line->server, app);
  app->add_option("--merge-memory-max", farm.merge_bytes_max,
                  "Memory for unfinished tiles, e.g. 4G")
      ->transform(AsBytes())
      ->capture_default_str();
  AddRetentionOptions(&farm, app);
  app->add_option(
         "--drop-bytes-max", line->server.drop_bytes_max,
         "Size of the files of a scene that is dropped on the page, e.g. 16G (default 4G). 0: "
         "dropping is off")
      ->transform(AsBytes());
  app->add_flag("--insecure-allow-remote", line->server.insecure_remote_allowed,
                "For experiments: listen without encryption on addresses that other machines can "
                "reach; everyone who reaches them controls the farm");
  app->add_option("--log-level", line->log_level, "debug, info, warning, error or off")
      ->check(IsOneOf({"debug", "info", "warning", "error", "off"}))
      ->capture_default_str();
  app->add_option("--port-file", line->port_file,
                  "Write the ports in use to this file, as lines grpc=PORT and http=PORT");
}

// Fails with one line on standard error.
int Fail(const absl::Status& status) {
  std::fprintf(stderr, "sheaf-coordinator: %s\n", std::string(status.message()).c_str());
  return 1;
}

// Every thread inherits the mask, so that the signals wait for WaitForStop.
sigset_t BlockStopSignals() {
  const sigset_t signals = WithoutIgnored({SIGTERM, SIGINT});
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);  // Writing beyond ulimit -f fails instead.
  return signals;
}

// Sleeps; false: a signal asked to stop.
bool SleepUnlessSignalled(const sigset_t& signals, absl::Duration duration) {
  const timespec time = absl::ToTimespec(duration);
  return sigtimedwait(&signals, nullptr, &time) < 0;
}

// Stands by until this coordinator owns the farm. The service manager counts a standby as started
// and gets its watchdog messages.
absl::StatusOr<OwnedFarm> StandBy(const CommandLine& line, const ServiceManager& manager,
                                  const sigset_t& signals) {
  SharedDatabaseOptions options{line.database, line.server.listen_address,
                                absl::Seconds(line.takeover_seconds)};
  options.standing_by = [&manager](const std::string& words) { manager.Ready(words); };
  return OwnFarm(options, [&manager, &signals](absl::Duration duration) {
    manager.KeepAlive();
    return SleepUnlessSignalled(signals, duration);
  });
}

// Starts the server. The watchdog of one that stood by waits for the farm to be loaded.
absl::StatusOr<std::unique_ptr<CoordinatorServer>> Load(const CommandLine& line,
                                                        const ServiceManager& manager,
                                                        std::unique_ptr<Database> database) {
  const SteadyTime begin = SteadyTime::Now();
  std::optional<Watchdog> watchdog;
  if (database != nullptr) {
    watchdog.emplace(&manager, [begin] { return SteadyTime::Now() - begin < kLoadMax; });
  }
  return CoordinatorServer::Start(line.server, std::move(database));
}

int Serve(const CommandLine& line) {
  CloseStateDirectory(line.server.farm.state_directory);
  const ServiceManager manager;
  const sigset_t signals = BlockStopSignals();
  absl::StatusOr<OwnedFarm> owned = OwnedFarm();
  if (!line.database.empty()) {
    owned = StandBy(line, manager, signals);
    if (absl::IsCancelled(owned.status())) {
      manager.Stopping();
      LogInfo("stopping");
      return 0;
    }
    if (!owned.ok()) return Fail(owned.status());
  }
  absl::StatusOr<std::unique_ptr<CoordinatorServer>> server =
      Load(line, manager, std::move(owned->database));
  if (!server.ok()) return Fail(server.status());
  if (!line.port_file.empty()) {
    const absl::Status written = WriteFileAtomically(
        line.port_file,
        absl::StrCat("grpc=", (*server)->port(), "\nhttp=", (*server)->http_port(), "\n"));
    if (!written.ok()) return Fail(written);
  }
  LogInfo(absl::StrCat("serving gRPC on port ", (*server)->port(),
                       (*server)->http_url().empty() ? "" : ", the page at ", (*server)->http_url(),
                       ", state in ", line.server.farm.state_directory));
  LogInfo(absl::StrCat("numeric profile ", NumericProfile()));
  manager.Ready(absl::StrCat("serving gRPC on port ", (*server)->port()));
  // It answers once it has the farm's lock; no job has the number 0.
  Farm& farm = (*server)->farm();
  const Watchdog watchdog(&manager, [&farm] { return !farm.view().FindJob("0").ok(); });
  int received = 0;
  sigwait(&signals, &received);
  manager.Stopping();
  LogInfo("stopping");
  (*server)->Stop();
  return 0;
}

void Report(const std::string& text) {
  std::fprintf(stderr, "sheaf-coordinator: %s\n", text.c_str());
}

int Main(int argc, char** argv) {
  CommandLine line;
  CLI::App app(
      "Sheaf's coordinator: divides frames into tasks, leases them to workers, merges results.",
      "sheaf-coordinator");
  AddOptions(&line, &app);
  AccessCommands commands(DefaultStateDirectory());
  commands.AddTo(&app);
  AddCompletionOption(&app);
  app.footer(
      "Examples:\n"
      "  sheaf-coordinator --state-dir /var/lib/sheaf --listen 127.0.0.1:7400\n"
      "  sheaf-coordinator init --name farm.example.org && sheaf-coordinator --listen [::]:7400\n"
      "After init, connections are encrypted and every caller needs a certificate.\n"
      "Two coordinators, of which one stands by (docs/operations.md):\n"
      "  sheaf-coordinator --state-dir /shared/sheaf --database postgresql://sheaf@db/farm");
  app.set_version_flag("--version",
                       absl::StrCat("sheaf-coordinator " SHEAF_VERSION ", ", DescribeProtocol()));
  if (const std::optional<int> code = ParseCommandLine(&app, argc, argv, Report)) return *code;
  // Our own errors are one line each; gRPC's internal messages would only add noise.
  setenv("GRPC_VERBOSITY", "NONE", /*replace=*/0);
  SetLogName("sheaf-coordinator");
  if (const std::optional<absl::Status> ran = commands.RunParsed()) {
    return ran->ok() ? 0 : Fail(*ran);
  }
  if (line.server.farm.state_directory.empty()) return Fail(NoStateDirectory());
  RaiseOpenFileLimit();
  LogLevel level = LogLevel::kInfo;
  LogLevelFromName(line.log_level, &level);
  SetLogLevel(level);
  IdentityLimits& identity = line.server.identity_limits;
  identity.calls_burst_max = 5 * identity.calls_per_second_max;
  line.server.farm.limits.lease_duration = absl::Seconds(line.lease_seconds);
  return Serve(line);
}

}  // namespace
}  // namespace sheaf::coordinator

int main(int argc, char** argv) {
  return sheaf::CodeAfterOutput(sheaf::coordinator::Main(argc, argv), sheaf::coordinator::Report);
}
