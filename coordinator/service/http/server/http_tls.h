// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpTls: the TLS context of the HTTP port, which follows a renewed certificate. Internal to
// http_server.cc.
#pragma once

#include <utility>  // Before asio of Boost 1.74, which uses std::exchange unasked.

#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <filesystem>
#include <memory>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/tls/credential_store.h"
#include "coordinator/service/http/server/http_server.h"

namespace sheaf::coordinator {

// Thread safety: one thread at a time.
class HttpTls {
 public:
  explicit HttpTls(CredentialFiles files) : files_(std::move(files)) {}

  // Reads key and certificate. Errors: kUnavailable; an earlier context stays.
  absl::Status Load() {
    namespace ssl = boost::asio::ssl;
    auto context = std::make_unique<ssl::context>(ssl::context::tls_server);
    boost::system::error_code error;
    context->set_options(ssl::context::default_workarounds | ssl::context::no_sslv2 |
                             ssl::context::no_sslv3 | ssl::context::no_tlsv1 |
                             ssl::context::no_tlsv1_1,
                         error);
    std::error_code unknown;
    loaded_time_ = std::filesystem::last_write_time(files_.certificate_path, unknown);
    if (!error) context->use_certificate_chain_file(files_.certificate_path, error);
    if (!error) context->use_private_key_file(files_.key_path, ssl::context::pem, error);
    if (error) {
      return absl::UnavailableError(
          absl::StrCat(files_.certificate_path, ": cannot serve HTTPS: ", error.message()));
    }
    context_ = std::move(context);
    return absl::OkStatus();
  }

  // For a new connection. Connections keep the context with which they began. Requires: Load() was
  // OK once.
  boost::asio::ssl::context* context() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_look_) return context_.get();
    next_look_ = now + kHttpCertificateInterval;
    std::error_code unknown;
    if (std::filesystem::last_write_time(files_.certificate_path, unknown) != loaded_time_) {
      if (absl::Status status = Load(); !status.ok()) LogWarning(std::string(status.message()));
    }
    return context_.get();
  }

 private:
  const CredentialFiles files_;
  std::unique_ptr<boost::asio::ssl::context> context_;
  std::filesystem::file_time_type loaded_time_;
  std::chrono::steady_clock::time_point next_look_;
};

}  // namespace sheaf::coordinator
