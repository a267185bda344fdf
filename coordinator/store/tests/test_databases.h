// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Stores for tests, in each kind of database. The cases of PostgreSQL run where the variable
// SHEAF_TEST_POSTGRES is set, as one test of ctest: they share a server, which takes a second to
// make.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "common/objects/object_store.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/database/durability.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/tests/postgres_server.h"

namespace sheaf::coordinator {

enum class DatabaseKind { kSqlite, kPostgres };

void PrintTo(DatabaseKind kind, std::ostream* stream);
std::string KindName(const ::testing::TestParamInfo<DatabaseKind>& info);

// Those that this run tests. Says on standard error where PostgreSQL is left out although it was
// asked for.
std::vector<DatabaseKind> TestedKinds();

// The server of this program, which it starts at the first call; null where PostgreSQL is not
// tested.
PostgresServer* TestServer();

// A new store for each case. parts: as for SqlJobStore::Open.
class JobStoreFixture : public ::testing::TestWithParam<DatabaseKind> {
 protected:
  explicit JobStoreFixture(ObjectStore* parts = nullptr);
  ~JobStoreFixture() override;
  // Ends the store and opens it again.
  void Reopen(Durability durability = Durability::kPowerLoss);
  absl::StatusOr<std::unique_ptr<SqlJobStore>> OpenStore(
      Durability durability = Durability::kPowerLoss);
  // A second connection to the store's database, to inspect it.
  std::unique_ptr<Database> OpenDatabase(Durability durability = Durability::kPowerLoss);
  void Execute(const std::string& sql);

  const std::string directory_;
  ObjectStore* const parts_;
  std::unique_ptr<SqlJobStore> store_;
};

}  // namespace sheaf::coordinator

// Runs the cases of a fixture that derives from JobStoreFixture on each kind.
#define SHEAF_ON_ALL_DATABASES(fixture)                                                           \
  INSTANTIATE_TEST_SUITE_P(On, fixture, ::testing::ValuesIn(::sheaf::coordinator::TestedKinds()), \
                           ::sheaf::coordinator::KindName)
