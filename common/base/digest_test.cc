// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/digest.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "absl/strings/escaping.h"
#include "common/base/file.h"

namespace sheaf {
namespace {

// Source of the vectors: NIST, FIPS 180-4 examples.
constexpr char kOfNothing[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr char kOfAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr char kOfMillionA[] = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

TEST(DigestTest, MatchesKnownVectors) {
  EXPECT_EQ(Sha256Hex(""), kOfNothing);
  EXPECT_EQ(Sha256Hex("abc"), kOfAbc);
  EXPECT_EQ(Sha256Hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(DigestTest, PiecewiseDigestEqualsWholeDigest) {
  Sha256 hash;
  for (int i = 0; i < 1000; ++i) hash.Update(std::string(1000, 'a'));
  EXPECT_EQ(hash.FinishHex(), kOfMillionA);
}

TEST(DigestTest, MovedHashContinues) {
  Sha256 first;
  first.Update("ab");
  Sha256 second = std::move(first);
  second.Update("c");
  EXPECT_EQ(second.FinishHex(), kOfAbc);
}

TEST(DigestTest, DigestsFiles) {
  const std::string path = ::testing::TempDir() + "sheaf-digest-test";
  ASSERT_TRUE(WriteFileAtomically(path, std::string(1000000, 'a')).ok());
  const absl::StatusOr<FileDigest> digest = Sha256OfFile(path);
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(digest->sha256_hex, kOfMillionA);
  EXPECT_EQ(digest->size_bytes, 1000000u);
  EXPECT_TRUE(absl::IsNotFound(Sha256OfFile(path + ".none").status()));
}

TEST(DigestTest, RecognizesHexDigests) {
  EXPECT_TRUE(IsSha256Hex(kOfAbc));
  EXPECT_FALSE(IsSha256Hex(""));
  EXPECT_FALSE(IsSha256Hex(std::string(63, 'a')));
  EXPECT_FALSE(IsSha256Hex(std::string(65, 'a')));
  EXPECT_FALSE(IsSha256Hex(std::string(64, 'A')));
  EXPECT_FALSE(IsSha256Hex("../" + std::string(61, 'a')));
}

TEST(DigestTest, BytesOfHexAreTheBytesThatWereWritten) {
  std::string bytes;
  for (int i = 0; i < 256; ++i) bytes += static_cast<char>(i);
  EXPECT_EQ(BytesOfHex(absl::BytesToHexString(bytes)), bytes);
  EXPECT_EQ(BytesOfHex("aBC0"), "\xab\xc0");
  EXPECT_EQ(BytesOfHex(""), "");
}

TEST(DigestDeathTest, OtherTextThanHexIsAFault) {
  EXPECT_DEATH(BytesOfHex("abc"), "");
  EXPECT_DEATH(BytesOfHex("0g"), "");
  EXPECT_DEATH(BytesOfHex("-1"), "");
}

}  // namespace
}  // namespace sheaf
