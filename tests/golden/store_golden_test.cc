// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Golden files of the jobs database: its tables, and the rows of a job.
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/digest.h"
#include "coordinator/store/database/sqlite_database.h"
#include "coordinator/store/sql_job_store.h"
#include "gtest/gtest.h"
#include "tests/golden/golden_file.h"
#include "tests/golden/made_up_views.h"

namespace sheaf::coordinator {
namespace {

using sheaf::testing::ExpectGolden;

class StoreGoldenTest : public ::testing::Test {
 protected:
  StoreGoldenTest() { Open(); }
  ~StoreGoldenTest() override { std::filesystem::remove_all(directory_); }

  void Open() {
    store_.reset();
    store_ = *SqlJobStore::Open(directory_, Durability::kProcess);
  }
  // Ends the store, and reads a column of text from its database.
  std::vector<std::string> Read(const std::string& sql) {
    store_.reset();
    const std::unique_ptr<SqliteDatabase> database =
        *SqliteDatabase::Open(absl::StrCat(directory_, "/farm.db"));
    Statement statement = database->Prepare(sql);
    std::vector<std::string> rows;
    while (*statement.Step()) rows.push_back(statement.Text(0));
    return rows;
  }

  const std::string directory_ = absl::StrCat(
      ::testing::TempDir(), "/", ::testing::UnitTest::GetInstance()->current_test_info()->name());
  std::unique_ptr<SqlJobStore> store_;
};

JobSpec MadeUpSpec() {
  JobSpec spec;
  spec.title = "a 'title' with \xC3\xA4";
  spec.owner = "anna";
  spec.show = "comet";
  spec.requirements = {"gpu", {"big", "fast"}, 1000, 2000};
  spec.priority = -3;
  spec.numeric_profile = "profile";
  spec.partition = {16, 4, 2, 8};
  for (const int32_t number : {-5, 7}) {
    FrameSpec frame;
    frame.frame_number = number;
    frame.scene = {std::string(64, 'a'), 12};
    frame.frame_digest = std::string(64, 'f');
    frame.settings = MadeUpSettings();
    frame.resumed = {std::string(64, 'd'), 55};
    frame.stop = {.target_error = 0.25, .time_max = absl::Minutes(3), .cpu_max = absl::Hours(3)};
    spec.frames.push_back(frame);
    spec.approvals[number] = {16, number == 7};
  }
  spec.effect_costs = {{"lens", "", "a pinhole", 0.25, 0.01, -0.002, 0.003, 1e-4, 1.5}};
  spec.deadline = {absl::FromUnixSeconds(5000), 3600.5, 3000.25, 4000.75};
  return spec;
}

PartRow MadeUpPart(uint64_t job_id) {
  PartRow row;
  row.key = {{job_id, 7}, {0, 16, 16, 32}, {64, 16}};
  row.digest = {Sha256Hex("part"), 4};
  row.worker_id = "w-1";
  row.identity = "identity-1";
  row.cost = {11, 1, absl::Milliseconds(5), 4};
  return row;
}

TaskTrouble MadeUpTrouble(uint64_t job_id) {
  TaskTrouble trouble;
  trouble.frame = {job_id, 7};
  trouble.tile = {0, 0, 16, 16};
  trouble.block = {0, 16};
  trouble.failures = {{"w-1", "identity-1", FailureKind::kMemory, 2, "lack of memory"}};
  trouble.set_aside = "failed too often";
  return trouble;
}

TEST_F(StoreGoldenTest, TablesAreUnchanged) {
  ExpectGolden("tables.sql", absl::StrJoin(Read("SELECT sql FROM sqlite_master WHERE sql IS NOT "
                                                "NULL ORDER BY name"),
                                           ";\n\n") +
                                 ";\n");
}

TEST_F(StoreGoldenTest, RowsOfAJobAreUnchanged) {
  const uint64_t first = store_->CreateJob(JobSpec(), "first", absl::FromUnixSeconds(50))->job_id;
  JobSpec spec = MadeUpSpec();
  spec.dependencies = {{first, true}};
  const uint64_t id = store_->CreateJob(spec, "second", absl::FromUnixSeconds(100))->job_id;
  ASSERT_TRUE(store_->WritePart(MadeUpPart(id), "part").ok());
  FailureLog failures;
  failures.last.push_back(MadeUpFailure().failure);
  failures.count = 6;
  ASSERT_TRUE(store_->WriteFailures(id, failures).ok());
  ASSERT_TRUE(store_->WriteTroubles({MadeUpTrouble(id)}).ok());
  ASSERT_TRUE(store_->ChangeJob(id, {.pinned = true}).ok());
  ASSERT_TRUE(store_->ChangeJob(id, {.paused = true}).ok());
  ASSERT_TRUE(store_->SetWarning(id, "corrected").ok());
  ASSERT_TRUE(store_->WriteShare({ShareKind::kUser, "anna"}, {2.5, 12}).ok());
  ASSERT_TRUE(store_->WriteDrains({{"w-1", true, absl::FromUnixSeconds(70)}}).ok());
  ASSERT_TRUE(
      store_->WriteQuarantine({"identity-2", "false results", true, absl::FromUnixSeconds(80)})
          .ok());
  std::map<std::string, std::vector<std::string>> columns;
  for (const std::string& name : Read("SELECT m.name || '.' || c.name FROM sqlite_master m, "
                                      "pragma_table_info(m.name) c WHERE m.type = 'table' AND "
                                      "m.name NOT LIKE 'sqlite_%' ORDER BY m.name, c.cid")) {
    const size_t dot = name.find('.');
    columns[name.substr(0, dot)].push_back(name.substr(dot + 1));
  }
  std::string text;
  for (const auto& [table, names] : columns) {
    // The first has a random name of the process, the second the day of the test.
    if (table == "meta" || table == "usage") continue;
    std::vector<std::string> shown;
    for (const std::string& name : names) {
      shown.push_back(absl::StrCat("'\n  ", name, " = ' || quote(", name, ")"));
    }
    for (const std::string& row :
         Read(absl::StrCat("SELECT ", absl::StrJoin(shown, " || "), " FROM ", table))) {
      absl::StrAppend(&text, table, row, "\n");
    }
  }
  ExpectGolden("rows.txt", text);
}

}  // namespace
}  // namespace sheaf::coordinator
