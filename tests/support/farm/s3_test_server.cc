// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/farm/s3_test_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"

namespace sheaf {
namespace {

constexpr char kBucket[] = "farm";
constexpr char kRegion[] = "eu-test-1";
const S3Credentials kKey{"TESTKEY", "test+secret/key", ""};
constexpr absl::Duration kClockDifferenceMax = absl::Minutes(15);

std::string Decode(absl::string_view text) {
  std::string decoded;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded.push_back(text[i]);
      continue;
    }
    decoded.push_back(
        static_cast<char>(std::strtol(std::string(text.substr(i + 1, 2)).c_str(), nullptr, 16)));
    i += 2;
  }
  return decoded;
}

bool WriteAll(int fd, absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(n));
  }
  return true;
}

void Reset(int fd) {
  const linger at_once{1, 0};
  ::setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
}

std::string ValueOf(const std::map<std::string, std::string>& values, const std::string& name) {
  const auto found = values.find(name);
  return found == values.end() ? "" : found->second;
}

std::string Base64Sha256(const std::string& bytes) {
  return absl::Base64Escape(BytesOfHex(Sha256Hex(bytes)));
}

}  // namespace

S3TestServer::S3TestServer() {
  listening_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  SHEAF_CHECK(listening_ >= 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const raw = reinterpret_cast<sockaddr*>(&address);
  SHEAF_CHECK(::bind(listening_, raw, size) == 0 && ::listen(listening_, 64) == 0);
  SHEAF_CHECK(::getsockname(listening_, raw, &size) == 0);
  port_ = ntohs(address.sin_port);
  accepting_ = std::thread([this] { Accept(); });
}

S3TestServer::~S3TestServer() {
  std::vector<std::thread> threads;
  {
    const MutexLock lock(&mutex_);
    stopping_ = true;
    for (const int fd : connections_) ::shutdown(fd, SHUT_RDWR);
  }
  ::shutdown(listening_, SHUT_RDWR);
  accepting_.join();
  {
    const MutexLock lock(&mutex_);
    for (const int fd : connections_) ::shutdown(fd, SHUT_RDWR);
    threads = std::move(threads_);
  }
  for (std::thread& thread : threads) thread.join();
  ::close(listening_);
}

std::string S3TestServer::Endpoint() const { return absl::StrCat("http://127.0.0.1:", port_); }

S3Options S3TestServer::Options(const std::string& prefix) const {
  return {Endpoint(), kRegion, kBucket, prefix, /*ca_file=*/"", kKey};
}

void S3TestServer::Cause(const Fault& fault, int count) {
  const MutexLock lock(&mutex_);
  for (int i = 0; i < count; ++i) faults_.push_back(fault);
}

std::map<std::string, std::string> S3TestServer::objects() const {
  const MutexLock lock(&mutex_);
  return objects_;
}

void S3TestServer::PutDirectly(const std::string& key, const std::string& bytes) {
  const MutexLock lock(&mutex_);
  objects_[key] = bytes;
}

int S3TestServer::request_count() const {
  const MutexLock lock(&mutex_);
  return request_count_;
}

int S3TestServer::upload_count() const {
  const MutexLock lock(&mutex_);
  return static_cast<int>(uploads_.size());
}

void S3TestServer::Accept() {
  while (true) {
    const int fd = ::accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC);
    const MutexLock lock(&mutex_);
    if (fd < 0 || stopping_) {
      if (fd >= 0) ::close(fd);
      return;
    }
    connections_.push_back(fd);
    threads_.emplace_back([this, fd] { Serve(fd); });
  }
}

