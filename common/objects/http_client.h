// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpClient: single requests over HTTP or HTTPS, each within limits of time and size. The door to
// libcurl.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/objects/sigv4.h"

namespace sheaf {

inline constexpr absl::Duration kHttpConnectTimeMax = absl::Seconds(5);
// A request without progress for this long has failed.
inline constexpr absl::Duration kHttpStallTimeMax = absl::Seconds(15);
inline constexpr absl::Duration kHttpRequestTimeMax = absl::Minutes(10);
// Connections that wait for the next request.
inline constexpr size_t kIdleConnectionsMax = 64;
// Limit of headers, and of the bodies of errors.
inline constexpr uint64_t kHttpErrorBytesMax = uint64_t{64} << 10;

struct HttpRequest {
  std::string method = "GET";
  // Without "." and ".." in its path: libcurl removes them, and since 8.14 it signs no path that it
  // is told to leave as it is.
  std::string url;
  std::vector<std::pair<std::string, std::string>> headers;
  std::string_view body;            // For PUT and POST.
  uint64_t response_bytes_max = 0;  // A longer body is an error.
  // Once it is true, the request ends within a second, as a broken one.
  const std::atomic<bool>* is_cancelled = nullptr;
};

struct HttpResponse {
  int status = 0;
  std::map<std::string, std::string> headers;  // By names in lower case.
  std::string body;
};

// With what requests are signed (Signature Version 4, by libcurl).
struct HttpSigning {
  S3Credentials credentials;
  std::string region;
};

// Thread safety: all members may be called concurrently.
class HttpClient {
 public:
  // ca_file: the certificates that are trusted, instead of the system's; empty: the system's.
  explicit HttpClient(std::string ca_file);
  ~HttpClient();
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;

  // One attempt. OK means that a whole response came, of any status: its length is the one that the
  // server announced. signing: null where the request is not signed, or in its URL. A signed
  // request has its query in the order of names, encoded, and the header x-amz-content-sha256.
  // Errors: kUnavailable (no connection, it broke off, or nothing came in time); kPermissionDenied
  // (the server's certificate is not trusted); kResourceExhausted (a longer body than allowed).
  absl::StatusOr<HttpResponse> Send(const HttpRequest& request, const HttpSigning* signing);

 private:
  struct Connection;
  std::unique_ptr<Connection> Take();
  void GiveBack(std::unique_ptr<Connection> connection);

  const std::string ca_file_;
  Mutex mutex_;
  std::vector<std::unique_ptr<Connection>> idle_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf
