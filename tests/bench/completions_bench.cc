// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The price of TLS and of checks: results per second that a coordinator accepts from synthetic
// workers over loopback, without both and with both, in turns. A job has many small tasks, so that
// the workers' rendering costs little. Prints each run, the medians and their ratio; the target is
// at least 0.8. Likewise the price of PostgreSQL against SQLite, if a database is given: by more
// workers, which call the coordinator within the process.
//
//   completions_bench        SHEAF_BENCH_ROUNDS=N: rounds, 5 unless said otherwise
//                            SHEAF_BENCH_SECONDS=N: the most that one run on a database takes, 10
//                            unless said otherwise
//                            SHEAF_BENCH_DATABASE=URL: of a PostgreSQL database, whose tables of
//                            jobs are removed
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/rpc/enrolment.h"
#include "common/rpc/farm_connection.h"
#include "coordinator/service/server/shared_database.h"
#include "coordinator/store/database/postgres_database.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

constexpr int kLeasesAhead = 8;
constexpr int kEdgePx = 512;
constexpr int kTileEdgePx = 8;  // A part of about 24 KB.
constexpr absl::Duration kRunMax = absl::Minutes(5);
constexpr int kDatabaseWorkerCount = 32;
constexpr absl::Duration kDatabaseRunMax = absl::Seconds(10);

struct Load {
  bool protect = false;
  std::string database = {};  // The URL of PostgreSQL's; empty: SQLite.
  int worker_count = 4;
  bool in_process = false;
  absl::Duration time_max = kRunMax;  // The job ends earlier, or is left.
};

class CompletionsBench : public CoordinatorServerTest {
 protected:
  // Results per second of one job.
  double Run(const Load& load) {
    std::filesystem::remove_all(directory_);
    if (load.protect) {
      EXPECT_TRUE(CertificateAuthority::Create(AccessControl::Directory(directory_),
                                               {"localhost", "127.0.0.1"}, absl::Now())
                      .ok());
    }
    options_.listen_address = "127.0.0.1:0";
    options_.farm.limits.check_fraction = load.protect ? Limits().check_fraction : 0;
    options_.farm.preview_interval_min = FarmOptions().preview_interval_min;
    StartOn(load.database);
    std::vector<std::unique_ptr<SyntheticWorker>> workers;
    for (int i = 0; i < load.worker_count; ++i) {
      const std::string name = absl::StrCat("w", i);
      workers.push_back(std::make_unique<SyntheticWorker>(
          load.in_process ? server_->InProcessChannel() : ChannelOf(name, load.protect), name));
      EXPECT_TRUE(workers.back()->Synchronize(0).ok());
    }
    const std::string job = Create(Job()).name();
    const absl::Time begin = absl::Now();
    std::atomic<bool> stop = false;
    std::atomic<int> accepted = 0;
    std::vector<std::jthread> threads;
    for (const auto& worker : workers) {
      threads.emplace_back([&, one = worker.get()] { Work(stop, one, &accepted); });
    }
    const absl::Time deadline = begin + load.time_max;
    while (Get(job).state() != v1::Job::STATE_SUCCEEDED && absl::Now() < deadline) {
      absl::SleepFor(absl::Milliseconds(20));
    }
    const double rate = accepted / absl::ToDoubleSeconds(absl::Now() - begin);
    EXPECT_GT(rate, 0);
    stop = true;
    threads.clear();
    return rate;
  }

