// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/local_farm.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/base/file.h"
#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "common/base/memory_room.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"
#include "common/content/file_descriptor.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

// How long to wait for the worker's first report before continuing without it.
constexpr absl::Duration kWorkerReportWait = absl::Seconds(2);

// Waits for the worker that is just starting, so that the first progress line does not report that
// no worker is connected.
void AwaitWorker(const coordinator::FarmView& farm) {
  const SteadyTime deadline = SteadyTime::Now() + kWorkerReportWait;
  while (true) {
    const uint64_t seen = farm.ChangeCount();
    const absl::Duration rest = deadline - SteadyTime::Now();
    if (!farm.ListWorkers().empty() || rest <= absl::ZeroDuration()) return;
    farm.WaitForChange(seen, rest);
  }
}

}  // namespace

constexpr char kPrefix[] = "sheaf-render-";
// A file in each temporary folder, locked by its process. Its name says that no user was told to
// keep the folder.
constexpr char kOwnerFile[] = "/temporary";

// The file with its lock held; invalid if another process holds the lock, or if there is no file.
FileDescriptor OpenLocked(const std::string& path, int flags) {
  FileDescriptor file(::open(path.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC | flags, 0600));
  if (file.ok() && ::flock(file.get(), LOCK_EX | LOCK_NB) != 0) file.Close();
  return file;
}

// Makes the folder's owner file, which is locked before others see it.
absl::StatusOr<FileDescriptor> MakeOwnerFile(const std::string& folder) {
  const std::string path = folder + kOwnerFile, unseen = path + ".new";
  FileDescriptor file = OpenLocked(unseen, O_CREAT | O_EXCL);
  if (file.ok() && ::rename(unseen.c_str(), path.c_str()) == 0) return file;
  return StatusFromErrno(errno, absl::StrCat("making ", path));
}

// Removes folders left by killed processes. Folders of other users fail, and stay.
void RemoveLeftovers(const std::string& parent) {
  std::error_code error;
  for (fs::directory_iterator it(parent, error), end; !error && it != end; it.increment(error)) {
    if (!it->path().filename().string().starts_with(kPrefix)) continue;
    std::error_code ignored;
    if (!fs::is_directory(it->symlink_status(ignored))) continue;
    const FileDescriptor lock = OpenLocked(it->path().string() + kOwnerFile, 0);
    if (lock.ok()) fs::remove_all(it->path(), ignored);
  }
}

// The folder for one run's state. It is removed at the end unless the caller named it.
class LocalFarm::StateDirectory {
 public:
  static absl::StatusOr<std::unique_ptr<StateDirectory>> Open(const std::string& kept) {
    if (!kept.empty()) {
      if (absl::Status status = MakeDirectories(kept); !status.ok()) return status;
      return std::unique_ptr<StateDirectory>(new StateDirectory(kept, FileDescriptor()));
    }
    const char* named = std::getenv("TMPDIR");
    const std::string parent = named == nullptr || named[0] == '\0' ? "/tmp" : named;
    RemoveLeftovers(parent);
    std::string path = absl::StrCat(parent, "/", kPrefix, "XXXXXX");
    if (::mkdtemp(path.data()) == nullptr) {
      return StatusFromErrno(errno, absl::StrCat("creating a folder ", path,
                                                 " (choose another with TMPDIR or --keep-state)"));
    }
    absl::StatusOr<FileDescriptor> owner = MakeOwnerFile(path);
    if (!owner.ok()) return owner.status();
    return std::unique_ptr<StateDirectory>(new StateDirectory(path, *std::move(owner)));
  }
  ~StateDirectory() {
    std::error_code ignored;  // Files left in a temporary folder are harmless.
    if (owner_.ok()) fs::remove_all(path_, ignored);
  }
  StateDirectory(const StateDirectory&) = delete;
  StateDirectory& operator=(const StateDirectory&) = delete;
  const std::string& path() const { return path_; }
  void Keep() {
    if (owner_.ok()) ::unlink((path_ + kOwnerFile).c_str());
    owner_.Close();
  }

