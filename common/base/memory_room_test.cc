// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/memory_room.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace sheaf {
namespace {

using ::testing::HasSubstr;

constexpr uint64_t kMiB = uint64_t{1} << 20;

class MemoryRoomTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/memory_room_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    Write("proc/meminfo", "MemTotal:  8388608 kB\nMemFree: 1 kB\nMemAvailable:  4194304 kB\n");
    Write("proc/self/cgroup", "0::/jobs/a\n");
    Write("proc/self/statm",
          std::to_string(100 * kMiB / static_cast<uint64_t>(::getpagesize())) + " 1 1 1 0 1 0\n");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  void Write(const std::string& name, const std::string& text) {
    const std::filesystem::path path = folder_ + "/" + name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  MemoryRoom Find(uint64_t address_space_max = UINT64_MAX) {
    return FindMemoryRoom(address_space_max, folder_ + "/proc", folder_ + "/cgroup");
  }

  std::string folder_;
};

TEST_F(MemoryRoomTest, WithoutLimitsTheMachineMemoryCounts) {
  Write("cgroup/jobs/a/memory.max", "max\n");
  Write("cgroup/jobs/a/memory.current", "5\n");
  EXPECT_EQ(Find().bytes, 4096 * kMiB);
  EXPECT_THAT(Find().limit, HasSubstr("8.0 GiB"));
}

TEST_F(MemoryRoomTest, AddressSpaceInUseIsSubtracted) {
  const MemoryRoom room = Find(900 * kMiB);
  EXPECT_EQ(room.bytes, 800 * kMiB);
  EXPECT_EQ(room.limit, "the limit of address space (ulimit -v, 900 MiB)");
}

TEST_F(MemoryRoomTest, ParentGroupMayBeTheTightest) {
  Write("cgroup/jobs/a/memory.max", "max\n");
  Write("cgroup/jobs/a/memory.current", "0\n");
  Write("cgroup/jobs/memory.max", std::to_string(1000 * kMiB));
  Write("cgroup/jobs/memory.current", std::to_string(600 * kMiB));
  Write("cgroup/jobs/memory.stat", "anon 5\ninactive_file " + std::to_string(200 * kMiB) + "\n");
  EXPECT_EQ(Find().bytes, 600 * kMiB) << "the cache of files gives way";
  EXPECT_THAT(Find().limit, HasSubstr("memory.max"));
}

TEST_F(MemoryRoomTest, VersionOneGroupsCount) {
  Write("cgroup/memory/memory.limit_in_bytes", std::to_string(300 * kMiB));
  Write("cgroup/memory/memory.usage_in_bytes", std::to_string(400 * kMiB));
  EXPECT_EQ(Find().bytes, 0u);
}

TEST_F(MemoryRoomTest, VersionOneGroupsWithinOthersCount) {
  Write("proc/self/cgroup", "4:memory:/jobs/a\n2:cpuacct:/other\n0::/\n");
  Write("cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  Write("cgroup/memory/memory.usage_in_bytes", "0\n");
  Write("cgroup/memory/jobs/memory.limit_in_bytes", std::to_string(900 * kMiB));
  Write("cgroup/memory/jobs/memory.usage_in_bytes", "0\n");
  Write("cgroup/memory/jobs/a/memory.limit_in_bytes", std::to_string(300 * kMiB));
  Write("cgroup/memory/jobs/a/memory.usage_in_bytes", std::to_string(100 * kMiB));
  EXPECT_EQ(Find().bytes, 200 * kMiB);
  EXPECT_THAT(Find().limit, HasSubstr("control group"));
  Write("cgroup/memory/jobs/memory.usage_in_bytes", std::to_string(850 * kMiB));
  EXPECT_EQ(Find().bytes, 50 * kMiB) << "that of the group around it";
}

TEST(FormatMemoryTest, SmallSizesAreNotZero) {
  EXPECT_EQ(FormatMemory(12), "12 bytes");
  EXPECT_EQ(FormatMemory(1024), "1 KiB");
  EXPECT_EQ(FormatMemory(900 * kMiB), "900 MiB");
  EXPECT_EQ(FormatMemory(1536 * kMiB), "1.5 GiB");
}

TEST_F(MemoryRoomTest, ThisProcessHasMemory) {
  EXPECT_GT(FindMemoryRoom().bytes, 0u);
  EXPECT_FALSE(FindMemoryRoom().limit.empty());
}

}  // namespace
}  // namespace sheaf
