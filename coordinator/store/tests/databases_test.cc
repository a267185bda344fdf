// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the store relies on in each kind of database: migrations, transactions, and values that come
// back as they were.
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "coordinator/store/database/database.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class DatabasesTest : public JobStoreFixture {};

// Only the additions of the last two versions are looked at: all versions are migrated by one list.
TEST_P(DatabasesTest, AnEarlierDatabaseIsMigrated) {
  store_.reset();
  const std::unique_ptr<Database> database = OpenDatabase();
  const absl::StatusOr<int64_t> version = database->SchemaVersion();
  ASSERT_TRUE(version.ok() && *version >= 30) << version.status();
  ASSERT_TRUE(database
                  ->InTransaction([&] {
                    absl::Status dropped = database->Execute(
                        "DROP TABLE dependencies;DROP TABLE approvals;DROP TABLE drains;"
                        "ALTER TABLE jobs DROP COLUMN deadline_ns;"
                        "ALTER TABLE jobs DROP COLUMN quoted_cpu_seconds;"
                        "ALTER TABLE jobs DROP COLUMN quoted_cpu_seconds_low;"
                        "ALTER TABLE jobs DROP COLUMN quoted_cpu_seconds_high;");
                    return dropped.ok() ? database->SetSchemaVersion(28) : dropped;
                  })
                  .ok());
  Reopen();
  EXPECT_EQ(*database->SchemaVersion(), *version);
  ASSERT_TRUE(store_->WriteDrains({{"w", true, absl::FromUnixSeconds(5)}}).ok());
  EXPECT_EQ(store_->LoadDrains()->size(), 1u);
  EXPECT_TRUE(store_->LoadJobs().ok());
  store_.reset();
  ASSERT_TRUE(
      database->InTransaction([&] { return database->SetSchemaVersion(*version + 1); }).ok());
  EXPECT_EQ(OpenStore().status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_P(DatabasesTest, AFailedTransactionChangesNothing) {
  const std::unique_ptr<Database> database = OpenDatabase();
  const absl::Status failed = database->InTransaction([&] {
    absl::Status status = database->Execute("UPDATE meta SET value = 1000");
    return status.ok() ? database->Execute("UPDATE nothing SET value = 1") : status;
  });
  EXPECT_EQ(failed.code(), absl::StatusCode::kUnavailable) << failed;
  Statement lives = database->Prepare("SELECT value FROM meta");
  ASSERT_TRUE(*lives.Step());
  EXPECT_EQ(lives.Int64(0), 1);
  // The next one is not affected.
  ASSERT_TRUE(database->Prepare("UPDATE meta SET value = ? + 1").Bind(41).Run().ok());
  EXPECT_EQ(database->ChangedRows(), 1);
  lives.Run().IgnoreError();
  ASSERT_TRUE(*lives.Step());
  EXPECT_EQ(lives.Int64(0), 42);
}

TEST_P(DatabasesTest, ValuesComeBackAsTheyWere) {
  const std::unique_ptr<Database> database = OpenDatabase();
  ASSERT_TRUE(database->Execute("CREATE TABLE t(i INTEGER, r REAL, t TEXT, b BLOB)").ok());
  const std::string text = "a 'quoted' \\ \"text\" ? with \xC3\xA4", bytes("\0\xff\x01", 3);
  for (const int64_t number : {std::numeric_limits<int64_t>::min(), int64_t{-1}, int64_t{0},
                               std::numeric_limits<int64_t>::max()}) {
    for (const double real : {0.1, -1e-310, 1e308, std::nextafter(1.0, 2.0)}) {
      ASSERT_TRUE(database->Prepare("INSERT INTO t VALUES(?,?,?,?)")
                      .Bind(number)
                      .Bind(real)
                      .Bind(text)
                      .BindBytes(bytes)
                      .Run()
                      .ok());
      Statement query = database->Prepare("SELECT i, r, t, b FROM t WHERE i = ?2 AND t = ?1");
      ASSERT_TRUE(*query.Bind(text).Bind(number).Step());
      EXPECT_EQ(query.Int64(0), number);
      EXPECT_EQ(query.Double(1), real);
      EXPECT_EQ(query.Text(2), text);
      EXPECT_EQ(query.Bytes(3), bytes);
      EXPECT_FALSE(*query.Step());
      ASSERT_TRUE(database->Execute("DELETE FROM t").ok());
    }
  }
  ASSERT_TRUE(database->Prepare("INSERT INTO t VALUES(1,?,?,?)")
                  .Bind(0.0)
                  .Bind(std::string())
                  .BindBytes("")
                  .Run()
                  .ok());
  Statement empty = database->Prepare("SELECT t, b FROM t");
  ASSERT_TRUE(*empty.Step());
  EXPECT_EQ(empty.Text(0), "");
  EXPECT_EQ(empty.Bytes(1), "");
  EXPECT_EQ(database->Prepare("INSERT INTO meta VALUES('lives', 1)").Run().code(),
            absl::StatusCode::kAlreadyExists);
}

SHEAF_ON_ALL_DATABASES(DatabasesTest);

}  // namespace
}  // namespace sheaf::coordinator
