// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/enrolment.h"

#include <functional>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/base/surroundings/local_time.h"
#include "common/rpc/address_list.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/retry.h"
#include "common/rpc/tls_credentials.h"
#include "sheaf/v1/access.grpc.pb.h"

namespace sheaf {
namespace {

constexpr absl::Duration kEnrollDeadline = absl::Seconds(20);
constexpr absl::Duration kEnrollWait = absl::Seconds(30);
constexpr absl::Duration kRenewDeadline = absl::Seconds(20);

std::string EnrolAgain(const std::string& address) {
  return absl::StrCat(
      "; an administrator makes a token with sheaf-coordinator enroll, which "
      "sheaf login ",
      address, " or sheaf-worker --token takes");
}

// gRPC says only "unavailable" if the certificate does not state the name that was called.
absl::Status ExplainTls(const std::string& address, const absl::Status& status) {
  if (!absl::IsUnavailable(status)) return status;
  return {status.code(),
          absl::StrCat(NoCoordinatorAnswers(address, status).message(),
                       " (a coordinator under a name that sheaf-coordinator init did not get, or "
                       "with another authority than the token's, counts as none)")};
}

}  // namespace

absl::StatusOr<Enrolment> Enroll(const std::string& address, const EnrolmentToken& token,
                                 const CredentialStore& store) {
  Credentials credentials;
  credentials.key_pem = GenerateKey();
  credentials.authority_pem = token.authority_pem;
  const absl::StatusOr<std::string> request_pem = MakeCertificateRequest(credentials.key_pem);
  if (!request_pem.ok()) return request_pem.status();
  WarnOfClock(token.authority_pem);
  v1::EnrollRequest request;
  request.set_token_secret(token.secret);
  request.set_certificate_request_pem(*request_pem);
  v1::EnrollResponse response;
  const std::unique_ptr<v1::AccessService::Stub> stub =
      v1::AccessService::NewStub(MakeChannel(address, EnrolmentCredentials(token.authority_pem)));
  RetryPolicy policy;
  policy.elapsed_max = kEnrollWait;
  const absl::Status status =
      RetryLoop(policy, Idempotency::kIdempotent, SystemRetryEnvironment(), [&] {
        grpc::ClientContext context;
        SetDeadline(&context, kEnrollDeadline);
        return FromGrpcStatus(stub->Enroll(&context, request, &response));
      });
  if (!status.ok()) return ExplainTls(address, status);
  credentials.certificate_pem = response.certificate_pem();
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(credentials.certificate_pem);
  if (!terms.ok()) return terms.status();
  absl::StatusOr<CredentialFiles> files = store.Put(credentials, SplitAddresses(address));
  if (!files.ok()) return files.status();
  return Enrolment{response.identity(), response.role(), terms->not_after, *std::move(files)};
}

void WarnOfClock(const std::string& certificate_pem) {
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(certificate_pem);
  if (!terms.ok()) return;
  const std::string why = WhyNotYetValid(*terms, absl::Now());
  if (!why.empty()) LogWarning(why);
}

absl::StatusOr<bool> RenewCertificate(const std::string& address, const CredentialFiles& files,
                                      double life_fraction) {
  const absl::StatusOr<std::string> certificate =
      ReadWholeFile(files.certificate_path, kPemBytesMax);
  if (!certificate.ok()) return certificate.status();
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(*certificate);
  if (!terms.ok()) return Annotate(terms.status(), files.certificate_path);
  const double life = LifeFraction(*terms, absl::Now());
  if (life <= life_fraction) return false;
  if (life > 1) {
    return absl::UnauthenticatedError(absl::StrCat(
        "the certificate of ", terms->common_name, " for ", address, " ended at ",
        absl::FormatTime("%Y-%m-%d %H:%M", terms->not_after, LocalZone()), EnrolAgain(address)));
  }
  const absl::StatusOr<std::string> key = ReadWholeFile(files.key_path, kPemBytesMax);
  if (!key.ok()) return key.status();
  const absl::StatusOr<std::string> request_pem = MakeCertificateRequest(*key);
  if (!request_pem.ok()) return request_pem.status();
  v1::RenewCertificateRequest request;
  request.set_certificate_request_pem(*request_pem);
  v1::RenewCertificateResponse response;
  grpc::ClientContext context;
  SetDeadline(&context, kRenewDeadline);
  const absl::Status status =
      FromGrpcStatus(v1::AccessService::NewStub(MakeChannel(address, MutualTlsCredentials(files)))
                         ->RenewCertificate(&context, request, &response));
  if (absl::IsUnauthenticated(status)) {
    return absl::UnauthenticatedError(absl::StrCat(status.message(), EnrolAgain(address)));
  }
  if (!status.ok()) return status;
  const absl::Status written =
      WriteSecretAtomically(files.certificate_path, response.certificate_pem());
  if (!written.ok()) return written;
  return true;
}

bool HasValidCertificate(const std::optional<CredentialFiles>& files) {
  if (!files) return false;
  const absl::StatusOr<std::string> pem = ReadWholeFile(files->certificate_path, kPemBytesMax);
  if (!pem.ok()) return false;
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(*pem);
  return terms.ok() && LifeFraction(*terms, absl::Now()) < 1;
}

absl::StatusOr<EnrolmentToken> ReadTokenFile(const std::string& path) {
  const absl::StatusOr<std::string> text =
      ReadWholeFile(path == "-" ? "/dev/stdin" : path, kTokenBytesMax);
  if (!text.ok()) return text.status();
  return ParseToken(*text);
}

}  // namespace sheaf
