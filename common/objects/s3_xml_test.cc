// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/s3_xml.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(S3XmlTest, ReadsAPage) {
  const auto page = ParseS3Page(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<ListBucketResult xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\"><Name>farm</Name>"
      "<IsTruncated>true</IsTruncated><NextContinuationToken>a&amp;b</NextContinuationToken>"
      "<Contents><Key>p/1</Key><LastModified>2013-05-24T00:00:01.000Z</LastModified>"
      "<Size>5000000000</Size></Contents>"
      "<CommonPrefixes><Prefix>p/7/</Prefix></CommonPrefixes></ListBucketResult>");
  ASSERT_TRUE(page.ok()) << page.status();
  ASSERT_EQ(page->objects.size(), 1u);
  EXPECT_EQ(page->objects[0].key, "p/1");
  EXPECT_EQ(page->objects[0].size_bytes, 5000000000u);
  EXPECT_EQ(absl::ToUnixSeconds(page->objects[0].written), 1369353601);
  EXPECT_EQ(page->prefixes, std::vector<std::string>{"p/7/"});
  EXPECT_EQ(page->next_token, "a&b");
}

TEST(S3XmlTest, RefusesWhatIsNoPage) {
  for (const char* text :
       {"", "<html><body>login</body></html>", "<ListBucketResult><Contents>",
        "<ListBucketResult><Contents><Key>a</Key></Contents></ListBucketResult>",
        "<ListBucketResult><IsTruncated>true</IsTruncated></ListBucketResult>"}) {
    EXPECT_TRUE(absl::IsUnavailable(ParseS3Page(text).status())) << text;
  }
  EXPECT_TRUE(absl::IsUnavailable(ParseUploadId("<InitiateMultipartUploadResult/>").status()));
}

TEST(S3XmlTest, ReadsErrors) {
  const S3Error error =
      ParseS3Error("<Error><Code>SlowDown</Code><Message>less, please</Message></Error>");
  EXPECT_EQ(error.code, "SlowDown");
  EXPECT_EQ(error.message, "less, please");
  EXPECT_EQ(ParseS3Error("no xml").code, "");
  const auto failed = ParseFailedRemovals(
      "<DeleteResult><Error><Key>a</Key><Code>NoSuchKey</Code></Error><Error><Key>b</Key>"
      "<Code>AccessDenied</Code><Message>no</Message></Error></DeleteResult>");
  ASSERT_TRUE(failed.ok());
  EXPECT_EQ(*failed, std::vector<std::string>{"b: AccessDenied: no"});
}

TEST(S3XmlTest, WritesBodies) {
  EXPECT_EQ(FormatCompletedUpload({"\"e\""}),
            "<CompleteMultipartUpload><Part><PartNumber>1</PartNumber><ETag>\"e\"</ETag></Part>"
            "</CompleteMultipartUpload>");
  EXPECT_EQ(FormatRemovals({"a&b"}),
            "<Delete><Quiet>true</Quiet><Object><Key>a&amp;b</Key></Object></Delete>");
}

}  // namespace
}  // namespace sheaf
