// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/http_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

constexpr size_t kHeadersMax = 100;
// How long a large body waits for a server that does not know "Expect: 100-continue".
constexpr absl::Duration kExpectTimeMax = absl::Milliseconds(200);

struct FreeList {
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};
using HeaderList = std::unique_ptr<curl_slist, FreeList>;

// The data that a request sends and receives while libcurl works on it.
struct Transfer {
  std::string_view body;
  size_t sent = 0;
  HttpResponse response;
  uint64_t response_bytes_max = 0;
  bool is_too_long = false;
};

size_t ReadBody(char* buffer, size_t size, size_t count, void* user) {
  auto* const transfer = static_cast<Transfer*>(user);
  const size_t n = std::min(size * count, transfer->body.size() - transfer->sent);
  std::memcpy(buffer, transfer->body.data() + transfer->sent, n);
  transfer->sent += n;
  return n;
}

// libcurl sends a body again where a kept connection turns out to be closed.
int SeekBody(void* user, curl_off_t offset, int origin) {
  auto* const transfer = static_cast<Transfer*>(user);
  if (origin != SEEK_SET || offset < 0 || static_cast<size_t>(offset) > transfer->body.size()) {
    return CURL_SEEKFUNC_CANTSEEK;
  }
  transfer->sent = static_cast<size_t>(offset);
  return CURL_SEEKFUNC_OK;
}

size_t WriteResponse(char* bytes, size_t size, size_t count, void* user) {
  auto* const transfer = static_cast<Transfer*>(user);
  const size_t n = size * count;
  const uint64_t limit = std::max(transfer->response_bytes_max, kHttpErrorBytesMax);
  if (transfer->response.body.size() + n > limit) {
    transfer->is_too_long = true;
    return 0;
  }
  transfer->response.body.append(bytes, n);
  return n;
}

size_t WriteHeader(char* bytes, size_t size, size_t count, void* user) {
  auto* const transfer = static_cast<Transfer*>(user);
  const std::string_view line(bytes, size * count);
  const size_t colon = line.find(':');
  if (line.starts_with("HTTP/")) transfer->response.headers.clear();  // After a 100 Continue.
  if (colon != std::string_view::npos && transfer->response.headers.size() < kHeadersMax) {
    const std::string name(line.substr(0, colon)), value(line.substr(colon + 1));
    transfer->response.headers[absl::AsciiStrToLower(name)] =
        std::string(absl::StripAsciiWhitespace(value));
  }
  return line.size();
}

// libcurl calls it once a second at least; not 0 ends the request.
int IsCancelled(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return static_cast<const std::atomic<bool>*>(user)->load() ? 1 : 0;
}

HeaderList HeadersOf(const HttpRequest& request, bool is_signed) {
  HeaderList list;
  const auto add = [&list](const std::string& line) {
    curl_slist* const longer = curl_slist_append(list.get(), line.c_str());
    SHEAF_CHECK(longer != nullptr);
    list.release();
    list.reset(longer);
  };
  for (const auto& [name, value] : request.headers) add(absl::StrCat(name, ": ", value));
  // libcurl 7.88 would sign this header, which it does not send.
  if (!is_signed) add("Expect:");
  return list;
}

std::string HostOf(const std::string& url) {
  const size_t scheme = url.find("://");
  const size_t begin = scheme == std::string::npos ? 0 : scheme + 3;
  return url.substr(begin, url.find_first_of("/?", begin) - begin);
}

absl::Status TransportError(CURLcode code, const char* detail, const HttpRequest& request) {
  const std::string text =
      absl::StrCat(HostOf(request.url), ": ", request.method,
                   " failed: ", *detail != '\0' ? detail : curl_easy_strerror(code));
  if (code == CURLE_PEER_FAILED_VERIFICATION || code == CURLE_SSL_CACERT_BADFILE) {
    return absl::PermissionDeniedError(
        text + "; the server's certificate is not trusted: name its authority by AWS_CA_BUNDLE");
  }
  return absl::UnavailableError(text);
}

}  // namespace

