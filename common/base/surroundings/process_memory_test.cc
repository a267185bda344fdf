// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/process_memory.h"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace sheaf {
namespace {

TEST(ProcessMemoryTest, TellsFilesFromOtherPages) {
  const ResidentMemory memory = ResidentMemoryOf(
      "55d0-55d1 r-xp 00000000 08:01 42     /usr/bin/a name: with a colon\n"
      "Size:                  8 kB\n"
      "Rss:                   4 kB\n"
      "VmFlags: rd ex mr mw me\n"
      "7f00-7f01 rw-p 00000000 00:00 0      [heap]\n"
      "Rss:                  12 kB\n"
      "7f02-7f03 rw-p 00000000 00:00 0 \n"
      "Rss:                 100 kB\n"
      "Pss:                 100 kB\n");
  EXPECT_EQ(memory.bytes, 116u << 10);
  EXPECT_EQ(memory.file_bytes, 4u << 10);
  EXPECT_EQ(ResidentMemoryOf("").bytes, 0u);
}

TEST(ProcessMemoryTest, GrowsWithWhatIsTouched) {
  constexpr size_t kBytes = size_t{32} << 20;
  const ProcessMemory before = ProcessMemoryNow();
  EXPECT_GT(before.resident.file_bytes, 0u);
  EXPECT_GT(before.resident.bytes, before.resident.file_bytes);
  std::vector<char> block(kBytes);
  std::memset(block.data(), 1, block.size());
  const ProcessMemory after = ProcessMemoryNow();
  EXPECT_EQ(block.back(), 1);
  EXPECT_NEAR(static_cast<double>(ResidentBytesNow()), static_cast<double>(after.resident.bytes),
              0.1 * static_cast<double>(after.resident.bytes));
  EXPECT_GE(after.resident.bytes, before.resident.bytes + kBytes * 9 / 10);
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_GE(after.heap_used_bytes, before.heap_used_bytes + kBytes);
#endif
}

}  // namespace
}  // namespace sheaf
