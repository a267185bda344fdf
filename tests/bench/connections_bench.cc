// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Durable results per second of a coordinator by the number of workers that are connected to it:
// real connections with TLS, checks on, every part written and synchronized. Parts are made before
// the time is taken. The coordinator is a process of its own, so its CPU time and memory are its
// alone; perf or a debugger can be attached to it. The load runs on the same machine: what it takes
// is printed beside, for a coordinator that had the machine alone would have that, too.
//
//   connections_bench DIRECTORY [WORKERS...]   a new folder on the disk to measure; 100 1000 10000
//                                              workers unless said otherwise
//                                              SHEAF_BENCH_LEASES=N: leases that a worker holds,
//                                              and delivers, at once; 2 otherwise
//                                              SHEAF_BENCH_APART=1: a call for each result and one
//                                              for the leases, as workers of older versions do
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/rpc/channel.h"
#include "common/rpc/enrolment.h"
#include "common/rpc/manifest_codec.h"
#include "common/rpc/settings_codec.h"
#include "common/rpc/tls_credentials.h"
#include "coordinator/service/server/coordinator_server.h"
#include "sheaf/v1/job.grpc.pb.h"
#include "tests/support/farm/synthetic_worker.h"

namespace sheaf::coordinator {
namespace {

// Threads that make the load; each has one certificate and its share of the workers.
constexpr int kThreads = 8;
constexpr int kFrames = 3;
constexpr int kEdgePx = 768;
constexpr int kTileEdgePx = 8;  // A part of about 24 KB.
constexpr uint64_t kSamples = 16;
constexpr int kLeases = 2;
constexpr absl::Duration kMeasured = absl::Seconds(15);
constexpr absl::Duration kStartMax = absl::Seconds(60);
constexpr absl::Duration kServed = absl::Minutes(10);  // Then a coordinator ends by itself.

v1::CreateJobRequest JobOf(Farm& farm) {
  const absl::StatusOr<BlobDigest> file = farm.blobs().Put("a scene");
  SHEAF_CHECK(file.ok());
  const absl::StatusOr<BlobDigest> manifest =
      farm.blobs().Put(EncodeManifest(MakeManifest("scene.pbrt", {{"scene.pbrt", *file}})));
  SHEAF_CHECK(manifest.ok());
  v1::CreateJobRequest request;
  request.set_request_id("request");
  request.set_title("connections");
  request.mutable_partition()->set_tile_size_px(kTileEdgePx);
  request.mutable_partition()->set_pass_sample_count(kSamples);
  request.mutable_partition()->set_lease_pass_count(1);
  for (int number = 1; number <= kFrames; ++number) {
    v1::FrameSpec* frame = request.add_frames();
    frame->set_frame_number(number);
    frame->mutable_scene()->set_sha256_hex(manifest->sha256_hex);
    frame->mutable_scene()->set_size_bytes(manifest->size_bytes);
    v1::FrameSettings* settings = frame->mutable_settings();
    settings->set_width_px(kEdgePx);
    settings->set_height_px(kEdgePx);
    settings->mutable_window()->set_x1_px(kEdgePx);
    settings->mutable_window()->set_y1_px(kEdgePx);
    settings->set_sample_count(kSamples);
    settings->set_depth_max(5);
    settings->set_seed(static_cast<uint64_t>(number));
  }
  return request;
}

// One lease of each frame, as far as parts depend on it.
std::vector<v1::Lease> LeasesOf(const v1::CreateJobRequest& job) {
  std::vector<v1::Lease> leases;
  for (const v1::FrameSpec& frame : job.frames()) {
    const absl::StatusOr<FrameSettings> settings = sheaf::FromWire(frame.settings());
    SHEAF_CHECK(settings.ok());
    v1::Lease& lease = leases.emplace_back();
    *lease.mutable_settings() = frame.settings();
    lease.mutable_key()->set_frame_digest(
        FrameDigest(frame.scene().sha256_hex(), *settings, NumericProfile()));
    lease.mutable_key()->mutable_block()->set_count(kSamples);
  }
  return leases;
}

// The coordinator's process tells the load by a file: address, one-time tokens, and the job.
struct Told {
  std::string address;
  std::vector<std::string> secrets;  // One for each thread.
  std::string authority_pem;
  v1::CreateJobRequest job;
};

// The coordinator's process, until it is killed.
void Serve(const std::string& directory) {
  SHEAF_CHECK(CertificateAuthority::Create(AccessControl::Directory(directory),
                                           {"localhost", "127.0.0.1"}, absl::Now())
                  .ok());
  CoordinatorOptions options;
  options.farm.state_directory = directory;
  options.listen_address = "127.0.0.1:0";
  const auto server = CoordinatorServer::Start(options);
  SHEAF_CHECK(server.ok());
  AccessControl* const access = (*server)->access();
  std::ofstream told(directory + "/told.new");
  told << "127.0.0.1:" << (*server)->port() << '\n';
  for (int i = 0; i < kThreads; ++i) {
    const auto secret = access->identities().MakeToken(
        {IdentityKind::kWorker, absl::StrCat("host", i)}, Role::kWork, absl::Now(), kTokenLifetime);
    SHEAF_CHECK(secret.ok());
    told << absl::BytesToHexString(*secret) << '\n';
  }
  const v1::CreateJobRequest request = JobOf((*server)->farm());
  const auto jobs = v1::JobService::NewStub((*server)->InProcessChannel());
  grpc::ClientContext context;
  SetDeadline(&context, kUnaryDeadline);
  v1::Job job;
  const grpc::Status created = jobs->CreateJob(&context, request, &job);
  if (!created.ok()) {
    std::fprintf(stderr, "no job: %s\n", created.error_message().c_str());
    return;
  }
  std::ofstream(directory + "/job") << request.SerializeAsString();
  told << access->authority().certificate_pem();
  told.close();
  std::filesystem::rename(directory + "/told.new", directory + "/told");
  absl::SleepFor(kServed);
}

Told ReadTold(const std::string& directory) {
  const absl::Time end = absl::Now() + kStartMax;
  while (!std::filesystem::exists(directory + "/told")) {
    SHEAF_CHECK(absl::Now() < end);
    absl::SleepFor(absl::Milliseconds(20));
  }
  Told told;
  std::ifstream file(directory + "/told");
  std::getline(file, told.address);
  told.secrets.resize(kThreads);
  for (std::string& secret : told.secrets) {
    std::getline(file, secret);
    secret = BytesOfHex(secret);
  }
  told.authority_pem.assign(std::istreambuf_iterator<char>(file), {});
  std::ifstream job(directory + "/job");
  SHEAF_CHECK(told.job.ParseFromIstream(&job));
  return told;
}

// The coordinator's process, seen from the load.
class Coordinator {
 public:
  explicit Coordinator(const std::string& directory) : pid_(::fork()) {
    SHEAF_CHECK(pid_ >= 0);
    if (pid_ > 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::execl("/proc/self/exe", "connections_bench", "--serve", directory.c_str(), nullptr);
    std::_Exit(1);
  }
  ~Coordinator() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Coordinator(const Coordinator&) = delete;
  Coordinator& operator=(const Coordinator&) = delete;

  pid_t pid() const { return pid_; }
  double CpuSeconds() const {
    std::ifstream file(absl::StrCat("/proc/", pid_, "/stat"));
    std::string text(std::istreambuf_iterator<char>(file), {});
    std::istringstream fields(text.substr(text.rfind(')') + 2));
    std::string other;
    for (int field = 3; field < 14; ++field) fields >> other;
    double user_ticks = 0, system_ticks = 0;
    fields >> user_ticks >> system_ticks;
    return (user_ticks + system_ticks) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  double PeakMib() const {
    std::ifstream file(absl::StrCat("/proc/", pid_, "/status"));
    for (std::string line; std::getline(file, line);) {
      if (line.starts_with("VmHWM:")) return std::atof(line.c_str() + 6) / 1024;
    }
    return 0;
  }

 private:
  const pid_t pid_;
};

double OwnCpuSeconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// The bytes of all parts, by frame digest and corner of the tile.
class Parts {
 public:
  explicit Parts(const std::vector<v1::Lease>& frames) {
    std::vector<std::jthread> threads;
    for (const v1::Lease& lease : frames) threads.emplace_back([=, this] { Render(lease); });
  }
  // The result of the lease, as the worker sends it.
  SyntheticWorker::Upload ResultOf(const v1::Lease& lease, const std::string& worker_id) const {
    SyntheticWorker::Upload upload = parts_.at(KeyOf(lease));
    *upload.header.mutable_key() = lease.key();
    upload.header.set_lease_id(lease.lease_id());
    upload.header.set_token(lease.token());
    upload.header.set_worker_id(worker_id);
    return upload;
  }
  double MeanKib() const {
    size_t bytes = 0;
    for (const auto& [key, part] : parts_) bytes += part.bytes.size();
    return static_cast<double>(bytes) / 1024 / static_cast<double>(parts_.size());
  }

 private:
  static std::string KeyOf(const v1::Lease& lease) {
    return absl::StrCat(lease.key().frame_digest(), " ", lease.key().tile().x0_px(), " ",
                        lease.key().tile().y0_px());
  }
  void Render(v1::Lease lease) {
    const SyntheticWorker renderer(MakeChannel("localhost:1"), "");  // Sends nothing.
    for (int32_t y = 0; y < kEdgePx; y += kTileEdgePx) {
      for (int32_t x = 0; x < kEdgePx; x += kTileEdgePx) {
        v1::PixelRect* const tile = lease.mutable_key()->mutable_tile();
        tile->set_x0_px(x);
        tile->set_y0_px(y);
        tile->set_x1_px(x + kTileEdgePx);
        tile->set_y1_px(y + kTileEdgePx);
        SyntheticWorker::Upload upload = renderer.MakeUpload(lease);
        const MutexLock lock(&mutex_);
        parts_[KeyOf(lease)] = std::move(upload);
      }
    }
  }

  Mutex mutex_;  // While they are made.
  std::map<std::string, SyntheticWorker::Upload> parts_;
};

struct Measured {
  uint64_t results = 0;
  std::vector<double> synchronize_ms, upload_ms;
};

double MillisecondsOf(absl::Time begin) { return absl::ToDoubleMilliseconds(absl::Now() - begin); }

double Percentile(std::vector<double>* values, double part) {
  if (values->empty()) return 0;
  std::ranges::sort(*values);
  return (*values)[static_cast<size_t>(part * static_cast<double>(values->size() - 1))];
}

struct Connected {
  std::string id;
  std::unique_ptr<SyntheticWorker> worker;
};

int LeasesAtOnce() {
  const char* const leases = std::getenv("SHEAF_BENCH_LEASES");
  return leases == nullptr ? kLeases : std::atoi(leases);
}

constexpr auto kAccepted = v1::UploadResultsResponse::OUTCOME_ACCEPTED;

// Asks for leases and delivers their results, each by a call. Returns whether there were leases.
bool DeliverApart(const Connected& one, const Parts& parts, Measured* measured) {
  const absl::Time asked = absl::Now();
  if (!one.worker->Synchronize(LeasesAtOnce()).ok()) return true;
  measured->synchronize_ms.push_back(MillisecondsOf(asked));
  for (const v1::Lease& lease : one.worker->leases()) {
    const SyntheticWorker::Upload upload = parts.ResultOf(lease, one.id);
    const absl::Time sent = absl::Now();
    const auto outcome = one.worker->Send(upload);
    if (!outcome.ok() || *outcome != kAccepted) continue;
    measured->upload_ms.push_back(MillisecondsOf(sent));
    ++measured->results;
  }
  return !one.worker->leases().empty();
}

// Delivers the results of its leases and gets the next ones by one call. Without leases it asks for
// some first. Returns whether there are leases.
bool DeliverTogether(const Connected& one, const Parts& parts, Measured* measured) {
  if (one.worker->leases().empty()) {
    const absl::Time asked = absl::Now();
    if (!one.worker->Synchronize(LeasesAtOnce()).ok()) return true;
    measured->synchronize_ms.push_back(MillisecondsOf(asked));
  }
  std::vector<SyntheticWorker::Upload> uploads;
  for (const v1::Lease& lease : one.worker->leases()) {
    uploads.push_back(parts.ResultOf(lease, one.id));
  }
  if (uploads.empty()) return false;
  const absl::Time sent = absl::Now();
  const auto outcomes = one.worker->Deliver(uploads, LeasesAtOnce());
  if (!outcomes.ok()) return true;
  measured->upload_ms.push_back(MillisecondsOf(sent));
  for (const auto outcome : *outcomes) measured->results += outcome == kAccepted ? 1 : 0;
  return !one.worker->leases().empty();
}

// Each worker in turn, until the end or without work.
Measured Deliver(const std::vector<Connected>& workers, const Parts& parts, absl::Time end) {
  const bool apart = std::getenv("SHEAF_BENCH_APART") != nullptr;
  Measured measured;
  bool found = true;
  while (found && absl::Now() < end) {
    found = false;
    for (const Connected& one : workers) {
      if (absl::Now() >= end) break;
      found |= apart ? DeliverApart(one, parts, &measured) : DeliverTogether(one, parts, &measured);
    }
  }
  return measured;
}

std::vector<Connected> Connect(const Told& told, int thread, int count,
                               const std::string& directory) {
  const CredentialStore store(absl::StrCat(directory, "/clients/", thread));
  const std::string& secret = told.secrets[static_cast<size_t>(thread)];
  const auto enrolled = Enroll(told.address, {secret, told.authority_pem}, store);
  if (!enrolled.ok()) std::fprintf(stderr, "%s\n", enrolled.status().ToString().c_str());
  SHEAF_CHECK(enrolled.ok());
  const auto files = store.Find(told.address);
  SHEAF_CHECK(files.has_value());
  const auto credentials = MutualTlsCredentials(*files);
  std::vector<Connected> workers;
  for (int i = 0; i < count; ++i) {
    const std::string id = absl::StrCat("w", thread, "-", i);
    workers.push_back(
        {id, std::make_unique<SyntheticWorker>(MakeChannel(told.address, credentials), id)});
    SHEAF_CHECK(workers.back().worker->Synchronize(0).ok());
  }
  return workers;
}

void Measure(const std::string& directory, int worker_count, std::unique_ptr<Parts>* made) {
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  const Coordinator coordinator(directory);
  const Told told = ReadTold(directory);
  // They are the same each time.
  if (*made == nullptr) *made = std::make_unique<Parts>(LeasesOf(told.job));
  const Parts& parts = **made;
  std::vector<std::vector<Connected>> workers(kThreads);
  const auto on_all_threads = [](const auto& work) {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) threads.emplace_back(work, i);
  };
  const absl::Time connecting = absl::Now();
  on_all_threads([&](int i) {
    workers[static_cast<size_t>(i)] = Connect(told, i, worker_count / kThreads, directory);
  });
  const double connect_seconds = absl::ToDoubleSeconds(absl::Now() - connecting);
  std::vector<Measured> measured(kThreads);
  std::fprintf(stderr, "%d workers are connected; the coordinator is process %d\n", worker_count,
               coordinator.pid());  // For a profiler.
  const double cpu = coordinator.CpuSeconds(), own_cpu = OwnCpuSeconds();
  const absl::Time begin = absl::Now();
  on_all_threads([&](int i) {
    measured[static_cast<size_t>(i)] =
        Deliver(workers[static_cast<size_t>(i)], parts, begin + kMeasured);
  });
  const double seconds = absl::ToDoubleSeconds(absl::Now() - begin);
  Measured all;
  for (const Measured& one : measured) {
    all.results += one.results;
    all.synchronize_ms.insert(all.synchronize_ms.end(), one.synchronize_ms.begin(),
                              one.synchronize_ms.end());
    all.upload_ms.insert(all.upload_ms.end(), one.upload_ms.begin(), one.upload_ms.end());
  }
  const auto results = static_cast<double>(std::max<uint64_t>(all.results, 1));
  std::printf("%7d  %9.0f  %14.2f  %7.2f  %8.1f  %8.1f  %8.1f  %8.1f  %8.0f  %10.1f  %5.1f\n",
              worker_count, results / seconds, 1000 * (coordinator.CpuSeconds() - cpu) / results,
              1000 * (OwnCpuSeconds() - own_cpu) / results, Percentile(&all.synchronize_ms, 0.5),
              Percentile(&all.synchronize_ms, 0.99), Percentile(&all.upload_ms, 0.5),
              Percentile(&all.upload_ms, 0.99), coordinator.PeakMib(), connect_seconds,
              parts.MeanKib());
  std::fflush(stdout);
}

}  // namespace
}  // namespace sheaf::coordinator

int main(int argc, char** argv) {
  using namespace sheaf::coordinator;  // NOLINT(google-build-using-namespace)
  if (argc == 3 && std::string(argv[1]) == "--serve") {
    Serve(argv[2]);
    return 0;
  }
  if (argc < 2) {
    std::fprintf(stderr, "usage: connections_bench DIRECTORY [WORKERS...]\n");
    return 2;
  }
  std::vector<int> counts = {100, 1000, 10000};
  if (argc > 2) counts.clear();
  for (int i = 2; i < argc; ++i) counts.push_back(std::atoi(argv[i]));
  std::printf(
      "                     CPU ms a result      Synchronize ms        upload ms      peak"
      "  connecting   part\n"
      "workers  results/s     coordinator     load       p50       p99       p50       p99"
      "       MiB           s    KiB\n");
  std::unique_ptr<Parts> parts;
  for (const int count : counts) Measure(argv[1], count, &parts);
  return 0;
}
