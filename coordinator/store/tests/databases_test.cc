// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Properties that the store needs of each database: updates, transactions, and values that come
// back as they were.
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "coordinator/store/database/database.h"
#include "coordinator/store/job_schema.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class DatabasesTest : public JobStoreFixture {};

// Databases are updated from any earlier version, at once or one by one, and never back.
TEST_P(DatabasesTest, AnEarlierDatabaseIsUpdated) {
  store_.reset();
  const std::unique_ptr<Database> database = OpenDatabase();
  const char* const additions[] = {"ALTER TABLE drains ADD COLUMN why TEXT NOT NULL DEFAULT 'none'",
                                   "UPDATE drains SET why = 'earlier';"
                                   "CREATE TABLE added(x INTEGER NOT NULL)"};
  ASSERT_EQ(database->SchemaVersion().value_or(-1), 1);
  ASSERT_TRUE(database->Execute("INSERT INTO drains VALUES('w', 1, 5)").ok());
  const SchemaHistory second{"", std::span(additions, 1)}, third{"", additions};
  ASSERT_TRUE(UpdateSchema(database.get(), second).ok());
  EXPECT_EQ(database->SchemaVersion().value_or(-1), 2);
  EXPECT_EQ(CheckSchema(database.get()).code(), absl::StatusCode::kDataLoss);
  ASSERT_TRUE(UpdateSchema(database.get(), third).ok());
  EXPECT_EQ(database->SchemaVersion().value_or(-1), 3);
  ASSERT_TRUE(UpdateSchema(database.get(), third).ok()) << "nothing is added twice";
  Statement why = database->Prepare("SELECT why FROM drains");
  ASSERT_TRUE(*why.Step());
  EXPECT_EQ(why.Text(0), "earlier");
  EXPECT_EQ(UpdateSchema(database.get(), second).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(OpenStore().status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_P(DatabasesTest, AnAdditionThatFailsLeavesTheEarlierVersion) {
  store_.reset();
  const std::unique_ptr<Database> database = OpenDatabase();
  const char* const additions[] = {
      "CREATE TABLE added(x INTEGER NOT NULL);"
      "UPDATE nothing SET x = 1"};
  EXPECT_FALSE(UpdateSchema(database.get(), {"", additions}).ok());
  EXPECT_EQ(database->SchemaVersion().value_or(-1), 1);
  EXPECT_TRUE(CheckSchema(database.get()).ok()) << "half of an addition stays";
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
