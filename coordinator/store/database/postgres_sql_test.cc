// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/postgres_sql.h"

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(PostgresSqlTest, ParametersAreNumbered) {
  EXPECT_EQ(PostgresParameters("SELECT a FROM t WHERE b = ? AND c IN (?,?)"),
            "SELECT a FROM t WHERE b = $1 AND c IN ($2,$3)");
  EXPECT_EQ(PostgresParameters("UPDATE t SET a = ?1, b = CASE WHEN ?12 = 0 THEN ?1 ELSE b END"),
            "UPDATE t SET a = $1, b = CASE WHEN $12 = 0 THEN $1 ELSE b END");
}

TEST(PostgresSqlTest, QuotedTextStays) {
  EXPECT_EQ(PostgresParameters("SELECT '?', 'it''s ?', \"?\" WHERE a = ?"),
            "SELECT '?', 'it''s ?', \"?\" WHERE a = $1");
  EXPECT_EQ(PostgresScript("x TEXT DEFAULT 'REAL INTEGER' REAL"),
            "x TEXT DEFAULT 'REAL INTEGER' DOUBLE PRECISION");
  EXPECT_EQ(PostgresParameters("SELECT 'not closed ?"), "SELECT 'not closed ?");
}

TEST(PostgresSqlTest, TypesOfTablesAreTranslated) {
  EXPECT_EQ(PostgresScript("CREATE TABLE t(a INTEGER PRIMARY KEY AUTOINCREMENT, b REAL NOT NULL, "
                           "c BLOB, REALLY TEXT) WITHOUT ROWID;"),
            "CREATE TABLE t(a BIGINT PRIMARY KEY , b DOUBLE PRECISION NOT NULL, c BYTEA, "
            "REALLY TEXT) ;");
}

TEST(PostgresSqlTest, QueriesAreKnown) {
  EXPECT_TRUE(IsQuery(" \nSELECT 1"));
  EXPECT_FALSE(IsQuery("DELETE FROM t WHERE a IN (SELECT b FROM u) RETURNING a"));
}

}  // namespace
}  // namespace sheaf::coordinator
