// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/golden/golden_file.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include "tests/support/source_path.h"

namespace sheaf::testing {
namespace {

bool is_renewal = false;

std::string Read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

void Write(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  ASSERT_TRUE(file.flush().good()) << path;
}

}  // namespace

void SetRenewal(bool renews) { is_renewal = renews; }

void ExpectGoldenAt(const std::string& name, const std::string& text) {
  const std::string path = SourcePath(name);
  if (is_renewal) {
    Write(path, text);
    return;
  }
  const std::string actual = absl::StrCat(path, ".actual");
  if (Read(path) == text) {
    std::filesystem::remove(actual);
    return;
  }
  Write(actual, text);
  ADD_FAILURE() << path << " is not what the program makes now. Compare: diff " << path << " "
                << actual
                << "\nIf users should see the change, renew the file with --renew and commit it: "
                   "build/release/bin/sheaf_golden_test --renew";
}

void ExpectGolden(const std::string& name, const std::string& text) {
  ExpectGoldenAt(absl::StrCat("tests/golden/files/", name), text);
}

}  // namespace sheaf::testing

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  sheaf::testing::SetRenewal(argc > 1 && std::string(argv[1]) == "--renew");
  return RUN_ALL_TESTS();
}
