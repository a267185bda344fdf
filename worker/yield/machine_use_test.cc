// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/yield/machine_use.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace sheaf::worker {
namespace {

TEST(MachineUseTest, ReadsTimeAtOrdinaryPriorityAndMemory) {
  const std::string proc = ::testing::TempDir() + "proc";
  std::filesystem::create_directories(proc);
  std::ofstream(proc + "/stat") << "cpu  12300 999 456 7890 0 0 0\ncpu0 1 2 3 4\n";
  std::ofstream(proc + "/meminfo") << "MemTotal:  800 kB\nMemFree:  10 kB\nMemAvailable:  300 kB\n";
  const MachineReading reading = ReadMachine(proc);
  EXPECT_DOUBLE_EQ(reading.processor_seconds.value(),
                   12300.0 / static_cast<double>(::sysconf(_SC_CLK_TCK)));
  EXPECT_EQ(reading.memory_available, uint64_t{300} << 10);
}

TEST(MachineUseTest, WhatIsNotThereIsNotKnown) {
  const MachineReading reading = ReadMachine("/nowhere");
  EXPECT_FALSE(reading.processor_seconds.has_value());
  EXPECT_FALSE(reading.memory_available.has_value());
}

TEST(MachineUseTest, ThisMachineSaysBoth) {
  const MachineReading reading = ReadMachine();
  EXPECT_GT(reading.processor_seconds.value(), 0);
  EXPECT_GT(reading.memory_available.value(), 0u);
}

TEST(ProcessorUseTest, IsTheMeanOverTheWindow) {
  ProcessorUse use(absl::Seconds(10));
  const SteadyTime start = SteadyTime() + absl::Hours(1);
  double used = 100;
  for (int second = 0; second < 10; ++second) {
    EXPECT_FALSE(use.Add(start + absl::Seconds(second), used).has_value()) << second;
    used += 2;
  }
  EXPECT_DOUBLE_EQ(use.Add(start + absl::Seconds(10), used).value(), 2);
  // The load ends: after half a window half of it is left, after a window nothing.
  for (int second = 11; second < 15; ++second) use.Add(start + absl::Seconds(second), used);
  EXPECT_DOUBLE_EQ(use.Add(start + absl::Seconds(15), used).value(), 1);
  for (int second = 16; second < 20; ++second) use.Add(start + absl::Seconds(second), used);
  EXPECT_DOUBLE_EQ(use.Add(start + absl::Seconds(20), used).value(), 0);
}

TEST(ProcessorUseTest, SeldomReadingsCountFromTheLastOne) {
  ProcessorUse use(absl::Seconds(10));
  const SteadyTime start = SteadyTime() + absl::Hours(1);
  EXPECT_FALSE(use.Add(start, 0).has_value());
  EXPECT_DOUBLE_EQ(use.Add(start + absl::Seconds(40), 80).value(), 2);
  EXPECT_DOUBLE_EQ(use.Add(start + absl::Seconds(80), 120).value(), 1);
}

}  // namespace
}  // namespace sheaf::worker