 private:
  void StartOn(const std::string& database) {
    if (database.empty()) return Start();
    server_.reset();
    {
      const auto connection = PostgresConnection::Open(database, "");
      ASSERT_TRUE(connection.ok()) << connection.status();
      ASSERT_TRUE(
          (*connection)->Run(absl::StrCat("DROP SCHEMA IF EXISTS ", kJobsSchema, " CASCADE")).ok());
    }
    owned_ = OwnedFarm();
    absl::StatusOr<OwnedFarm> owned =
        OwnFarm({database, "the bench"}, [](absl::Duration) { return false; });
    ASSERT_TRUE(owned.ok()) << owned.status();
    owned_ = *std::move(owned);
    auto server = CoordinatorServer::Start(options_, std::move(owned_.database));
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    jobs_ = v1::JobService::NewStub(server_->InProcessChannel());
  }
  v1::CreateJobRequest Job() {
    v1::CreateJobRequest request = Request(/*samples=*/16);
    v1::FrameSettings* settings = request.mutable_frames(0)->mutable_settings();
    settings->set_width_px(kEdgePx);
    settings->set_height_px(kEdgePx);
    settings->clear_window();
    settings->mutable_window()->set_x1_px(kEdgePx);
    settings->mutable_window()->set_y1_px(kEdgePx);
    request.mutable_partition()->set_tile_size_px(kTileEdgePx);
    request.mutable_partition()->set_pass_sample_count(16);
    request.mutable_partition()->set_lease_pass_count(1);
    return request;
  }
  std::shared_ptr<grpc::Channel> ChannelOf(const std::string& name, bool protect) {
    const std::string address = absl::StrCat("127.0.0.1:", server_->port());
    const CredentialStore store(absl::StrCat(directory_, "/clients/", name));
    if (protect) {
      AccessControl* const access = server_->access();
      const absl::StatusOr<std::string> secret = access->identities().MakeToken(
          {IdentityKind::kWorker, name}, Role::kWork, absl::Now(), kTokenLifetime);
      EXPECT_TRUE(secret.ok()) << secret.status();
      const auto enrolled =
          Enroll(address, {*secret, access->authority().certificate_pem()}, store);
      EXPECT_TRUE(enrolled.ok()) << enrolled.status();
    }
    const absl::StatusOr<FarmConnection> connection =
        ConnectionTo(address, store, /*insecure=*/false);
    EXPECT_TRUE(connection.ok()) << connection.status();
    return connection->Open();
  }
  // Counts results that were accepted for the first time, not those of checks.
  static void Work(const std::atomic<bool>& stop, SyntheticWorker* worker,
                   std::atomic<int>* accepted) {
    while (!stop) {
      worker->Synchronize(kLeasesAhead).IgnoreError();
      if (worker->leases().empty()) absl::SleepFor(absl::Milliseconds(5));
      while (!worker->leases().empty() && !stop) {
        const auto outcome = worker->RenderOne();
        if (outcome.ok() && *outcome == v1::UploadResultsResponse::OUTCOME_ACCEPTED) ++*accepted;
      }
    }
  }

  OwnedFarm owned_;
};

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

int Rounds() {
  const char* rounds = std::getenv("SHEAF_BENCH_ROUNDS");
  return rounds == nullptr ? 5 : std::atoi(rounds);
}

// Pipes see each run when it ends.
void PrintRun(const char* of, double rate) {
  std::printf("%s: %.0f results/s\n", of, rate);
  std::fflush(stdout);
}

TEST_F(CompletionsBench, Databases) {
  const char* database = std::getenv("SHEAF_BENCH_DATABASE");
  if (database == nullptr) GTEST_SKIP() << "SHEAF_BENCH_DATABASE names none";
  const char* seconds = std::getenv("SHEAF_BENCH_SECONDS");
  Load load{.worker_count = kDatabaseWorkerCount, .in_process = true, .time_max = kDatabaseRunMax};
  if (seconds != nullptr) load.time_max = absl::Seconds(std::atof(seconds));
  std::vector<double> sqlite, postgres;
  for (int i = 0; i < Rounds(); ++i) {
    for (const bool on_postgres : {i % 2 == 0, i % 2 != 0}) {
      load.database = on_postgres ? database : "";
      const double rate = Run(load);
      (on_postgres ? postgres : sqlite).push_back(rate);
      PrintRun(on_postgres ? "PostgreSQL" : "SQLite", rate);
    }
  }
  std::printf(
      "medians by %d workers: %.0f results/s on SQLite, %.0f on PostgreSQL (target at least "
      "1000)\n",
      load.worker_count, Median(sqlite), Median(postgres));
}

TEST_F(CompletionsBench, TlsAndChecks) {
  std::vector<double> plain, secured;
  for (int i = 0; i < Rounds(); ++i) {
    // The order alternates, so that a machine that slows down favors neither.
    for (const bool protect : {i % 2 == 0, i % 2 != 0}) {
      const double rate = Run({.protect = protect});
      (protect ? secured : plain).push_back(rate);
      PrintRun(protect ? "TLS and checks" : "neither", rate);
    }
  }
  std::printf("medians: %.0f and %.0f results/s with both, ratio %.2f (target at least 0.8)\n",
              Median(plain), Median(secured), Median(secured) / Median(plain));
}

}  // namespace
}  // namespace sheaf::coordinator
