// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf {
namespace {

const std::string kHex(64, 'a');

TEST(ManifestTest, SortsItsFiles) {
  const Manifest manifest = MakeManifest("b.pbrt", {{"b.pbrt", {kHex, 1}}, {"a.ply", {kHex, 1}}});
  EXPECT_EQ(manifest.files.front().name, "a.ply");
  EXPECT_TRUE(CheckManifest(manifest).ok());
}

TEST(ManifestTest, ErrorsNameTheBrokenRule) {
  struct Case {
    Manifest manifest;
    std::string reason;
  };
  const Case cases[] = {
      {{"x.pbrt", {{"a", {kHex, 1}}}}, "main file"},
      {{"a", {{"b", {kHex, 1}}, {"a", {kHex, 1}}}}, "out of order"},
      {{"a", {{"a", {kHex, 1}}, {"a", {kHex, 1}}}}, "listed twice"},
      {{"a", {{"a", {"../../etc/passwd", 1}}}}, "hexadecimal"},
      {{"", {{"", {kHex, 1}}}}, "without a name"},
      {{"sc\xe9ne", {{"sc\xe9ne", {kHex, 1}}}}, "not UTF-8; rename"},
  };
  for (const Case& c : cases) {
    const absl::Status status = CheckManifest(c.manifest);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr(c.reason));
  }
}

}  // namespace
}  // namespace sheaf
