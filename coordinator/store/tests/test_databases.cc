// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/tests/test_databases.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/check.h"
#include "coordinator/store/database/farm_ownership.h"
#include "coordinator/store/database/postgres_database.h"
#include "coordinator/store/database/sqlite_database.h"

namespace sheaf::coordinator {
namespace {

std::string NewDirectory() {
  const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string directory =
      ::testing::TempDir() +
      absl::StrReplaceAll(absl::StrCat("sheaf-store-", test->test_suite_name(), "-", test->name()),
                          {{"/", "-"}});
  std::filesystem::remove_all(directory);
  return directory;
}

// The epoch under which the stores of this program write; it owns the farm until it ends.
int64_t TestEpoch() {
  static const int64_t epoch = [] {
    const auto ownership = FarmOwnership::Acquire({.url = TestServer()->Url(),
                                                   .name = "the test",
                                                   .sleep = [](absl::Duration) { return false; }});
    SHEAF_CHECK(ownership.ok());
    return (*ownership)->epoch();
  }();
  return epoch;
}

}  // namespace

void PrintTo(DatabaseKind kind, std::ostream* stream) {
  *stream << (kind == DatabaseKind::kSqlite ? "sqlite" : "postgres");
}

std::string KindName(const ::testing::TestParamInfo<DatabaseKind>& info) {
  return info.param == DatabaseKind::kSqlite ? "sqlite" : "postgres";
}

PostgresServer* TestServer() {
  static const std::unique_ptr<PostgresServer> server = []() -> std::unique_ptr<PostgresServer> {
    if (std::getenv("SHEAF_TEST_POSTGRES") == nullptr) return nullptr;
    absl::StatusOr<std::unique_ptr<PostgresServer>> started = PostgresServer::Start();
    if (started.ok()) return *std::move(started);
    std::fprintf(stderr, "skipped on PostgreSQL: %s\n", started.status().ToString().c_str());
    // Only what is not installed is left out.
    SHEAF_CHECK(absl::IsNotFound(started.status()));
    return nullptr;
  }();
  return server.get();
}

std::vector<DatabaseKind> TestedKinds() {
  if (TestServer() == nullptr) return {DatabaseKind::kSqlite};
  return {DatabaseKind::kSqlite, DatabaseKind::kPostgres};
}

JobStoreFixture::JobStoreFixture(ObjectStore* parts) : directory_(NewDirectory()), parts_(parts) {
  if (GetParam() == DatabaseKind::kPostgres) {
    const auto connection = PostgresConnection::Open(TestServer()->Url(), "");
    SHEAF_CHECK(connection.ok());
    SHEAF_CHECK(
        (*connection)->Run(absl::StrCat("DROP SCHEMA IF EXISTS ", kJobsSchema, " CASCADE")).ok());
  }
  Reopen();
}

JobStoreFixture::~JobStoreFixture() {
  store_.reset();
  std::filesystem::remove_all(directory_);
}

std::unique_ptr<Database> JobStoreFixture::OpenDatabase(Durability durability) {
  if (GetParam() == DatabaseKind::kSqlite) {
    auto database = SqliteDatabase::Open(directory_ + "/farm.db", durability);
    SHEAF_CHECK(database.ok());
    return *std::move(database);
  }
  auto database = PostgresDatabase::Open(TestServer()->Url(), kJobsSchema,
                                         WriteFence{TestEpoch(), nullptr}, durability);
  SHEAF_CHECK(database.ok());
  return *std::move(database);
}

absl::StatusOr<std::unique_ptr<SqlJobStore>> JobStoreFixture::OpenStore(Durability durability) {
  if (GetParam() == DatabaseKind::kSqlite) return SqlJobStore::Open(directory_, durability, parts_);
  return SqlJobStore::Open(directory_, OpenDatabase(durability), durability, parts_);
}

void JobStoreFixture::Reopen(Durability durability) {
  store_.reset();
  auto store = OpenStore(durability);
  ASSERT_TRUE(store.ok()) << store.status();
  store_ = std::move(*store);
}

void JobStoreFixture::Execute(const std::string& sql) {
  const absl::Status status = OpenDatabase()->Execute(sql);
  ASSERT_TRUE(status.ok()) << status;
}

}  // namespace sheaf::coordinator
