// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/profile/memory_account.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

MemoryAccount Account() {
  render::SceneMemory scene;
  scene.mesh_bytes = 3 << 20;
  scene.tracer_bytes = 5 << 20;
  ProcessMemory process;
  process.resident = {20 << 20, 6 << 20};
  process.heap_free_bytes = 1 << 20;
  return MakeMemoryAccount(scene, {.program_bytes = 2 << 20, .film_bytes = 1 << 20}, process);
}

TEST(MemoryAccountTest, AddsUpToWhatTheSystemSays) {
  const MemoryAccount account = Account();
  int64_t sum = account.OtherBytes();
  for (const MemoryAccount::Kind& kind : account.kinds) sum += static_cast<int64_t>(kind.bytes);
  EXPECT_EQ(sum, 20 << 20);
  EXPECT_EQ(account.OtherBytes(), 2 << 20);
}

TEST(MemoryAccountTest, ListsNoKindThatIsNotThere) {
  const std::string text = FormatMemoryAccount(Account());
  EXPECT_THAT(text, HasSubstr("  meshes                      3.00 MiB\n"));
  EXPECT_THAT(text, HasSubstr("  resident                   20.00 MiB\n"));
  EXPECT_THAT(text, Not(HasSubstr("volumes")));
  EXPECT_THAT(text, Not(HasSubstr("farm")));
  const nlohmann::ordered_json json = MemoryAccountJson(Account());
  EXPECT_EQ(json["kinds"].size(), 6u);
  EXPECT_EQ(json["kinds"][0]["name"], "meshes");
  EXPECT_EQ(json["other_bytes"], 2 << 20);
}

TEST(MemoryAccountTest, PagesThatAreNotInMemoryLeaveLessThanNothing) {
  render::SceneMemory scene;
  scene.mesh_bytes = 3 << 20;
  ProcessMemory process;
  process.resident.bytes = 1 << 20;
  EXPECT_EQ(MakeMemoryAccount(scene, {}, process).OtherBytes(), -(2 << 20));
}

}  // namespace
}  // namespace sheaf::cli
