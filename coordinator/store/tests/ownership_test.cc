// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Several coordinators on one PostgreSQL database: which of them owns the farm, and that none but
// the owner changes it.
#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "coordinator/store/database/farm_ownership.h"
#include "coordinator/store/database/postgres_database.h"
#include "coordinator/store/tests/test_databases.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

constexpr absl::Duration kSilenceMax = absl::Milliseconds(300);

// A database and a directory of its own for each case.
class OwnershipTest : public ::testing::TestWithParam<DatabaseKind> {
 protected:
  OwnershipTest() : directory_(::testing::TempDir() + "sheaf-ownership") {
    std::filesystem::remove_all(directory_);
    SHEAF_CHECK(TestServer()->MakeDatabase("ownership").ok());
  }
  ~OwnershipTest() override { std::filesystem::remove_all(directory_); }

  static std::string Url() { return TestServer()->Url("ownership"); }
  // Waits for a number of checks of the lease.
  static absl::StatusOr<std::unique_ptr<FarmOwnership>> Acquire(const std::string& name,
                                                                int looks_max) {
    return FarmOwnership::Acquire(
        {.url = Url(),
         .name = name,
         .silence_max = kSilenceMax,
         .sleep = [looks_max, looks = 0](absl::Duration duration) mutable {
           absl::SleepFor(duration);
           return ++looks < looks_max;
         }});
  }
  std::unique_ptr<SqlJobStore> OpenStore(int64_t epoch) {
    auto database = PostgresDatabase::Open(
        Url(), kJobsSchema,
        WriteFence{epoch, [this](const absl::Status& why) { lost_.push_back(why); }});
    SHEAF_CHECK(database.ok());
    auto store = SqlJobStore::Open(directory_, *std::move(database));
    SHEAF_CHECK(store.ok());
    return *std::move(store);
  }
  static PartRow RowOf(const std::string& bytes, uint64_t first) {
    return {{{1, 1}, {0, 0, 16, 16}, {first, 16}}, {Sha256Hex(bytes), bytes.size()}, "w", {}};
  }

  const std::string directory_;
  std::vector<absl::Status> lost_;
};

TEST_P(OwnershipTest, OneOwnsTheFarmAndTheNextTakesOverWhenItIsSilent) {
  auto first = Acquire("first", 1);
  ASSERT_TRUE(first.ok()) << first.status();
  std::atomic<bool> deposed = false;
  (*first)->Keep([&](const absl::Status&) { deposed = true; });
  EXPECT_TRUE(absl::IsCancelled(Acquire("second", 3).status())) << "the first one renews its lease";
  EXPECT_FALSE(deposed);
  const int64_t epoch = (*first)->epoch();
  first->reset();
  auto second = Acquire("second", 2);
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_GT((*second)->epoch(), epoch);
}

TEST_P(OwnershipTest, ADeposedOwnerLearnsOfIt) {
  auto first = Acquire("first", 1);  // It renews nothing at first, like one that stands still.
  ASSERT_TRUE(first.ok()) << first.status();
  auto second = Acquire("second", 5);
  ASSERT_TRUE(second.ok()) << second.status();
  Mutex mutex;
  CondVar changed;
  std::string why;
  (*first)->Keep([&](const absl::Status& status) {
    const MutexLock lock(&mutex);
    why = std::string(status.message());
    changed.NotifyAll();
  });
  {
    const MutexLock lock(&mutex);
    changed.Wait(&mutex, [&] { return !why.empty(); });
    EXPECT_THAT(why, HasSubstr("the coordinator second has taken the farm over"));
  }
  // The end of the first one does not release the lease of the second.
  (*second)->Keep(nullptr);
  first->reset();
  EXPECT_TRUE(absl::IsCancelled(Acquire("third", 2).status()));
}

