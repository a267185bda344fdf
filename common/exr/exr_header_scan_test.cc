// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/exr/exr_header_scan.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <tuple>
#include <utility>

#include "gtest/gtest.h"

namespace sheaf {
namespace {

std::string TemporaryPath(const std::string& name) {
  return (std::filesystem::path(::testing::TempDir()) / name).string();
}

std::string BytesOf(int32_t value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof value);
}
// An EXR header of one attribute, which declares declared_bytes.
std::string ExrOfOneAttribute(int32_t flags, const std::string& type, int32_t declared_bytes,
                              const std::string& value) {
  using namespace std::string_literals;
  return "\x76\x2f\x31\x01"s + BytesOf(2 | flags) + "note\0"s + type + "\0"s +
         BytesOf(declared_bytes) + value + "\0\0"s;
}

// OpenEXR would allocate the sizes that attributes declare.
TEST(ExrHeaderTest, AttributesBeyondTheFileAreRefused) {
  const std::string ends = "the EXR file ends within its header";
  const std::string path = TemporaryPath("attribute.exr");
  const std::string texts = BytesOf(2) + "xx", texts_beyond = BytesOf(2'000'000'000) + "xx";
  for (const int32_t multi_part : {0, 0x1000}) {
    for (const auto& [header, why] : std::initializer_list<std::pair<std::string, std::string>>{
             {ExrOfOneAttribute(multi_part, "string", 2'000'000'000, "8 bytes."), ends},
             {ExrOfOneAttribute(multi_part, "string", 11, "8 bytes."), ends},
             {ExrOfOneAttribute(multi_part, "string", -1, "8 bytes."), "a negative size"},
             {ExrOfOneAttribute(multi_part, "stringvector", 6, texts_beyond), "does not end"},
             {ExrOfOneAttribute(multi_part, "stringvector", 6, texts), "\"channels\" is missing"},
             {ExrOfOneAttribute(multi_part, "string", 8, "8 bytes."), "\"channels\" is missing"}}) {
      std::ofstream(path, std::ios::binary) << header;
      const absl::Status status = ReadExrHeader(path).status();
      EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
      EXPECT_EQ(std::string(status.message()).rfind(path, 0), 0u) << status;
      EXPECT_NE(std::string(status.message()).find(why), std::string::npos) << status;
    }
  }
}

// OpenEXR reads values of these types without regard to the size that is stated, and would take
// what follows for attributes that no one has checked.
TEST(ExrHeaderTest, ValuesEndWhereTheirAttributesDo) {
  using namespace std::string_literals;
  const std::string channel = "A\0"s + BytesOf(2) + BytesOf(0) + BytesOf(1) + BytesOf(1);
  const std::string preview = BytesOf(2) + BytesOf(1) + "8 bytes.";
  const std::string huge_preview = BytesOf(1 << 16) + BytesOf(1 << 16) + "8 bytes.";
  const std::string path = TemporaryPath("end.exr");
  const std::string fine = "\"channels\" is missing", wrong = "wrong size";
  for (const auto& [type, value, why] :
       std::initializer_list<std::tuple<std::string, std::string, std::string>>{
           {"chlist", channel + "\0"s, fine},
           {"chlist", channel, "does not end"},
           {"chlist", channel + "\0x"s, "extra bytes"},
           {"preview", preview, fine},
           {"preview", preview + "x", wrong},
           {"preview", huge_preview, wrong},
           {"preview", "4 by", wrong},
           {"floatvector", "8 bytes.", fine},
           {"floatvector", "7 bytes", wrong},
           {"v2d", "8 bytes.", wrong},
           {"v3d", "8 bytes.", wrong},
           {"m33d", "8 bytes.", wrong},
           {"m44d", "8 bytes.", wrong},
           {"deepImageState", "8 bytes.", wrong}}) {
    SCOPED_TRACE(type);
    std::ofstream(path, std::ios::binary)
        << ExrOfOneAttribute(0, type, static_cast<int32_t>(value.size()), value);
    const absl::Status status = ReadExrHeader(path).status();
    EXPECT_NE(std::string(status.message()).find(why), std::string::npos) << status;
  }
}

TEST(ExrHeaderTest, LargeHeadersAreReadInPieces) {
  for (const size_t size : {size_t{1} << 14, size_t{1} << 20, kExrHeaderBytesMax}) {
    const std::string path = TemporaryPath("large header.exr");
    std::ofstream(path, std::ios::binary)
        << ExrOfOneAttribute(0, "string", static_cast<int32_t>(size), std::string(size, 'x'));
    const absl::Status status = ReadExrHeader(path).status();
    const std::string why =
        size < kExrHeaderBytesMax ? "\"channels\" is missing" : "more than 67108864 bytes";
    EXPECT_NE(std::string(status.message()).find(why), std::string::npos) << status;
  }
}

TEST(ExrHeaderTest, FilesOfOtherFormatsPass) {
  const std::string path = TemporaryPath("text.exr");
  std::ofstream(path, std::ios::binary) << "this is no image";
  const auto text = ReadExrHeader(path), absent = ReadExrHeader(TemporaryPath("absent.exr"));
  EXPECT_TRUE(text.ok() && !*text) << text.status();
  EXPECT_TRUE(absent.ok() && !*absent) << absent.status();
}

}  // namespace
}  // namespace sheaf
