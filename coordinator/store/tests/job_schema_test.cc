// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Databases of other versions of Sheaf.
#include "coordinator/store/job_schema.h"

#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/database/sqlite_database.h"
#include "coordinator/store/sql_job_store.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Takes away what schemas 23 to 30 added.
constexpr char kWithout23[] =
    "ALTER TABLE frames DROP COLUMN light_samples_max;DROP TABLE task_failures;"
    "ALTER TABLE jobs DROP COLUMN pinned;ALTER TABLE jobs DROP COLUMN parts_removed_ns;"
    "DROP TABLE removed_jobs;ALTER TABLE jobs DROP COLUMN state_seal;"
    "ALTER TABLE jobs DROP COLUMN show;ALTER TABLE jobs DROP COLUMN pool;"
    "ALTER TABLE jobs DROP COLUMN required_tags;ALTER TABLE jobs DROP COLUMN memory_min_bytes;"
    "ALTER TABLE jobs DROP COLUMN memory_expected_bytes;DROP TABLE shares;DROP TABLE usage;DROP "
    "TABLE dependencies;DROP TABLE approvals;DROP TABLE drains;"
    "ALTER TABLE jobs DROP COLUMN deadline_ns;ALTER TABLE jobs DROP COLUMN quoted_cpu_seconds;"
    "ALTER TABLE jobs DROP COLUMN quoted_cpu_seconds_low;"
    "ALTER TABLE jobs DROP COLUMN quoted_cpu_seconds_high;";

// The first version's.
constexpr char kFirstSchema[] = R"sql(
CREATE TABLE meta(key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
INSERT INTO meta VALUES('lives', 0);
CREATE TABLE jobs(
  job_id INTEGER PRIMARY KEY AUTOINCREMENT, request_id TEXT NOT NULL UNIQUE, title TEXT NOT NULL,
  priority INTEGER NOT NULL, numeric_profile TEXT NOT NULL, tile_size_px INTEGER NOT NULL,
  pass_sample_count INTEGER NOT NULL, lease_pass_count INTEGER NOT NULL, phase INTEGER NOT NULL,
  failure TEXT NOT NULL, create_ns INTEGER NOT NULL, end_ns INTEGER NOT NULL);
CREATE TABLE frames(
  job_id INTEGER NOT NULL REFERENCES jobs(job_id), frame_number INTEGER NOT NULL,
  scene_sha256 TEXT NOT NULL, scene_bytes INTEGER NOT NULL, frame_digest TEXT NOT NULL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL, x0 INTEGER NOT NULL, y0 INTEGER NOT NULL,
  x1 INTEGER NOT NULL, y1 INTEGER NOT NULL, samples INTEGER NOT NULL, max_depth INTEGER NOT NULL,
  seed INTEGER NOT NULL, force_generic INTEGER NOT NULL, delivered INTEGER NOT NULL DEFAULT 0,
  picture_digest TEXT NOT NULL DEFAULT '', relative_mse REAL NOT NULL DEFAULT 0,
  wall_ns INTEGER NOT NULL DEFAULT 0, ray_count INTEGER NOT NULL DEFAULT 0,
  nonfinite_count INTEGER NOT NULL DEFAULT 0, cpu_ns INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, frame_number)) WITHOUT ROWID;
CREATE TABLE parts(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, y0 INTEGER NOT NULL, x0 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, y1 INTEGER NOT NULL, x1 INTEGER NOT NULL,
  sha256 TEXT NOT NULL, size_bytes INTEGER NOT NULL, worker_id TEXT NOT NULL,
  ray_count INTEGER NOT NULL, nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number, y0, x0, first, count)) WITHOUT ROWID;
PRAGMA user_version=1;
)sql";

// All of each table: its columns with types, defaults and keys, its indexes and their columns.
std::string TablesOf(SqliteDatabase* database) {
  std::string text;
  for (Statement query = database->Prepare(
           "SELECT m.name, c.name, c.type, c.\"notnull\", ifnull(c.dflt_value, 'none'), c.pk,"
           " 'column' FROM sqlite_master m, pragma_table_info(m.name) c"
           " UNION ALL SELECT m.name, i.name, c.name, i.\"unique\", i.origin, c.seqno, 'index'"
           " FROM sqlite_master m, pragma_index_list(m.name) i, pragma_index_info(i.name) c"
           " ORDER BY 1, 7, 2, 6");
       *query.Step();) {
    for (int i = 0; i < 6; ++i) absl::StrAppend(&text, query.Text(i), " ");
    text += "\n";
  }
  return text;
}

