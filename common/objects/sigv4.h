// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Signature Version 4 of requests to S3: the owner of the key proves that a request is their own,
// without sending the key. libcurl signs the requests of this process; this file makes signatures
// that travel in a URL, so that another process may send the request.
// Source: "Authenticating Requests (AWS Signature Version 4)", Amazon S3 API Reference.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "absl/time/time.h"

namespace sheaf {

struct S3Credentials {
  std::string access_key_id;
  std::string secret_access_key;
  std::string session_token;  // For temporary keys; otherwise empty.
};

// The parts of a request that its signature covers.
struct SignedRequest {
  std::string method;                          // "PUT".
  std::string path;                            // "/bucket/key", not encoded.
  std::map<std::string, std::string> query;    // Not encoded; without the signature.
  std::map<std::string, std::string> headers;  // By names in lower case, with "host".
  std::string payload_hash;                    // SHA-256 of the body (hex), or "UNSIGNED-PAYLOAD".
};

// Encodes all bytes but letters, digits and "-._~" as %XX, and "/" unless keep_slash.
std::string UriEncode(std::string_view text, bool keep_slash);
// "a=1&b=2" of encoded names and values, in the order of the names.
std::string EncodeQuery(const std::map<std::string, std::string>& query);
// "content-length;host": the names that are signed.
std::string SignedHeaderNames(const std::map<std::string, std::string>& headers);
// "20130524T000000Z".
std::string SigningTime(absl::Time time);
// "20130524/us-east-1/s3/aws4_request".
std::string SigningScope(absl::Time time, const std::string& region);

// The signature, as 64 hexadecimal digits.
std::string SignatureOf(const SignedRequest& request, const S3Credentials& credentials,
                        const std::string& region, absl::Time time);

// The URL of the request with a signature that is good for the lifetime, whole seconds up to seven
// days. origin: "https://HOST:PORT", whose host is among the headers. The sender sends the headers
// of the request and a body of any bytes that they admit.
std::string PresignedUrl(const std::string& origin, SignedRequest request,
                         const S3Credentials& credentials, const std::string& region,
                         absl::Time time, absl::Duration lifetime);

}  // namespace sheaf