bool S3TestServer::Read(int fd, std::string* buffer, Request* request) {
  const auto receive = [fd, buffer] {
    char bytes[1 << 16];
    const ssize_t n = ::recv(fd, bytes, sizeof bytes, 0);
    if (n > 0) buffer->append(bytes, static_cast<size_t>(n));
    return n > 0;
  };
  size_t end = 0;
  while ((end = buffer->find("\r\n\r\n")) == std::string::npos) {
    if (!receive()) return false;
  }
  const std::vector<std::string> lines = absl::StrSplit(buffer->substr(0, end), "\r\n");
  const std::vector<std::string> first = absl::StrSplit(lines[0], ' ');
  const std::pair<std::string, std::string> target =
      absl::StrSplit(first[1], absl::MaxSplits('?', 1));
  request->method = first[0];
  request->path = Decode(target.first);
  for (const absl::string_view pair : absl::StrSplit(target.second, '&', absl::SkipEmpty())) {
    const std::pair<std::string, std::string> value = absl::StrSplit(pair, absl::MaxSplits('=', 1));
    request->query[Decode(value.first)] = Decode(value.second);
  }
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::pair<std::string, std::string> header =
        absl::StrSplit(lines[i], absl::MaxSplits(':', 1));
    request->headers[absl::AsciiStrToLower(header.first)] =
        std::string(absl::StripAsciiWhitespace(header.second));
  }
  size_t length = 0;
  (void)absl::SimpleAtoi(ValueOf(request->headers, "content-length"), &length);
  buffer->erase(0, end + 4);
  while (buffer->size() < length) {
    if (!receive()) return false;
  }
  request->body = buffer->substr(0, length);
  buffer->erase(0, length);
  return true;
}

void S3TestServer::Serve(int fd) {
  std::string buffer;
  Request request;
  while (Read(fd, &buffer, &request)) {
    std::optional<Fault> fault;
    Response response;
    {
      const MutexLock lock(&mutex_);
      ++request_count_;
      const auto of_method = [&request](const Fault& f) {
        return f.method.empty() || f.method == request.method;
      };
      const auto found = std::find_if(faults_.begin(), faults_.end(), of_method);
      if (found != faults_.end()) {
        fault = *found;
        faults_.erase(found);
      }
      const bool is_answered =
          !fault || (fault->kind != FaultKind::kStatus && fault->kind != FaultKind::kReset);
      if (is_answered) response = Answer(request);
    }
    if (fault) absl::SleepFor(fault->delay);
    if (fault && fault->kind == FaultKind::kStatus) response = Error(fault->status, fault->code);
    if (fault && (fault->kind == FaultKind::kReset || fault->kind == FaultKind::kResetAfterwards)) {
      Reset(fd);
      break;
    }
    const bool is_head = request.method == "HEAD";
    std::string body = response.body;
    if (fault && fault->kind == FaultKind::kOtherBytes && !body.empty()) body[body.size() / 2] ^= 1;
    std::string text = absl::StrCat("HTTP/1.1 ", response.status, " Status\r\n");
    for (const auto& [name, value] : response.headers) {
      absl::StrAppend(&text, name, ": ", value, "\r\n");
    }
    absl::StrAppend(&text, "content-length: ", body.size(), "\r\n\r\n");
    if (fault && fault->kind == FaultKind::kTruncate) {
      WriteAll(fd, text + body.substr(0, body.size() / 2));
      break;
    }
    if (!WriteAll(fd, is_head ? text : text + body)) break;
    request = {};
  }
  const MutexLock lock(&mutex_);
  std::erase(connections_, fd);
  ::close(fd);
}

S3TestServer::Response S3TestServer::Error(int status, const std::string& code) {
  return {status, absl::StrCat("<?xml version=\"1.0\"?><Error><Code>", code,
                               "</Code><Message>as the test wants</Message></Error>")};
}