// A store with one job.
class JobSchemaTest : public ::testing::Test {
 protected:
  JobSchemaTest()
      : directory_(::testing::TempDir() + "sheaf-schema-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
    Reopen();
    JobSpec spec;
    for (const int32_t number : {-5, 7}) {
      FrameSpec frame;
      frame.frame_number = number;
      frame.scene = {std::string(64, 'a'), 12};
      frame.frame_digest = std::string(64, 'f');
      frame.settings.window = {1, 2, 3, 4};
      frame.settings.samples = 77;
      frame.settings.seed = UINT64_MAX - 1;
      frame.settings.color = ColorTransport::kSpectral;
      frame.settings.primaries = Primaries::kRec2020;
      frame.settings.similarity_after = 24;
      frame.settings.light_samples = 8;
      frame.settings.techniques = Techniques::kLight;
      frame.settings.outputs.Add(Aov::kUv);
      frame.stop = {.target_error = 0.25};
      spec.frames.push_back(frame);
    }
    SHEAF_CHECK(store_->CreateJob(spec, "r", absl::FromUnixSeconds(100)).ok());
  }
  ~JobSchemaTest() override {
    store_.reset();
    std::filesystem::remove_all(directory_);
  }
  void Reopen() {
    store_.reset();
    auto store = SqlJobStore::Open(directory_);
    SHEAF_CHECK(store.ok());
    store_ = std::move(*store);
  }
  auto Database() {
    auto database = SqliteDatabase::Open(directory_ + "/farm.db");
    SHEAF_CHECK(database.ok());
    return *std::move(database);
  }

  const std::string directory_;
  std::unique_ptr<SqlJobStore> store_;
};

// Databases that were altered version by version have the tables of new ones.
TEST(JobSchemaOfEachVersionTest, AdditionsMakeTheTablesOfNewDatabases) {
  std::string tables[2];
  for (const bool is_new : {false, true}) {
    auto database = SqliteDatabase::Open(":memory:", Durability::kProcess);
    ASSERT_TRUE(database.ok()) << database.status();
    ASSERT_TRUE(is_new || (*database)->Execute(kFirstSchema).ok());
    ASSERT_TRUE(MigrateSchema(database->get()).ok());
    EXPECT_TRUE(CheckSchema(database->get()).ok());
    tables[is_new ? 1 : 0] = TablesOf(database->get());
  }
  EXPECT_EQ(tables[0], tables[1]);
  EXPECT_THAT(tables[1], HasSubstr("frames techniques INTEGER 1 0 0 \n"));
  EXPECT_THAT(tables[1], HasSubstr("parts parts_by_identity identity"));
}