struct HttpClient::Connection {
  Connection() : handle(curl_easy_init()) { SHEAF_CHECK(handle != nullptr); }
  ~Connection() { curl_easy_cleanup(handle); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void SetUp(const HttpRequest& request, Transfer* transfer, curl_slist* headers,
             const std::string& ca_file) const;
  void Sign(const HttpSigning& signing) const;

  CURL* const handle;
  char error[CURL_ERROR_SIZE] = "";
};

void HttpClient::Connection::SetUp(const HttpRequest& request, Transfer* transfer,
                                   curl_slist* headers, const std::string& ca_file) const {
  curl_easy_reset(handle);
  curl_easy_setopt(handle, CURLOPT_ERRORBUFFER, error);
  curl_easy_setopt(handle, CURLOPT_URL, request.url.c_str());
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(handle, CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT_MS,
                   static_cast<long>(absl::ToInt64Milliseconds(kHttpConnectTimeMax)));
  curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS,
                   static_cast<long>(absl::ToInt64Milliseconds(kHttpRequestTimeMax)));
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_LIMIT, 1L);
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_TIME,
                   static_cast<long>(absl::ToInt64Seconds(kHttpStallTimeMax)));
  curl_easy_setopt(handle, CURLOPT_EXPECT_100_TIMEOUT_MS,
                   static_cast<long>(absl::ToInt64Milliseconds(kExpectTimeMax)));
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, WriteResponse);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, transfer);
  curl_easy_setopt(handle, CURLOPT_HEADERFUNCTION, WriteHeader);
  curl_easy_setopt(handle, CURLOPT_HEADERDATA, transfer);
  if (!ca_file.empty()) curl_easy_setopt(handle, CURLOPT_CAINFO, ca_file.c_str());
  if (request.is_cancelled != nullptr) {
    curl_easy_setopt(handle, CURLOPT_NOPROGRESS, 0L);
    curl_easy_setopt(handle, CURLOPT_XFERINFOFUNCTION, IsCancelled);
    curl_easy_setopt(handle, CURLOPT_XFERINFODATA, request.is_cancelled);
  }
  if (request.method == "HEAD") {
    curl_easy_setopt(handle, CURLOPT_NOBODY, 1L);
  } else if (request.method == "PUT") {
    curl_easy_setopt(handle, CURLOPT_UPLOAD, 1L);
    curl_easy_setopt(handle, CURLOPT_INFILESIZE_LARGE,
                     static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(handle, CURLOPT_READFUNCTION, ReadBody);
    curl_easy_setopt(handle, CURLOPT_READDATA, transfer);
    curl_easy_setopt(handle, CURLOPT_SEEKFUNCTION, SeekBody);
    curl_easy_setopt(handle, CURLOPT_SEEKDATA, transfer);
  } else if (request.method == "POST") {
    curl_easy_setopt(handle, CURLOPT_POST, 1L);
    curl_easy_setopt(handle, CURLOPT_POSTFIELDS, request.body.data());
    curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE,
                     static_cast<curl_off_t>(request.body.size()));
  } else if (request.method != "GET") {
    curl_easy_setopt(handle, CURLOPT_CUSTOMREQUEST, request.method.c_str());
  }
}

void HttpClient::Connection::Sign(const HttpSigning& signing) const {
  curl_easy_setopt(handle, CURLOPT_AWS_SIGV4,
                   absl::StrCat("aws:amz:", signing.region, ":s3").c_str());
  curl_easy_setopt(handle, CURLOPT_USERNAME, signing.credentials.access_key_id.c_str());
  curl_easy_setopt(handle, CURLOPT_PASSWORD, signing.credentials.secret_access_key.c_str());
}

HttpClient::HttpClient(std::string ca_file) : ca_file_(std::move(ca_file)) {
  static const CURLcode started = curl_global_init(CURL_GLOBAL_DEFAULT);
  SHEAF_CHECK(started == CURLE_OK);
}

HttpClient::~HttpClient() = default;

std::unique_ptr<HttpClient::Connection> HttpClient::Take() {
  const MutexLock lock(&mutex_);
  if (idle_.empty()) return std::make_unique<Connection>();
  std::unique_ptr<Connection> connection = std::move(idle_.back());
  idle_.pop_back();
  return connection;
}

void HttpClient::GiveBack(std::unique_ptr<Connection> connection) {
  const MutexLock lock(&mutex_);
  if (idle_.size() < kIdleConnectionsMax) idle_.push_back(std::move(connection));
}

absl::StatusOr<HttpResponse> HttpClient::Send(const HttpRequest& request,
                                              const HttpSigning* signing) {
  Transfer transfer;
  transfer.body = request.body;
  transfer.response_bytes_max = request.response_bytes_max;
  const HeaderList headers = HeadersOf(request, signing != nullptr);
  std::unique_ptr<Connection> connection = Take();
  connection->error[0] = '\0';
  connection->SetUp(request, &transfer, headers.get(), ca_file_);
  if (signing != nullptr) connection->Sign(*signing);
  const CURLcode code = curl_easy_perform(connection->handle);
  long status = 0;
  curl_easy_getinfo(connection->handle, CURLINFO_RESPONSE_CODE, &status);
  transfer.response.status = static_cast<int>(status);
  if (transfer.is_too_long) {
    return absl::ResourceExhaustedError(absl::StrCat(HostOf(request.url), ": ", request.method,
                                                     ": the answer is longer than ",
                                                     request.response_bytes_max, " bytes"));
  }
  // A connection that failed is not used again.
  if (code != CURLE_OK) return TransportError(code, connection->error, request);
  GiveBack(std::move(connection));
  return std::move(transfer.response);
}

}  // namespace sheaf
