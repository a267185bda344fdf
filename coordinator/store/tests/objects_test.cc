// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The job store with parts in a store other than a folder: one without conditional writes, and
// whose calls fail.
#include <map>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

// Objects in memory.
class MemoryObjects : public ObjectStore {
 public:
  std::string Name() const override { return "memory"; }
  absl::Status Put(const std::string& key, std::string_view bytes, PutMode /*mode*/) override {
    if (!put_status.ok()) return put_status;
    objects[key] = std::string(bytes);
    return absl::OkStatus();
  }
  absl::Status PutFile(const std::string& /*key*/, const std::string& path) override {
    return absl::InvalidArgumentError(path + ": the job store puts no files");
  }
  absl::Status Sync() override { return std::exchange(sync_status, absl::OkStatus()); }
  absl::StatusOr<std::string> Get(const std::string& key, const FileDigest& digest) override {
    const auto object = objects.find(key);
    if (object == objects.end()) return absl::NotFoundError(key);
    if (Sha256Hex(object->second) != digest.sha256_hex) return absl::DataLossError(key);
    return object->second;
  }
  absl::StatusOr<std::string> GetRange(const std::string& key, uint64_t offset_bytes,
                                       uint64_t size_bytes_max) override {
    const auto object = objects.find(key);
    if (object == objects.end()) return absl::NotFoundError(key);
    return object->second.substr(offset_bytes, size_bytes_max);
  }
  absl::StatusOr<uint64_t> Head(const std::string& key) override {
    const auto object = objects.find(key);
    if (object == objects.end()) return absl::NotFoundError(key);
    return object->second.size();
  }
  absl::Status List(const std::string& folder,
                    const std::function<void(const StoredObject&)>& visit) override {
    for (const auto& [key, bytes] : objects) {
      if (absl::StartsWith(key, folder)) visit({key, bytes.size(), absl::UnixEpoch()});
    }
    return absl::OkStatus();
  }
  absl::StatusOr<std::vector<std::string>> ListFolders(const std::string& folder) override {
    std::vector<std::string> names;
    for (const auto& [key, bytes] : objects) {
      const size_t slash = key.find('/', folder.size());
      if (!absl::StartsWith(key, folder) || slash == std::string::npos) continue;
      const std::string name = key.substr(folder.size(), slash - folder.size());
      if (names.empty() || names.back() != name) names.push_back(name);
    }
    return names;
  }
  absl::Status Remove(const std::string& key) override {
    objects.erase(key);
    return absl::OkStatus();
  }
  absl::Status RemoveFolder(const std::string& folder) override {
    std::erase_if(objects, [&](const auto& o) { return absl::StartsWith(o.first, folder); });
    return absl::OkStatus();
  }
  std::optional<PutTicket> TicketToPut(const std::string& key, const FileDigest&) override {
    return PutTicket{"memory:" + key, {}};
  }
  std::optional<ObjectCounts> Counts() const override { return std::nullopt; }

  std::map<std::string, std::string> objects;
  absl::Status put_status;
  absl::Status sync_status;  // Returned by the next Sync.
};

// The store of objects outlives the job store.
class WithObjects {
 protected:
  MemoryObjects objects_;
};

class ObjectsTest : protected WithObjects, public JobStoreFixture {
 protected:
  ObjectsTest() : JobStoreFixture(&objects_) {}
  static PartRow RowOf(const std::string& bytes, int32_t frame = 1) {
    PartRow row;
    row.key.frame = {1, frame};
    row.key.tile = {0, 0, 16, 16};
    row.key.block = {0, 16};
    row.digest = {Sha256Hex(bytes), bytes.size()};
    row.worker_id = "w";
    return row;
  }
};