TEST_F(JobSchemaTest, EarlierSchemasAreMigrated) {
  store_.reset();
  ASSERT_TRUE(
      Database()
          ->Execute(absl::StrCat(
              kWithout23,
              "ALTER TABLE frames DROP COLUMN color;ALTER TABLE frames DROP COLUMN sensor;"
              "ALTER TABLE frames DROP COLUMN single_scattering;"
              "ALTER TABLE frames DROP COLUMN outputs;ALTER TABLE frames DROP COLUMN flip;"
              "ALTER TABLE frames DROP COLUMN primaries;ALTER TABLE jobs DROP COLUMN paused;"
              "ALTER TABLE frames DROP COLUMN white_balance_k;"
              "ALTER TABLE frames DROP COLUMN one_sequence;"
              "ALTER TABLE frames DROP COLUMN similarity_after;"
              "ALTER TABLE frames DROP COLUMN techniques;"
              "ALTER TABLE frames DROP COLUMN max_component_value;"
              "ALTER TABLE frames DROP COLUMN pixel_stride_px;"
              "ALTER TABLE frames DROP COLUMN target_error;"
              "ALTER TABLE frames DROP COLUMN time_max_ns;"
              "ALTER TABLE frames DROP COLUMN cpu_max_ns;"
              "ALTER TABLE frames DROP COLUMN first_round_samples;"
              "ALTER TABLE frames DROP COLUMN tile_count;"
              "ALTER TABLE frames DROP COLUMN unreliable_tile_count;"
              "ALTER TABLE frames DROP COLUMN sample_count;"
              "ALTER TABLE frames DROP COLUMN part_bytes;"
              "ALTER TABLE frames DROP COLUMN relative_mse_upper;"
              "ALTER TABLE frames DROP COLUMN stop_reason;"
              "ALTER TABLE frames RENAME COLUMN image_digest TO picture_digest;"
              "DROP TABLE rounds;DROP TABLE effects;DROP TABLE failures;"
              "DROP TABLE quarantines;ALTER TABLE jobs DROP COLUMN warning;"
              "ALTER TABLE frames DROP COLUMN correction_count;"
              "ALTER TABLE jobs DROP COLUMN failure_count;"
              "ALTER TABLE jobs DROP COLUMN cell_size_px;"
              "ALTER TABLE jobs DROP COLUMN wall_ns;"
              "DROP TABLE parts;ALTER TABLE frames DROP COLUMN seal;"
              "CREATE TABLE parts(job_id, frame_number, y0, x0, first, count, y1, x1,"
              "sha256, size_bytes, worker_id, ray_count, nonfinite_count, cpu_ns,"
              "PRIMARY KEY(job_id, frame_number, y0, x0, first, count)) WITHOUT ROWID;"
              "INSERT INTO parts VALUES(1,7,32,64,16,4,48,96,'ab',9,'w',1,2,3);"
              "ALTER TABLE jobs DROP COLUMN owner;ALTER TABLE jobs DROP COLUMN seal;"
              "ALTER TABLE frames DROP COLUMN unreliable_layers;"
              "ALTER TABLE frames DROP COLUMN one_sequence_gain;"
              "ALTER TABLE frames DROP COLUMN resumed_sha256;"
              "ALTER TABLE frames DROP COLUMN resumed_bytes;"
              "UPDATE frames SET delivered = 1 WHERE frame_number = 7;PRAGMA user_version=1;"))
          .ok());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok());
  ASSERT_EQ(jobs->size(), 1u);
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.seed, UINT64_MAX - 1);
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.color, ColorTransport::kAuto);
  EXPECT_TRUE((*jobs)[0].spec.frames[0].settings.outputs.empty());
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.primaries, Primaries::kSrgb);
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.similarity_after, 0);
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.techniques, Techniques::kCamera);
  EXPECT_FALSE((*jobs)[0].spec.frames[0].stop.IsActive());
  EXPECT_FALSE((*jobs)[0].paused);
  EXPECT_EQ((*jobs)[0].spec.owner, "local");
  ASSERT_EQ((*jobs)[0].delivered.size(), 1u);
  EXPECT_EQ((*jobs)[0].delivered[0].delivered.sample_count, 2u * 2u * 77u);
  EXPECT_EQ((*jobs)[0].spec.partition.cell_size_px, 0);
  const auto part = store_->FindPart({{1, 7}, {64, 32, 96, 48}, {16, 4}, {}});
  ASSERT_TRUE(part.ok() && part->has_value());
  EXPECT_EQ((*part)->digest.sha256_hex, "ab");
  EXPECT_EQ((*part)->digest.size_bytes, 9u);
  EXPECT_EQ((*part)->cost.nonfinite_count, 2u);
  EXPECT_EQ((*part)->identity, "w") << "parts of before are their worker's";
  EXPECT_TRUE((*part)->key.cells.All());
}

// Rows of the schema before techniques have seals that do not cover the new column.
TEST_F(JobSchemaTest, SealsOfSchema19AreReset) {
  store_.reset();
  ASSERT_TRUE(Database()
                  ->Execute(absl::StrCat(
                      kWithout23, "ALTER TABLE frames DROP COLUMN techniques;",
                      "ALTER TABLE failures DROP COLUMN task_kind;PRAGMA user_version=19;"))
                  .ok());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  ASSERT_EQ(jobs->size(), 1u);
  EXPECT_EQ((*jobs)[0].damage, "");
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.techniques, Techniques::kCamera);
}

