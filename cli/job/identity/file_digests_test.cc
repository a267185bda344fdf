// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/file_digests.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/base/digest.h"

namespace sheaf::cli {
namespace {

TEST(FileDigestsTest, DetectsAChangedFile) {
  const std::string path = ::testing::TempDir() + "/file_digests_test";
  std::ofstream(path) << "one";
  FileDigests digests;
  EXPECT_EQ(digests.Of(path)->sha256_hex, Sha256Hex("one"));
  EXPECT_EQ(digests.Of(path)->size_bytes, 3u);
  std::ofstream(path) << "three";
  EXPECT_EQ(digests.Of(path)->sha256_hex, Sha256Hex("three"));
  std::filesystem::remove(path);
  EXPECT_EQ(digests.Of(path).status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace sheaf::cli
