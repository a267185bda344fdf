// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// S3TestServer: a small server that speaks S3 on loopback, for tests. It keeps objects in memory,
// checks the signature of each request against the key that it knows, and causes the faults that it
// is told to.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/objects/s3_options.h"

namespace sheaf {

class S3TestServer {
 public:
  enum class FaultKind { kStatus, kReset, kTruncate, kOtherBytes, kResetAfterwards };
  // A fault of the next request of a method, instead of or in its answer.
  struct Fault {
    std::string method;  // "GET"; empty: any.
    FaultKind kind = FaultKind::kStatus;
    int status = 500;
    std::string code = "InternalError";
    absl::Duration delay = absl::ZeroDuration();  // Before anything is answered.
  };

  S3TestServer();
  ~S3TestServer();

  // Options of the bucket "farm" on this server, with its key.
  S3Options Options(const std::string& prefix = "p") const;
  std::string Endpoint() const;

  void Cause(const Fault& fault, int count = 1);
  // Answers with 501 to conditional requests, as older servers do.
  void ForgetConditions() { Set(&knows_conditions_, false); }
  void SetPageObjectsMax(size_t count) { Set(&page_objects_max_, count); }
  void SetClockAhead(absl::Duration ahead) { Set(&clock_ahead_, ahead); }

  std::map<std::string, std::string> objects() const;  // By whole key.
  void PutDirectly(const std::string& key, const std::string& bytes);
  int request_count() const;
  int upload_count() const;  // Multipart uploads that are neither complete nor aborted.

 private:
  struct Request {
    std::string method, path;  // Decoded.
    std::map<std::string, std::string> query, headers;
    std::string body;
  };
  struct Response {
    int status = 200;
    std::string body;
    std::map<std::string, std::string> headers = {};
  };

  template <typename T>
  void Set(T* member, T value) {
    const MutexLock lock(&mutex_);
    *member = value;
  }
  void Accept();
  void Serve(int fd);
  static bool Read(int fd, std::string* buffer, Request* request);
  Response Answer(const Request& request) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Response Put(const Request& request, const std::string& key)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Response Get(const Request& request, const std::string& key)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Response Post(const Request& request, const std::string& key)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Response List(const Request& request) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The code of the error; empty: the signature is good.
  std::string WhyNotSigned(const Request& request) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static Response Error(int status, const std::string& code);

  int listening_ = -1;
  uint16_t port_ = 0;
  mutable Mutex mutex_;
  std::map<std::string, std::string> objects_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, std::map<int, std::string>> uploads_ ABSL_GUARDED_BY(mutex_);
  std::deque<Fault> faults_ ABSL_GUARDED_BY(mutex_);
  std::vector<int> connections_ ABSL_GUARDED_BY(mutex_);
  int request_count_ ABSL_GUARDED_BY(mutex_) = 0;
  int next_upload_ ABSL_GUARDED_BY(mutex_) = 1;
  bool knows_conditions_ ABSL_GUARDED_BY(mutex_) = true;
  size_t page_objects_max_ ABSL_GUARDED_BY(mutex_) = 1000;
  absl::Duration clock_ahead_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_ ABSL_GUARDED_BY(mutex_);
  std::thread accepting_;
};

}  // namespace sheaf
