// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Keys and X.509 certificates as PEM text: making, issuing, reading and verifying them. The door to
// OpenSSL's X.509. All keys are on the curve P-256, and all signatures are ECDSA with SHA-256.
// Thread safety: all functions may be called concurrently.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sheaf {

// Bytes of a certificate, a key or a request at most; larger text is refused unread.
inline constexpr size_t kPemBytesMax = 16 << 10;

// A new private key, PKCS #8.
std::string GenerateKey();

// A PKCS #10 request for a certificate of the key. Its signature proves possession of the key; who
// the holder is, the issuer decides.
absl::StatusOr<std::string> MakeCertificateRequest(const std::string& key_pem);

// SHA-256 of the public key that the request is for, hexadecimal. Errors: kInvalidArgument: not a
// request, another kind of key, or a signature that the key has not made.
absl::StatusOr<std::string> CheckCertificateRequest(const std::string& request_pem);

enum class CertificateUse { kAuthority, kServer, kClient };

// The statements of a certificate.
// Clocks of machines differ by up to this much: a certificate that others check begins this much
// before it is made.
inline constexpr absl::Duration kClockSkewMax = absl::Hours(1);

struct CertificateTerms {
  CertificateUse use = CertificateUse::kClient;
  std::string common_name;
  uint64_t generation = 0;  // The subject's serialNumber: distinguishes holders of one name.
  absl::Time not_before;    // Whole seconds.
  absl::Time not_after;
  std::vector<std::string> hosts;  // Names and addresses of a server.
};

// A certificate authority: its key and its certificate.
struct Issuer {
  std::string key_pem;
  std::string certificate_pem;
};

// The self-signed certificate of an authority. Errors: kInvalidArgument (the key).
absl::StatusOr<std::string> MakeAuthorityCertificate(const CertificateTerms& terms,
                                                     const std::string& key_pem);
// A certificate for the key of the request. Errors: those of CheckCertificateRequest;
// kInvalidArgument (the issuer, or a host that is not a name).
absl::StatusOr<std::string> IssueCertificate(const CertificateTerms& terms,
                                             const std::string& request_pem, const Issuer& issuer);

// The terms that a certificate states. Errors: kInvalidArgument: not a certificate.
absl::StatusOr<CertificateTerms> ReadCertificate(const std::string& certificate_pem);

// Whether the authority issued the certificate for this use and it is valid at the time.
// Errors: kInvalidArgument: not a certificate; kUnauthenticated, saying why it is not accepted.
absl::Status VerifyCertificate(const std::string& certificate_pem, CertificateUse use,
                               const std::string& authority_pem, absl::Time time);

// A certificate as DER bytes, and back. Errors: kInvalidArgument.
absl::StatusOr<std::string> CertificateToDer(const std::string& certificate_pem);
absl::StatusOr<std::string> CertificateFromDer(const std::string& der);

}  // namespace sheaf