TEST_P(OwnershipTest, ADeposedOwnerStoresNothing) {
  const auto first = Acquire("first", 1);
  ASSERT_TRUE(first.ok());
  const auto before = OpenStore((*first)->epoch());
  ASSERT_TRUE(before->WritePart(RowOf("one", 0), "one").ok());
  const auto second = Acquire("second", 5);
  ASSERT_TRUE(second.ok());
  const auto after = OpenStore((*second)->epoch());
  ASSERT_TRUE(after->WritePart(RowOf("two", 16), "two").ok());

  EXPECT_TRUE(absl::IsAborted(before->WritePart(RowOf("three", 32), "three")));
  EXPECT_TRUE(absl::IsAborted(before->ChangeJob(1, {.pinned = true})));
  EXPECT_TRUE(absl::IsAborted(before->RemovePart(RowOf("one", 0))));
  EXPECT_TRUE(absl::IsAborted(before->RemoveShare({ShareKind::kUser, "anna"})));
  EXPECT_TRUE(absl::IsAborted(before->Probe()));
  EXPECT_EQ(lost_.size(), 5u);
  // The same part may have come to the new owner: its file stays.
  EXPECT_TRUE(std::filesystem::exists(before->PartPath(RowOf("three", 32))));
  EXPECT_TRUE(absl::IsAlreadyExists(before->WritePart(RowOf("two", 16), "two")));
  EXPECT_EQ(*after->ReadPart(RowOf("two", 16)), "two");
  EXPECT_EQ(*after->ReadPart(RowOf("one", 0)), "one");
  EXPECT_EQ(after->ListParts(1)->size(), 2u);
}

// The next owner reads nothing before the last transaction of the one before has ended.
TEST_P(OwnershipTest, ATakeoverWaitsForATransaction) {
  const auto first = Acquire("first", 1);
  ASSERT_TRUE(first.ok());
  auto database =
      PostgresDatabase::Open(Url(), kJobsSchema, WriteFence{(*first)->epoch(), nullptr});
  ASSERT_TRUE(database.ok());
  ASSERT_TRUE((*database)->Execute("CREATE TABLE t(a INTEGER)").ok());
  std::atomic<bool> taken = false;
  std::jthread second;
  const absl::Status status = (*database)->InTransaction([&] {
    second = std::jthread([&] { taken = Acquire("second", 20).ok(); });
    absl::SleepFor(2 * kSilenceMax);
    EXPECT_FALSE(taken);
    return (*database)->Execute("INSERT INTO t VALUES(1)");
  });
  EXPECT_TRUE(status.ok()) << status;
  second.join();
  EXPECT_TRUE(taken);
  EXPECT_TRUE(absl::IsAborted((*database)->Execute("INSERT INTO t VALUES(2)")));
}

TEST_P(OwnershipTest, AStoreGoesOnAfterACrashOfTheServer) {
  const auto owner = Acquire("owner", 1);
  ASSERT_TRUE(owner.ok());
  const auto store = OpenStore((*owner)->epoch());
  ASSERT_TRUE(store->WritePart(RowOf("one", 0), "one").ok());
  ASSERT_TRUE(TestServer()->CrashAndRestart().ok());
  EXPECT_EQ(store->ListParts(1)->size(), 1u);
  ASSERT_TRUE(TestServer()->CrashAndRestart().ok());
  const absl::Status status = store->WritePart(RowOf("two", 16), "two");
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(store->ListParts(1)->size(), 2u);
  EXPECT_TRUE(lost_.empty());
}

// The connection ends while a commit is in progress: the number in the owner's row tells whether it
// was done.
TEST_P(OwnershipTest, TheOutcomeOfAnInterruptedCommitIsFound) {
  const auto owner = Acquire("owner", 1);
  ASSERT_TRUE(owner.ok());
  auto database =
      PostgresDatabase::Open(Url(), kJobsSchema, WriteFence{(*owner)->epoch(), nullptr});
  ASSERT_TRUE(database.ok());
  ASSERT_TRUE((*database)->Execute("CREATE TABLE t(a INTEGER)").ok());
  const auto other = PostgresConnection::Open(Url(), "");
  ASSERT_TRUE(other.ok());
  const absl::Status status = (*database)->InTransaction([&] {
    absl::Status inserted = (*database)->Execute("INSERT INTO t VALUES(1)");
    // Before the commit reaches the server.
    EXPECT_TRUE((*other)
                    ->Run("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE "
                          "state = 'idle in transaction'")
                    .ok());
    absl::SleepFor(absl::Milliseconds(50));
    return inserted;
  });
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("before a change was stored"));
  ASSERT_TRUE((*database)->Execute("INSERT INTO t VALUES(2)").ok());
  Statement count = (*database)->Prepare("SELECT COUNT(*) FROM t");
  ASSERT_TRUE(*count.Step());
  EXPECT_EQ(count.Int64(0), 1);
}

std::vector<DatabaseKind> PostgresOnly() {
  if (TestServer() == nullptr) return {};
  return {DatabaseKind::kPostgres};
}
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(OwnershipTest);
INSTANTIATE_TEST_SUITE_P(On, OwnershipTest, ::testing::ValuesIn(PostgresOnly()), KindName);

}  // namespace
}  // namespace sheaf::coordinator