TEST_P(ObjectsTest, AnAcknowledgedPartStaysWhateverComesAfterwards) {
  const PartRow row = RowOf("bytes");
  ASSERT_TRUE(store_->WritePart(row, "bytes").ok());
  EXPECT_TRUE(absl::IsAlreadyExists(store_->WritePart(row, "bytes")));
  EXPECT_EQ(store_->ReadPart(row).value_or("?"), "bytes");
  objects_.sync_status = absl::ResourceExhaustedError("full");
  EXPECT_TRUE(absl::IsResourceExhausted(store_->WritePart(row, "bytes")));
  EXPECT_EQ(store_->ReadPart(row).value_or("?"), "bytes");
  EXPECT_TRUE(absl::IsAlreadyExists(store_->AddStoredPart(row, "bytes")));
  EXPECT_EQ(store_->PartsBytes(), 5u);
}

TEST_P(ObjectsTest, APartThatIsNotAcknowledgedLeavesNothing) {
  objects_.sync_status = absl::UnavailableError("gone");
  EXPECT_TRUE(absl::IsUnavailable(store_->WritePart(RowOf("bytes"), "bytes")));
  EXPECT_FALSE(store_->FindPart(RowOf("bytes").key)->has_value());
  // Coordinators that share the store leave the object to the next start: it may be the other's.
  EXPECT_EQ(objects_.objects.size(), GetParam() == DatabaseKind::kPostgres ? 1u : 0u);
  EXPECT_TRUE(store_->LoadParts(1).ok());
  EXPECT_TRUE(objects_.objects.empty());
}

TEST_P(ObjectsTest, ARefusalOfTheStoreIsNoneOfTheResult) {
  for (const absl::Status& refusal :
       {absl::PermissionDeniedError("403"), absl::FailedPreconditionError("no bucket")}) {
    objects_.put_status = refusal;
    EXPECT_TRUE(absl::IsUnavailable(store_->WritePart(RowOf("bytes"), "bytes")));
  }
  objects_.put_status = absl::OkStatus();
  EXPECT_TRUE(store_->WritePart(RowOf("bytes"), "bytes").ok());
}

TEST_P(ObjectsTest, AStoredPartGetsItsRow) {
  const PartRow row = RowOf("bytes");
  const std::optional<PutTicket> ticket = store_->TicketFor(row);
  ASSERT_TRUE(ticket.has_value());
  objects_.objects[ticket->url.substr(7)] = "bytes";
  ASSERT_TRUE(store_->AddStoredPart(row, "bytes").ok());
  EXPECT_EQ(store_->ReadPart(row).value_or("?"), "bytes");
  // An object that went meanwhile is written.
  ASSERT_TRUE(store_->AddStoredPart(RowOf("others", 2), "others").ok());
  EXPECT_EQ(store_->ReadPart(RowOf("others", 2)).value_or("?"), "others");
  EXPECT_EQ(store_->PartsBytes(), 11u);
}

TEST_P(ObjectsTest, LoadsWhatIsThereAndRemovesWhatHasNoRow) {
  ASSERT_TRUE(store_->WritePart(RowOf("one", 1), "one").ok());
  ASSERT_TRUE(store_->WritePart(RowOf("two", 2), "two").ok());
  ASSERT_TRUE(store_->WritePart(RowOf("three", 3), "three").ok());
  for (auto& [key, bytes] : objects_.objects) {
    if (absl::StartsWith(key, "1/2/")) bytes = "truncate";
  }
  objects_.objects["1/9/left-over.exr"] = "x";
  Reopen();
  const auto loaded = store_->LoadParts(1);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ(loaded->rows.size(), 2u);
  ASSERT_EQ(loaded->lost.size(), 1u);
  EXPECT_EQ(loaded->lost[0].key.frame.frame_number, 2);
  EXPECT_EQ(loaded->files_without_row, 1);
  EXPECT_EQ(objects_.objects.size(), 2u);
  ASSERT_TRUE(store_->RemoveFrameParts({1, 1}).ok());
  EXPECT_EQ(objects_.objects.size(), 1u);
}

SHEAF_ON_ALL_DATABASES(ObjectsTest);

}  // namespace
}  // namespace sheaf::coordinator