std::string S3TestServer::WhyNotSigned(const Request& request) const {
  SignedRequest to_sign{request.method, request.path, request.query, {}, ""};
  std::string credential, names, signature, time_text;
  const bool by_query = request.query.contains("X-Amz-Signature");
  if (by_query) {
    credential = ValueOf(request.query, "X-Amz-Credential");
    names = ValueOf(request.query, "X-Amz-SignedHeaders");
    signature = ValueOf(request.query, "X-Amz-Signature");
    time_text = ValueOf(request.query, "X-Amz-Date");
    to_sign.query.erase("X-Amz-Signature");
    to_sign.payload_hash = "UNSIGNED-PAYLOAD";
  } else {
    const std::string authorization = ValueOf(request.headers, "authorization");
    if (!absl::StartsWith(authorization, "AWS4-HMAC-SHA256 ")) return "AccessDenied";
    for (absl::string_view part : absl::StrSplit(authorization.substr(17), ',')) {
      part = absl::StripAsciiWhitespace(part);
      if (absl::ConsumePrefix(&part, "Credential=")) credential = std::string(part);
      if (absl::ConsumePrefix(&part, "SignedHeaders=")) names = std::string(part);
      if (absl::ConsumePrefix(&part, "Signature=")) signature = std::string(part);
    }
    time_text = ValueOf(request.headers, "x-amz-date");
    to_sign.payload_hash = ValueOf(request.headers, "x-amz-content-sha256");
    if (to_sign.payload_hash != Sha256Hex(request.body)) return "XAmzContentSHA256Mismatch";
  }
  absl::Time time;
  std::string error;
  if (!absl::ParseTime("%E4Y%m%dT%H%M%SZ", time_text, absl::UTCTimeZone(), &time, &error)) {
    return "AccessDenied";
  }
  const absl::Time now = absl::Now() + clock_ahead_;
  if (credential != absl::StrCat(kKey.access_key_id, "/", SigningScope(time, kRegion))) {
    return "InvalidAccessKeyId";
  }
  for (const absl::string_view name : absl::StrSplit(names, ';')) {
    to_sign.headers[std::string(name)] = ValueOf(request.headers, std::string(name));
  }
  if (!to_sign.headers.contains("host")) return "AccessDenied";
  if (SignatureOf(to_sign, kKey, kRegion, time) != signature) return "SignatureDoesNotMatch";
  int64_t lifetime = 0;
  (void)absl::SimpleAtoi(ValueOf(request.query, "X-Amz-Expires"), &lifetime);
  if (by_query && now > time + absl::Seconds(lifetime)) return "AccessDenied";
  if (!by_query && absl::AbsDuration(now - time) > kClockDifferenceMax) {
    return "RequestTimeTooSkewed";
  }
  return "";
}

S3TestServer::Response S3TestServer::Answer(const Request& request) {
  const std::string why = WhyNotSigned(request);
  if (!why.empty()) return Error(why == "XAmzContentSHA256Mismatch" ? 400 : 403, why);
  const std::string checksum = ValueOf(request.headers, "x-amz-checksum-sha256");
  if (!checksum.empty() && checksum != Base64Sha256(request.body)) return Error(400, "BadDigest");
  absl::string_view key = request.path;
  if (!absl::ConsumePrefix(&key, absl::StrCat("/", kBucket))) return Error(404, "NoSuchBucket");
  absl::ConsumePrefix(&key, "/");
  if (request.method == "PUT") return Put(request, std::string(key));
  if (request.method == "POST") return Post(request, std::string(key));
  if (request.method == "DELETE") {
    uploads_.erase(ValueOf(request.query, "uploadId"));
    if (request.query.empty()) objects_.erase(std::string(key));
    return {204, ""};
  }
  return key.empty() ? List(request) : Get(request, std::string(key));
}

S3TestServer::Response S3TestServer::Put(const Request& request, const std::string& key) {
  const std::string etag = absl::StrCat("\"", Sha256Hex(request.body).substr(0, 32), "\"");
  if (request.query.contains("uploadId")) {
    const auto upload = uploads_.find(request.query.at("uploadId"));
    if (upload == uploads_.end()) return Error(404, "NoSuchUpload");
    upload->second[std::atoi(ValueOf(request.query, "partNumber").c_str())] = request.body;
    return {200, "", {{"ETag", etag}}};
  }
  if (request.headers.contains("if-none-match")) {
    if (!knows_conditions_) return Error(501, "NotImplemented");
    if (objects_.contains(key)) return Error(412, "PreconditionFailed");
  }
  objects_[key] = request.body;
  return {200, "", {{"ETag", etag}}};
}

