// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/peer_credentials.h"

#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_metadata_processor.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <functional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/base/printable.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/tls_credentials.h"
#include "common/tls/certificate.h"

namespace sheaf {
namespace {

std::string Text(grpc::string_ref text) { return {text.data(), text.size()}; }

// The client's side: gRPC asks it after each handshake.
class PeerVerifier final : public grpc::experimental::ExternalCertificateVerifier {
 public:
  PeerVerifier(std::string authority_pem, std::string identity)
      : authority_pem_(std::move(authority_pem)), identity_(std::move(identity)) {}

  bool Verify(grpc::experimental::TlsCustomVerificationCheckRequest* request,
              std::function<void(grpc::Status)> /*callback*/, grpc::Status* status) override {
    *status = ToGrpcStatus(VerifyWorkerCertificate(Text(request->peer_cert()), authority_pem_,
                                                   identity_, absl::Now()));
    return true;  // It is done.
  }
  void Cancel(grpc::experimental::TlsCustomVerificationCheckRequest* /*request*/) override {}

 private:
  const std::string authority_pem_, identity_;
};

// The server's side: gRPC asks it before each call.
class PeerGate final : public grpc::AuthMetadataProcessor {
 public:
  explicit PeerGate(std::string authority_pem) : authority_pem_(std::move(authority_pem)) {}

  bool IsBlocking() const override { return false; }
  grpc::Status Process(const InputMetadata& /*metadata*/, grpc::AuthContext* context,
                       OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) override {
    const std::vector<grpc::string_ref> certificates =
        context->FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
    return ToGrpcStatus(
        VerifyWorkerCertificate(certificates.empty() ? "" : Text(certificates.front()),
                                authority_pem_, /*identity=*/"", absl::Now()));
  }

 private:
  const std::string authority_pem_;
};

}  // namespace

absl::Status VerifyWorkerCertificate(const std::string& certificate_pem,
                                     const std::string& authority_pem, const std::string& identity,
                                     absl::Time now) {
  if (certificate_pem.empty()) {
    return absl::UnauthenticatedError("a worker's certificate is needed; none was shown");
  }
  if (certificate_pem.size() > kPemBytesMax) {
    return absl::UnauthenticatedError("the certificate is too long");
  }
  const absl::Status verified =
      VerifyCertificate(certificate_pem, CertificateUse::kClient, authority_pem, now);
  if (!verified.ok()) return absl::UnauthenticatedError(verified.message());
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(certificate_pem);
  if (!terms.ok()) return absl::UnauthenticatedError(terms.status().message());
  const bool fits = identity.empty() ? terms->common_name.starts_with(kWorkerNamePrefix)
                                     : terms->common_name == identity;
  if (fits && terms->common_name.starts_with(kWorkerNamePrefix)) return absl::OkStatus();
  return absl::UnauthenticatedError(
      absl::StrCat("the certificate is that of ", Printable(terms->common_name), ", not of ",
                   identity.empty() ? "a worker" : Printable(identity)));
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> PeerChannelCredentials(
    const CredentialFiles& files, const std::string& identity) {
  absl::StatusOr<std::string> authority = ReadWholeFile(files.authority_path, kPemBytesMax);
  if (!authority.ok()) return authority.status();
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          files.key_path, files.certificate_path, files.authority_path,
          static_cast<unsigned int>(absl::ToInt64Seconds(kCertificateRefreshInterval))));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  // OpenSSL would ask for a server's certificate and gRPC for a host name in it.
  options.set_verify_server_certs(false);
  options.set_check_call_host(false);
  options.set_certificate_verifier(
      grpc::experimental::ExternalCertificateVerifier::Create<PeerVerifier>(*std::move(authority),
                                                                            identity));
  return grpc::experimental::TlsCredentials(options);
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> PeerServerCredentials(
    const CredentialFiles& files) {
  absl::StatusOr<std::string> authority = ReadWholeFile(files.authority_path, kPemBytesMax);
  if (!authority.ok()) return authority.status();
  return TlsServerCredentials(files, std::make_shared<PeerGate>(*std::move(authority)));
}

}  // namespace sheaf
