// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/disk_reserve.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "common/base/surroundings/disk_space.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

// Full disks: tests/integration/disk_space_test.py.
class DiskReserveTest : public ::testing::Test {
 protected:
  DiskReserveTest() {
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  ~DiskReserveTest() override { fs::remove_all(directory_); }
  uint64_t ReserveBytes() const {
    return fs::exists(directory_ + "/reserve") ? fs::file_size(directory_ + "/reserve") : 0;
  }

  const std::string directory_ = ::testing::TempDir() + "sheaf-disk-reserve";
};

TEST_F(DiskReserveTest, TakesItsSpaceAndGivesItUpWithoutALimit) {
  const uint64_t wanted = kDatabaseBytesMin * 2;
  {
    const DiskReserve reserve(directory_, wanted);
    EXPECT_EQ(ReserveBytes(), wanted);
    EXPECT_EQ(reserve.OwedBytes(), 0u);
    EXPECT_TRUE(reserve.CheckRoom(UINT64_MAX / 2).ok()) << "a write tells";
  }
  const DiskReserve none(directory_, 0);
  EXPECT_EQ(ReserveBytes(), 0u);
  EXPECT_EQ(none.OwedBytes(), 0u);
}

TEST_F(DiskReserveTest, RestoresWhatWasGivenUp) {
  const uint64_t wanted = kDatabaseBytesMin * 2;
  DiskReserve reserve(directory_, wanted);
  fs::resize_file(directory_ + "/reserve", wanted / 2);
  EXPECT_EQ(reserve.OwedBytes(), wanted / 2);
  const auto space = DiskSpaceOf(directory_);
  ASSERT_TRUE(space.has_value());
  EXPECT_TRUE(reserve.CheckRoom(1).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(reserve.CheckRoom(space->capacity_bytes)))
      << "the database's half is not for others";
  reserve.Update();
  EXPECT_EQ(ReserveBytes(), wanted);
}

TEST_F(DiskReserveTest, IsASmallPartOfTheFileSystem) {
  const auto space = DiskSpaceOf(directory_);
  ASSERT_TRUE(space.has_value());
  EXPECT_EQ(AtMostFractionOf(*space, kReserveFractionMax, UINT64_MAX), space->capacity_bytes / 8);
  EXPECT_EQ(AtMostFractionOf(*space, kReserveFractionMax, 7), 7u);
}

TEST_F(DiskReserveTest, WithFreeSpaceAStartRemovesNoUploads) {
  fs::create_directories(directory_ + "/content/partial");
  std::ofstream(directory_ + "/content/partial/a.part") << "bytes";
  MakeRoomForDatabase(directory_);
  EXPECT_TRUE(fs::exists(directory_ + "/content/partial/a.part"));
}

}  // namespace
}  // namespace sheaf::coordinator
