// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/host_name.h"

#include <gtest/gtest.h>

#include "common/base/printable.h"

namespace sheaf {
namespace {

TEST(HostNameTest, IsAlwaysFitForMessages) {
  EXPECT_EQ(UsableHostName("node-7.example.org"), "node-7.example.org");
  EXPECT_EQ(UsableHostName("k\xc3\xbc"
                           "che"),
            "k\xc3\xbc"
            "che");
  EXPECT_EQ(UsableHostName("k\xfc"
                           "che"),
            "k_che")
      << "Latin-1";
  EXPECT_EQ(UsableHostName("\xe9\xe8\n"), "___");
  EXPECT_EQ(UsableHostName(""), "unnamed-host");
  EXPECT_EQ(FindUnprintable(HostName()), std::string::npos);
  EXPECT_FALSE(HostName().empty());
}

}  // namespace
}  // namespace sheaf
