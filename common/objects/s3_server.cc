// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// S3Server: calls with their signatures, repetitions and errors in words.
#include <algorithm>
#include <utility>

#include "absl/random/random.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "common/base/printable.h"
#include "common/objects/s3_objects.h"
#include "common/objects/s3_xml.h"

namespace sheaf {
namespace {

// A server's words in ours.
constexpr size_t kServerWordsMax = 300;

bool IsTransient(const HttpResponse& response) {
  switch (response.status) {
    case 408:
    case 429:
    case 500:
    case 502:
    case 503:
    case 504:
      return true;
    case 400:  // The body came too slowly.
      return ParseS3Error(response.body).code == "RequestTimeout";
    case 409:  // Another request for the same key is in progress.
      return ParseS3Error(response.body).code == "ConditionalRequestConflict" ||
             ParseS3Error(response.body).code == "OperationAborted";
    default:
      return false;
  }
}

bool IsFull(const HttpResponse& response, const S3Error& error) {
  for (const char* code : {"InsufficientStorage", "XMinioStorageFull", "QuotaExceeded",
                           "XMinioAdminBucketQuotaExceeded", "EntityTooLarge", "NotEnoughSpace"}) {
    if (error.code == code) return true;
  }
  return response.status == 507 || response.status == 413 ||
         (response.status >= 400 && absl::StrContains(response.body, "No space left"));
}

bool IsOneOf(int status, const std::vector<int>& statuses) {
  return std::find(statuses.begin(), statuses.end(), status) != statuses.end();
}

// Advice to users about a refusal.
std::string Remedy(const std::string& code, const S3Options& options) {
  const std::string key = Printable(options.credentials.access_key_id);
  if (code == "SignatureDoesNotMatch") {
    return absl::StrCat("the secret of key ", key, " is another one, or the region is not ",
                        options.region, "; check AWS_SECRET_ACCESS_KEY and AWS_REGION");
  }
  if (code == "InvalidAccessKeyId") {
    return absl::StrCat("the server does not know key ", key, "; check AWS_ACCESS_KEY_ID");
  }
  if (code == "RequestTimeTooSkewed") {
    return "the clocks of this machine and of the server differ; set them by NTP";
  }
  if (code == "ExpiredToken" || code == "TokenRefreshRequired") {
    return absl::StrCat("key ", key, " has expired; start again with a new one");
  }
  return absl::StrCat("key ", key,
                      " may not do this; give it the rights to list the bucket and to "
                      "read, write and delete below s3://",
                      options.bucket, "/", options.prefix);
}

absl::Duration WaitBefore(int attempt, const HttpResponse* response) {
  static thread_local absl::InsecureBitGen random;
  absl::Duration wait = std::min(kS3BackoffMax, kS3BackoffInitial * (1 << std::min(attempt, 10)));
  wait *= absl::Uniform(random, 0.5, 1.0);
  if (response == nullptr) return wait;
  const auto asked = response->headers.find("retry-after");
  int seconds = 0;
  if (asked != response->headers.end() && absl::SimpleAtoi(asked->second, &seconds)) {
    wait = std::clamp(absl::Seconds(seconds), wait, kS3BackoffMax);
  }
  return wait;
}

std::string PathIn(const S3Options& options, const std::string& key) {
  return absl::StrCat("/", options.bucket, key.empty() ? "" : "/", key);
}

}  // namespace

S3Server::S3Server(S3Options options)
    : options_(std::move(options)),
      signing_{options_.credentials, options_.region},
      http_(options_.ca_file) {}

std::string S3Server::Describe(const Call& call) const {
  return absl::StrCat("s3://", options_.bucket, call.key.empty() ? "" : "/", call.key, " at ",
                      options_.endpoint, ": ", call.method);
}

absl::Status S3Server::ErrorOf(const Call& call, const HttpResponse& response) const {
  const S3Error error = ParseS3Error(response.body);
  const std::string text = absl::StrCat(
      Describe(call), ": ", response.status, error.code.empty() ? "" : " ", Printable(error.code),
      error.message.empty() ? "" : ": ", Printable(error.message.substr(0, kServerWordsMax)));
  if (IsFull(response, error)) {
    return absl::ResourceExhaustedError(text + "; the server has no room left: free some there");
  }
  if (error.code == "NoSuchBucket") {
    return absl::FailedPreconditionError(text + "; make the bucket, or name another one");
  }
  if (response.status == 404) return absl::NotFoundError(text);
  if (response.status == 401 || response.status == 403) {
    return absl::PermissionDeniedError(absl::StrCat(text, "; ", Remedy(error.code, options_)));
  }
  const auto region = response.headers.find("x-amz-bucket-region");
  if (response.status >= 300 && response.status < 400) {
    return absl::FailedPreconditionError(absl::StrCat(
        text, "; the bucket is served elsewhere",
        region == response.headers.end() ? "" : ", in region " + Printable(region->second),
        ": set AWS_REGION and AWS_ENDPOINT_URL"));
  }
  return absl::UnavailableError(absl::StrCat(
      text, IsTransient(response) ? absl::StrCat("; ", kS3AttemptsMax, " attempts") : ""));
}

absl::StatusOr<HttpResponse> S3Server::Send(const Call& call) {
  HttpRequest request;
  request.method = call.method;
  request.url = absl::StrCat(options_.endpoint, UriEncode(PathIn(options_, call.key), true),
                             call.query.empty() ? "" : "?", EncodeQuery(call.query));
  request.headers = call.headers;
  request.headers.emplace_back("x-amz-content-sha256", Sha256Hex(call.body));
  if (!options_.credentials.session_token.empty()) {
    request.headers.emplace_back("x-amz-security-token", options_.credentials.session_token);
  }
  request.body = call.body;
  request.response_bytes_max = call.response_bytes_max;
  absl::Status last;
  for (int attempt = 0; attempt < kS3AttemptsMax; ++attempt) {
    ++requests_;
    if (attempt > 0) ++retries_;
    absl::StatusOr<HttpResponse> response = http_.Send(request, &signing_);
    const bool came = response.ok();
    if (came) {
      sent_bytes_ += call.body.size();
      received_bytes_ += response->body.size();
      const bool is_understood = (response->status >= 200 && response->status < 300) ||
                                 IsOneOf(response->status, call.other_statuses);
      if (is_understood) return response;
      last = ErrorOf(call, *response);
      if (!IsTransient(*response) || absl::IsResourceExhausted(last)) break;
    } else {
      last = absl::Status(response.status().code(),
                          absl::StrCat(Describe(call), ": ", response.status().message()));
      if (!absl::IsUnavailable(last)) break;
    }
    if (attempt + 1 < kS3AttemptsMax) {
      absl::SleepFor(WaitBefore(attempt, came ? &*response : nullptr));
    }
  }
  if (!absl::IsNotFound(last)) ++failures_;
  return last;
}

ObjectCounts S3Server::Counts() const {
  return {requests_, retries_, failures_, sent_bytes_, received_bytes_};
}

PutTicket S3Server::TicketToPut(const std::string& key, const FileDigest& digest) const {
  const absl::string_view endpoint = options_.endpoint;
  const std::string host(endpoint.substr(endpoint.find("://") + 3));
  PutTicket ticket;
  // The server compares the bytes with this digest where it knows the header.
  ticket.headers = {{"x-amz-checksum-sha256", absl::Base64Escape(BytesOfHex(digest.sha256_hex))}};
  SignedRequest request{"PUT", PathIn(options_, key), {}, {{"host", host}}, "UNSIGNED-PAYLOAD"};
  request.headers["content-length"] = absl::StrCat(digest.size_bytes);
  for (const auto& [name, value] : ticket.headers) request.headers[name] = value;
  ticket.url = PresignedUrl(options_.endpoint, request, options_.credentials, options_.region,
                            absl::Now(), kS3TicketLifetime);
  return ticket;
}

}  // namespace sheaf
