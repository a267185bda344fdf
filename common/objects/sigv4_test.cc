// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The examples of "Signature Calculations for the Authorization Header" and "Authenticating
// Requests: Using Query Parameters" in the Amazon S3 API Reference, with their signatures.
#include "common/objects/sigv4.h"

#include "common/base/digest.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

const S3Credentials kExampleKey{"AKIAIOSFODNN7EXAMPLE", "wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY",
                                ""};
const char kExampleHost[] = "examplebucket.s3.amazonaws.com";

absl::Time ExampleTime() {
  return absl::FromCivil(absl::CivilSecond(2013, 5, 24), absl::UTCTimeZone());
}

SignedRequest Example(const std::string& method, const std::string& path) {
  SignedRequest request{method, path, {}, {}, Sha256Hex("")};
  request.headers = {{"host", kExampleHost},
                     {"x-amz-content-sha256", request.payload_hash},
                     {"x-amz-date", "20130524T000000Z"}};
  return request;
}

std::string ExampleSignature(const SignedRequest& request) {
  return SignatureOf(request, kExampleKey, "us-east-1", ExampleTime());
}

TEST(SigV4Test, SignsTheExampleOfARange) {
  SignedRequest request = Example("GET", "/test.txt");
  request.headers["range"] = "bytes=0-9";
  EXPECT_EQ(ExampleSignature(request),
            "f0e8bdb87c964420e857bd35b5d6ed310bd44f0170aba48dd91039c6036bdb41");
}

TEST(SigV4Test, SignsTheExampleOfAnObjectWithAName) {
  SignedRequest request = Example("PUT", "/test$file.text");
  request.payload_hash = Sha256Hex("Welcome to Amazon S3.");
  request.headers["x-amz-content-sha256"] = request.payload_hash;
  request.headers["date"] = "Fri, 24 May 2013 00:00:00 GMT";
  request.headers["x-amz-storage-class"] = "REDUCED_REDUNDANCY";
  EXPECT_EQ(ExampleSignature(request),
            "98ad721746da40c64f1a55b78f14c238d841ea1380cd77a1b5971af0ece108bd");
}

TEST(SigV4Test, SignsTheExampleOfAQueryWithoutValue) {
  SignedRequest request = Example("GET", "/");
  request.query["lifecycle"] = "";
  EXPECT_EQ(ExampleSignature(request),
            "fea454ca298b7da1c68078a5d1bdbfbbe0d65c699e0f91ac7a200a0136783543");
}

TEST(SigV4Test, SignsTheExampleOfAList) {
  SignedRequest request = Example("GET", "/");
  request.query = {{"prefix", "J"}, {"max-keys", "2"}};
  EXPECT_EQ(ExampleSignature(request),
            "34b48302e7b5fa45bde8084f4b7868a86f0a534bc59db6670ed5711ef69dc6f7");
}

TEST(SigV4Test, MakesTheUrlOfTheExample) {
  SignedRequest request{"GET", "/test.txt", {}, {{"host", kExampleHost}}, "UNSIGNED-PAYLOAD"};
  EXPECT_EQ(PresignedUrl("https://examplebucket.s3.amazonaws.com", request, kExampleKey,
                         "us-east-1", ExampleTime(), absl::Seconds(86400)),
            "https://examplebucket.s3.amazonaws.com/test.txt?X-Amz-Algorithm=AWS4-HMAC-SHA256"
            "&X-Amz-Credential=AKIAIOSFODNN7EXAMPLE%2F20130524%2Fus-east-1%2Fs3%2Faws4_request"
            "&X-Amz-Date=20130524T000000Z&X-Amz-Expires=86400&X-Amz-SignedHeaders=host"
            "&X-Amz-Signature="
            "aeeed9bbccd4d02ee5c0109b86d86835f995330da4c265957d157751f604d404");
}

TEST(SigV4Test, AUrlOfTemporaryKeysSaysTheirToken) {
  S3Credentials temporary = kExampleKey;
  temporary.session_token = "a+token/";
  const SignedRequest request{"PUT", "/b/k", {}, {{"host", "127.0.0.1:9000"}}, "UNSIGNED-PAYLOAD"};
  const std::string url = PresignedUrl("http://127.0.0.1:9000", request, temporary, "eu",
                                       ExampleTime(), absl::Seconds(60));
  EXPECT_NE(url.find("&X-Amz-Security-Token=a%2Btoken%2F&"), std::string::npos) << url;
  EXPECT_EQ(url.find(kExampleKey.secret_access_key), std::string::npos);
}

TEST(SigV4Test, EncodesAllButTheUnreserved) {
  EXPECT_EQ(UriEncode("a b/ä~", true), "a%20b/%C3%A4~");
  EXPECT_EQ(UriEncode("a/b", false), "a%2Fb");
}

}  // namespace
}  // namespace sheaf