// The same for the schema before light splits.
TEST_F(JobSchemaTest, SealsOfSchema22AreReset) {
  store_.reset();
  ASSERT_TRUE(Database()->Execute(absl::StrCat(kWithout23, "PRAGMA user_version=22;")).ok());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  ASSERT_EQ(jobs->size(), 1u);
  EXPECT_EQ((*jobs)[0].damage, "");
  EXPECT_EQ((*jobs)[0].spec.frames[0].settings.light_samples, 0);
}

// Parts of before are those of camera paths.
TEST_F(JobSchemaTest, PartsOfSchema20HaveNoKind) {
  store_.reset();
  ASSERT_TRUE(Database()
                  ->Execute(absl::StrCat(
                      kWithout23,
                      "DROP TABLE parts;ALTER TABLE failures DROP COLUMN task_kind;"
                      "CREATE TABLE parts(job_id, frame_number, y0, x0, first, count, cells,"
                      "y1, x1, cell_size_px, sha256, size_bytes, worker_id, ray_count,"
                      "nonfinite_count, cpu_ns, identity, seal,"
                      "PRIMARY KEY(job_id, frame_number, y0, x0, first, count, cells))"
                      "WITHOUT ROWID;CREATE INDEX parts_by_identity ON parts(identity);"
                      "INSERT INTO parts VALUES(1,7,32,64,16,4,5,48,96,8,'ab',9,'w',1,2,3,"
                      "'me',77);PRAGMA user_version=20;"))
                  .ok());
  Reopen();
  const auto part = store_->FindPart({{1, 7}, {64, 32, 96, 48}, {16, 4}, {8, 5}});
  ASSERT_TRUE(part.ok() && part->has_value());
  EXPECT_EQ((*part)->key.kind, TaskKind::kCamera);
  EXPECT_EQ((*part)->digest.sha256_hex, "ab");
  EXPECT_EQ((*part)->identity, "me");
  const auto of_identity = store_->FindPartsOf("me");
  ASSERT_TRUE(of_identity.ok());
  EXPECT_EQ(of_identity->size(), 1u);
}

// Parts of before were made without guiding fields, and their seals do not cover the new column.
TEST_F(JobSchemaTest, PartsOfSchema21HaveNoField) {
  const PartRow row{{{1, 7}, {64, 32, 96, 48}, {16, 4}}, {Sha256Hex("x"), 1}, "w", {}, "me"};
  ASSERT_TRUE(store_->WritePart(row, "x").ok());
  store_.reset();
  ASSERT_TRUE(Database()
                  ->Execute(absl::StrCat(kWithout23, "ALTER TABLE parts DROP COLUMN field;",
                                         "PRAGMA user_version=21;"))
                  .ok());
  Reopen();
  const auto part = store_->FindPart(row.key);
  ASSERT_TRUE(part.ok() && part->has_value());
  EXPECT_EQ((*part)->field, "");
  EXPECT_EQ((*part)->identity, "me");
}

// Jobs of before are not pinned, and keep their parts.
TEST_F(JobSchemaTest, JobsOfSchema22AreNotPinned) {
  store_.reset();
  ASSERT_TRUE(Database()->Execute(absl::StrCat(kWithout23, "PRAGMA user_version=22;")).ok());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok() && jobs->size() == 1);
  EXPECT_FALSE((*jobs)[0].pinned);
  EXPECT_EQ((*jobs)[0].parts_removed_time, absl::InfiniteFuture());
  EXPECT_EQ((*jobs)[0].damage, "");
}

TEST_F(JobSchemaTest, LaterSchemasAreRefused) {
  store_.reset();
  const auto database = Database();
  int64_t version = 0;
  {
    Statement query = database->Prepare("PRAGMA user_version");
    ASSERT_TRUE(*query.Step());
    version = query.Int64(0);
  }
  ASSERT_TRUE(database->Execute(absl::StrCat("PRAGMA user_version=", version + 1)).ok());
  const absl::Status status = SqlJobStore::Open(directory_).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr("later version"));
  ASSERT_TRUE(database->Execute(absl::StrCat("PRAGMA user_version=", version)).ok());
  Reopen();
}

}  // namespace
}  // namespace sheaf::coordinator
