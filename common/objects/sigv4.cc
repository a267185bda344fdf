// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/sigv4.h"

#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "common/base/digest.h"
#include "common/base/secret.h"

namespace sheaf {
namespace {

constexpr char kAlgorithm[] = "AWS4-HMAC-SHA256";

bool IsUnreserved(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
         c == '.' || c == '_' || c == '~';
}

std::string CanonicalRequest(const SignedRequest& request) {
  std::string headers;
  for (const auto& [name, value] : request.headers) {
    absl::StrAppend(&headers, name, ":", absl::StripAsciiWhitespace(value), "\n");
  }
  return absl::StrJoin(
      {request.method, UriEncode(request.path, /*keep_slash=*/true), EncodeQuery(request.query),
       headers, SignedHeaderNames(request.headers), request.payload_hash},
      "\n");
}

std::string SigningKey(const std::string& secret, const std::string& region, absl::Time time) {
  const std::string day = absl::FormatTime("%Y%m%d", time, absl::UTCTimeZone());
  const std::string of_day = HmacSha256("AWS4" + secret, day);
  return HmacSha256(HmacSha256(HmacSha256(of_day, region), "s3"), "aws4_request");
}

}  // namespace

std::string UriEncode(std::string_view text, bool keep_slash) {
  std::string encoded;
  for (const char c : text) {
    if (IsUnreserved(c) || (c == '/' && keep_slash)) {
      encoded.push_back(c);
    } else {
      absl::StrAppendFormat(&encoded, "%%%02X", static_cast<unsigned>(static_cast<uint8_t>(c)));
    }
  }
  return encoded;
}

std::string EncodeQuery(const std::map<std::string, std::string>& query) {
  std::vector<std::string> pairs;
  for (const auto& [name, value] : query) {
    pairs.push_back(absl::StrCat(UriEncode(name, false), "=", UriEncode(value, false)));
  }
  return absl::StrJoin(pairs, "&");
}

std::string SignedHeaderNames(const std::map<std::string, std::string>& headers) {
  return absl::StrJoin(headers, ";", [](std::string* out, const auto& header) {
    absl::StrAppend(out, header.first);
  });
}

std::string SigningTime(absl::Time time) {
  return absl::FormatTime("%Y%m%dT%H%M%SZ", time, absl::UTCTimeZone());
}

std::string SigningScope(absl::Time time, const std::string& region) {
  return absl::StrCat(absl::FormatTime("%Y%m%d", time, absl::UTCTimeZone()), "/", region,
                      "/s3/aws4_request");
}

std::string SignatureOf(const SignedRequest& request, const S3Credentials& credentials,
                        const std::string& region, absl::Time time) {
  const std::string to_sign =
      absl::StrJoin({std::string(kAlgorithm), SigningTime(time), SigningScope(time, region),
                     Sha256Hex(CanonicalRequest(request))},
                    "\n");
  return absl::BytesToHexString(
      HmacSha256(SigningKey(credentials.secret_access_key, region, time), to_sign));
}

std::string PresignedUrl(const std::string& origin, SignedRequest request,
                         const S3Credentials& credentials, const std::string& region,
                         absl::Time time, absl::Duration lifetime) {
  request.query["X-Amz-Algorithm"] = kAlgorithm;
  request.query["X-Amz-Credential"] =
      absl::StrCat(credentials.access_key_id, "/", SigningScope(time, region));
  request.query["X-Amz-Date"] = SigningTime(time);
  request.query["X-Amz-Expires"] = absl::StrCat(absl::ToInt64Seconds(lifetime));
  request.query["X-Amz-SignedHeaders"] = SignedHeaderNames(request.headers);
  if (!credentials.session_token.empty()) {
    request.query["X-Amz-Security-Token"] = credentials.session_token;
  }
  const std::string signature = SignatureOf(request, credentials, region, time);
  return absl::StrCat(origin, UriEncode(request.path, true), "?", EncodeQuery(request.query),
                      "&X-Amz-Signature=", signature);
}

}  // namespace sheaf