S3TestServer::Response S3TestServer::Get(const Request& request, const std::string& key) {
  const auto object = objects_.find(key);
  if (object == objects_.end()) return Error(404, "NoSuchKey");
  const std::string range = ValueOf(request.headers, "range");
  if (range.empty()) return {200, object->second};
  const std::pair<std::string, std::string> ends = absl::StrSplit(range.substr(6), '-');
  const size_t begin = std::strtoull(ends.first.c_str(), nullptr, 10);
  const size_t last = std::strtoull(ends.second.c_str(), nullptr, 10);
  if (begin >= object->second.size()) return Error(416, "InvalidRange");
  return {206, object->second.substr(begin, last - begin + 1)};
}

S3TestServer::Response S3TestServer::Post(const Request& request, const std::string& key) {
  if (request.query.contains("uploads")) {
    const std::string id = absl::StrCat("upload-", next_upload_++);
    uploads_[id];
    return {200, absl::StrCat("<InitiateMultipartUploadResult><UploadId>", id,
                              "</UploadId></InitiateMultipartUploadResult>")};
  }
  if (request.query.contains("uploadId")) {
    const auto upload = uploads_.find(request.query.at("uploadId"));
    if (upload == uploads_.end()) return Error(404, "NoSuchUpload");
    std::string bytes;
    for (const auto& [number, piece] : upload->second) bytes += piece;
    objects_[key] = bytes;
    uploads_.erase(upload);
    return {200, "<CompleteMultipartUploadResult/>"};
  }
  if (!request.query.contains("delete")) return Error(400, "InvalidRequest");
  for (const absl::string_view part : absl::StrSplit(request.body, "<Key>")) {
    const size_t end = part.find("</Key>");
    if (end != absl::string_view::npos) objects_.erase(std::string(part.substr(0, end)));
  }
  return {200, "<DeleteResult/>"};
}

S3TestServer::Response S3TestServer::List(const Request& request) {
  const std::string prefix = ValueOf(request.query, "prefix");
  const std::string after = ValueOf(request.query, "continuation-token");
  const bool delimited = request.query.contains("delimiter");
  std::set<std::string> folders;
  std::string contents, last;
  size_t count = 0;
  bool is_truncated = false;
  for (const auto& [key, bytes] : objects_) {
    if (!absl::StartsWith(key, prefix) || (!after.empty() && key <= after)) continue;
    if (count >= page_objects_max_) {
      is_truncated = true;
      break;
    }
    const size_t slash = key.find('/', prefix.size());
    last = key;
    ++count;
    if (delimited && slash != std::string::npos) {
      folders.insert(key.substr(0, slash + 1));
      continue;
    }
    absl::StrAppend(&contents, "<Contents><Key>", key, "</Key><LastModified>",
                    "2024-05-24T10:00:00.000Z</LastModified><Size>", bytes.size(),
                    "</Size></Contents>");
  }
  for (const std::string& folder : folders) {
    absl::StrAppend(&contents, "<CommonPrefixes><Prefix>", folder, "</Prefix></CommonPrefixes>");
  }
  return {200, absl::StrCat("<?xml version=\"1.0\"?><ListBucketResult>", contents, "<IsTruncated>",
                            is_truncated ? "true" : "false", "</IsTruncated>",
                            is_truncated ? absl::StrCat("<NextContinuationToken>", last,
                                                        "</NextContinuationToken>")
                                         : "",
                            "</ListBucketResult>")};
}

}  // namespace sheaf
