// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the coordinator's disk and its lock allow, without workers: durable parts of 24 KB per
// second by the number of calls that write at the same time, with the 50th and 99th percentile of a
// call; and the time to open a frame of 262,144 tiles, which is spent under the farm's lock.
//
//   store_bench DIRECTORY [SECONDS [DATABASE]]
//
// DIRECTORY: a new folder on the disk to measure. SECONDS: of each row, 3 unless said otherwise.
// DATABASE: "sqlite", or the URL of a PostgreSQL database, whose tables of jobs are removed first;
// then only parts are measured.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "coordinator/core/frame/frame_tasks.h"
#include "coordinator/store/database/farm_ownership.h"
#include "coordinator/store/database/postgres_database.h"
#include "coordinator/store/sql_job_store.h"

namespace sheaf::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kPartBytes = 24 << 10;
constexpr int32_t kLargeEdgePx = 512 * 32;  // 262,144 tiles of 32 pixels.

double MillisecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

absl::StatusOr<std::unique_ptr<SqlJobStore>> OpenStore(const std::string& directory,
                                                       const FarmOwnership* owner,
                                                       const std::string& url) {
  if (owner == nullptr) return SqlJobStore::Open(directory);
  const auto connection = PostgresConnection::Open(url, "");
  SHEAF_CHECK(connection.ok());
  SHEAF_CHECK(
      (*connection)->Run(absl::StrCat("DROP SCHEMA IF EXISTS ", kJobsSchema, " CASCADE")).ok());
  auto database = PostgresDatabase::Open(url, kJobsSchema, WriteFence{owner->epoch(), nullptr});
  SHEAF_CHECK(database.ok());
  return SqlJobStore::Open(directory, *std::move(database));
}

std::unique_ptr<FarmOwnership> OwnFarm(const std::string& url) {
  if (url.empty()) return nullptr;
  auto owner = FarmOwnership::Acquire(
      {.url = url, .name = "store_bench", .sleep = [](absl::Duration) { return false; }});
  SHEAF_CHECK(owner.ok());
  (*owner)->Keep([](const absl::Status&) { SHEAF_CHECK(false); });
  return *std::move(owner);
}

void MeasureParts(const std::string& directory, const FarmOwnership* owner, const std::string& url,
                  int writer_count, double seconds) {
  const auto store = OpenStore(directory, owner, url);
  SHEAF_CHECK(store.ok());
  const std::string bytes(kPartBytes, 'x');
  const BlobDigest digest{Sha256Hex(bytes), bytes.size()};
  std::atomic<bool> stop = false;
  std::atomic<uint64_t> next = 0;
  Mutex mutex;
  std::vector<double> milliseconds;
  const Clock::time_point begin = Clock::now();
  std::vector<std::jthread> threads;
  for (int i = 0; i < writer_count; ++i) {
    threads.emplace_back([&] {
      std::vector<double> mine;
      while (!stop) {
        PartRow row;
        row.key.frame = {1, static_cast<int32_t>(next % 16)};  // Farms have several frames open.
        row.key.tile = {0, 0, 8, 8};
        row.key.block = {16 * next++, 16};
        row.digest = digest;
        row.worker_id = "w";
        const Clock::time_point call = Clock::now();
        SHEAF_CHECK((*store)->WritePart(row, bytes).ok());
        mine.push_back(MillisecondsSince(call));
      }
      const MutexLock lock(&mutex);
      milliseconds.insert(milliseconds.end(), mine.begin(), mine.end());
    });
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  stop = true;
  threads.clear();
  const double rate = static_cast<double>(milliseconds.size()) / MillisecondsSince(begin) * 1000;
  std::ranges::sort(milliseconds);
  std::printf("%5d writers: %6.0f durable parts/s, a call p50 %.1f ms, p99 %.1f ms\n", writer_count,
              rate, milliseconds[milliseconds.size() / 2],
              milliseconds[milliseconds.size() * 99 / 100]);
  std::fflush(stdout);  // A pipe sees each row when it ends.
}

void MeasureOpening() {
  std::vector<double> milliseconds;
  for (int i = 0; i < 9; ++i) {
    const Clock::time_point begin = Clock::now();
    const FrameTasks tasks(CellGrid({0, 0, kLargeEdgePx, kLargeEdgePx}, 32, 32), 64);
    milliseconds.push_back(MillisecondsSince(begin));
    SHEAF_CHECK(tasks.HasReady());
  }
  std::ranges::sort(milliseconds);
  std::printf("a frame of 262,144 tiles is opened in %.1f ms (median of %zu; %.1f to %.1f)\n",
              milliseconds[milliseconds.size() / 2], milliseconds.size(), milliseconds.front(),
              milliseconds.back());
}

}  // namespace
}  // namespace sheaf::coordinator

int main(int argc, char** argv) {
  if (argc < 2 || std::filesystem::exists(argv[1])) {
    std::fprintf(stderr,
                 "usage: store_bench DIRECTORY [SECONDS [DATABASE]]; the directory must be new\n");
    return 2;
  }
  const double seconds = argc > 2 ? std::atof(argv[2]) : 3;
  const std::string database = argc > 3 ? argv[3] : "";
  const std::string url = database == "sqlite" ? "" : database;
  const auto owner = sheaf::coordinator::OwnFarm(url);
  if (database.empty()) sheaf::coordinator::MeasureOpening();
  for (const int writers : {1, 16, 100, 1000}) {
    sheaf::coordinator::MeasureParts(absl::StrCat(argv[1], "/", writers), owner.get(), url, writers,
                                     seconds);
  }
  std::filesystem::remove_all(argv[1]);
  return 0;
}