 private:
  // owner: invalid for a folder that is kept.
  StateDirectory(std::string path, FileDescriptor owner)
      : path_(std::move(path)), owner_(std::move(owner)) {}
  const std::string path_;
  FileDescriptor owner_;
};

std::shared_ptr<worker::DirectScenes> ScenesOf(PreparedJob* job,
                                               worker::DirectScenes::MemoryWatch watch) {
  auto scenes =
      std::make_shared<worker::DirectScenes>([] { return FindMemoryRoom(); }, std::move(watch));
  if (job->description) {
    scenes->Expect(job->frames.front().manifest.sha256_hex, *std::move(job->description));
    job->description.reset();
  }
  return scenes;
}

LocalFarm::LocalFarm() = default;
LocalFarm::~LocalFarm() = default;

absl::StatusOr<std::unique_ptr<LocalFarm>> LocalFarm::Open(const LocalFarmOptions& options) {
  const PhaseTimer timer(LoadPhase::kFarm);
  std::unique_ptr<LocalFarm> farm(new LocalFarm());
  farm->options_ = options;
  absl::StatusOr<std::unique_ptr<StateDirectory>> state = StateDirectory::Open(options.kept_state);
  if (!state.ok()) return state.status();
  farm->state_ = *std::move(state);
  coordinator::CoordinatorOptions coordinator;
  coordinator.farm.state_directory = farm->state_->path();
  // The disk is the user's: no other jobs need space on it.
  coordinator.farm.retention.free_bytes_min = 0;
  coordinator.farm.space_advice =
      options.kept_state.empty()
          ? "choose a folder on a larger one with TMPDIR, or with --keep-state"
          : "choose a folder on a larger one with --keep-state";
  if (options.kept_state.empty()) {  // The state ends with this process.
    coordinator.farm.durability = coordinator::Durability::kProcess;
    coordinator.farm.kept_parts_bytes_max = 0;
  }
  if (options.http_address.empty()) coordinator.farm.round_previews_bytes_max = 0;  // No page.
  // There is no other worker to wait for.
  coordinator.farm.limits.poison_workers_max = 1;
  // The end of the job says why it failed, once.
  coordinator.farm.warns_of_failed_jobs = false;
  farm->options_.worker.warns_of_failed_leases = false;
  coordinator.listen_address.clear();
  coordinator.http_address = options.http_address;
  absl::StatusOr<std::unique_ptr<coordinator::CoordinatorServer>> server =
      coordinator::CoordinatorServer::Start(coordinator);
  if (!server.ok()) return server.status();
  farm->server_ = *std::move(server);
  farm->channel_ = farm->server_->InProcessChannel();
  farm->options_.worker.cache_directory = absl::StrCat(farm->state_->path(), "/cache");
  farm->options_.worker.cache_lender = farm->blobs();
  farm->options_.worker.grace = std::chrono::milliseconds(0);
  return farm;
}

const std::string& LocalFarm::KeepState() {
  state_->Keep();
  return state_->path();
}

uint64_t LocalFarm::film_bytes() const { return server_->farm().metrics().MergeBytes(); }

absl::Status LocalFarm::StartWorker() {
  absl::StatusOr<std::unique_ptr<worker::EmbeddedWorker>> worker =
      worker::EmbeddedWorker::Open(channel_, channel_, options_.worker);
  if (!worker.ok()) return worker.status();
  worker_ = *std::move(worker);
  working_ = std::jthread([this](std::stop_token stop) {
    if (absl::Status status = worker_->Run(stop); !status.ok()) {
      LogWarning(std::string(status.message()));
    }
  });
  AwaitWorker(server_->farm().view());
  return absl::OkStatus();
}

}  // namespace sheaf::cli
