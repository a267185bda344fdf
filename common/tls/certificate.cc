// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/tls/certificate.h"

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <cstring>  // For EVP_EC_gen.
#include <ctime>
#include <memory>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/secret.h"

namespace sheaf {
namespace {

constexpr int kSerialBytes = 16;
constexpr long kVersion3 = 2;  // As X.509 counts.

template <auto kFree>
struct Freer {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
void FreeNames(GENERAL_NAMES* names) { GENERAL_NAMES_free(names); }
using Bio = std::unique_ptr<BIO, Freer<BIO_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY_free>>;
using Request = std::unique_ptr<X509_REQ, Freer<X509_REQ_free>>;
using Certificate = std::unique_ptr<X509, Freer<X509_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Freer<X509_EXTENSION_free>>;
using Names = std::unique_ptr<GENERAL_NAMES, Freer<FreeNames>>;
using Store = std::unique_ptr<X509_STORE, Freer<X509_STORE_free>>;
using StoreContext = std::unique_ptr<X509_STORE_CTX, Freer<X509_STORE_CTX_free>>;

Bio BioOf(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

std::string TextOf(const Bio& bio) {
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &bytes);
  return {bytes, static_cast<size_t>(size)};
}

// A key file never asks for a password at the terminal.
int NoPassword(char* /*buffer*/, int /*size*/, int /*writing*/, void* /*context*/) { return -1; }

absl::StatusOr<Key> ParseKey(const std::string& pem) {
  Key key;
  if (pem.size() <= kPemBytesMax) {
    key.reset(PEM_read_bio_PrivateKey(BioOf(pem).get(), nullptr, NoPassword, nullptr));
  }
  if (key == nullptr) return absl::InvalidArgumentError("not a private key in PEM");
  return key;
}

absl::StatusOr<Certificate> ParseCertificate(const std::string& pem) {
  Certificate certificate;
  if (pem.size() <= kPemBytesMax) {
    certificate.reset(PEM_read_bio_X509(BioOf(pem).get(), nullptr, NoPassword, nullptr));
  }
  if (certificate == nullptr) return absl::InvalidArgumentError("not a certificate in PEM");
  return certificate;
}

bool IsP256(const EVP_PKEY* key) {
  char group[32] = {};
  size_t size = 0;
  return EVP_PKEY_get_base_id(key) == EVP_PKEY_EC &&
         EVP_PKEY_get_group_name(key, group, sizeof group, &size) == 1 &&
         std::string(group, size) == SN_X9_62_prime256v1;
}

absl::StatusOr<Request> ParseRequest(const std::string& pem) {
  Request request;
  if (pem.size() <= kPemBytesMax) {
    request.reset(PEM_read_bio_X509_REQ(BioOf(pem).get(), nullptr, NoPassword, nullptr));
  }
  if (request == nullptr) return absl::InvalidArgumentError("not a certificate request in PEM");
  EVP_PKEY* const key = X509_REQ_get0_pubkey(request.get());
  if (key == nullptr || !IsP256(key)) {
    return absl::InvalidArgumentError("the certificate request is not for a key on P-256");
  }
  if (X509_REQ_verify(request.get(), key) != 1) {
    return absl::InvalidArgumentError("the certificate request is not signed by its key");
  }
  return request;
}

std::string ToPem(X509* certificate) {
  const Bio bio(BIO_new(BIO_s_mem()));
  SHEAF_CHECK(PEM_write_bio_X509(bio.get(), certificate) == 1);
  return TextOf(bio);
}

void SetSerial(X509* certificate) {
  std::string bytes = RandomBytes(kSerialBytes);
  bytes[0] = static_cast<char>((bytes[0] & 0x7f) | 0x40);  // Positive, and of full length.
  BIGNUM* const number = BN_bin2bn(reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()), nullptr);
  BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate));
  BN_free(number);
}

void SetSubject(const CertificateTerms& terms, X509* certificate) {
  X509_NAME* const name = X509_get_subject_name(certificate);
  const auto add = [name](int nid, const std::string& text) {
    SHEAF_CHECK(X509_NAME_add_entry_by_NID(name, nid, MBSTRING_UTF8,
                                           reinterpret_cast<const unsigned char*>(text.data()),
                                           static_cast<int>(text.size()), -1, 0) == 1);
  };
  add(NID_commonName, terms.common_name);
  if (terms.generation != 0) add(NID_serialNumber, absl::StrCat(terms.generation));
}

bool AddExtension(int nid, const char* value, X509* certificate, X509* issuer) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, nid, value));
  return extension != nullptr && X509_add_ext(certificate, extension.get(), -1) == 1;
}

// Without the configuration language of X509V3_EXT_conf, in which a comma in a name would begin
// another name.
absl::Status AddHosts(const std::vector<std::string>& hosts, X509* certificate) {
  if (hosts.empty()) return absl::OkStatus();
  const Names names(GENERAL_NAMES_new());
  for (const std::string& host : hosts) {
    GENERAL_NAME* const name = GENERAL_NAME_new();
    if (ASN1_OCTET_STRING* const address = a2i_IPADDRESS(host.c_str())) {
      GENERAL_NAME_set0_value(name, GEN_IPADD, address);
    } else {
      ASN1_IA5STRING* const text = ASN1_IA5STRING_new();
      ASN1_STRING_set(text, host.data(), static_cast<int>(host.size()));
      GENERAL_NAME_set0_value(name, GEN_DNS, text);
    }
    sk_GENERAL_NAME_push(names.get(), name);
  }
  if (X509_add1_ext_i2d(certificate, NID_subject_alt_name, names.get(), 0, X509V3_ADD_DEFAULT) == 1)
    return absl::OkStatus();
  return absl::InvalidArgumentError("the names of the server do not fit into a certificate");
}

absl::Status AddExtensions(const CertificateTerms& terms, X509* certificate, X509* issuer) {
  const bool authority = terms.use == CertificateUse::kAuthority;
  bool added =
      AddExtension(NID_basic_constraints, authority ? "critical,CA:TRUE,pathlen:0" : "CA:FALSE",
                   certificate, issuer) &&
      AddExtension(NID_key_usage,
                   authority ? "critical,keyCertSign,cRLSign" : "critical,digitalSignature",
                   certificate, issuer) &&
      AddExtension(NID_subject_key_identifier, "hash", certificate, issuer);
  if (!authority) {
    added = added &&
            AddExtension(NID_ext_key_usage,
                         terms.use == CertificateUse::kServer ? "serverAuth" : "clientAuth",
                         certificate, issuer) &&
            AddExtension(NID_authority_key_identifier, "keyid", certificate, issuer);
  }
  SHEAF_CHECK(added);
  return AddHosts(terms.hosts, certificate);
}

// A certificate signed by the issuer's key; without an issuer's certificate, self-signed.
absl::StatusOr<std::string> Issue(const CertificateTerms& terms, EVP_PKEY* subject_key,
                                  EVP_PKEY* issuer_key, X509* issuer) {
  const Certificate certificate(X509_new());
  X509_set_version(certificate.get(), kVersion3);
  SetSerial(certificate.get());
  SetSubject(terms, certificate.get());
  X509* const signer = issuer == nullptr ? certificate.get() : issuer;
  X509_set_issuer_name(certificate.get(), X509_get_subject_name(signer));
  ASN1_TIME_set(X509_getm_notBefore(certificate.get()), absl::ToTimeT(terms.not_before));
  ASN1_TIME_set(X509_getm_notAfter(certificate.get()), absl::ToTimeT(terms.not_after));
  X509_set_pubkey(certificate.get(), subject_key);
  if (absl::Status s = AddExtensions(terms, certificate.get(), signer); !s.ok()) return s;
  SHEAF_CHECK(X509_sign(certificate.get(), issuer_key, EVP_sha256()) != 0);
  return ToPem(certificate.get());
}

absl::Time TimeOf(const ASN1_TIME* time) {
  std::tm broken_down{};
  ASN1_TIME_to_tm(time, &broken_down);
  return absl::FromTimeT(timegm(&broken_down));
}

std::string SubjectEntry(const X509* certificate, int nid) {
  const X509_NAME* const name = X509_get_subject_name(certificate);
  const int index = X509_NAME_get_index_by_NID(name, nid, -1);
  if (index < 0) return "";
  const ASN1_STRING* const text = X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, index));
  unsigned char* utf8 = nullptr;
  const int size = ASN1_STRING_to_UTF8(&utf8, text);
  if (size < 0) return "";
  std::string entry(reinterpret_cast<const char*>(utf8), static_cast<size_t>(size));
  OPENSSL_free(utf8);
  return entry;
}

std::vector<std::string> HostsOf(const X509* certificate) {
  const Names names(static_cast<GENERAL_NAMES*>(
      X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr)));
  std::vector<std::string> hosts;
  for (int i = 0; names != nullptr && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    int kind = 0;
    const auto* value = static_cast<const ASN1_STRING*>(
        GENERAL_NAME_get0_value(sk_GENERAL_NAME_value(names.get(), i), &kind));
    const unsigned char* const bytes = ASN1_STRING_get0_data(value);
    const int size = ASN1_STRING_length(value);
    if (kind == GEN_DNS) {
      hosts.emplace_back(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size));
    } else if (kind == GEN_IPADD && size == 4) {
      hosts.push_back(absl::StrCat(bytes[0], ".", bytes[1], ".", bytes[2], ".", bytes[3]));
    } else if (kind == GEN_IPADD && size == 16) {
      std::string text;
      for (int pair = 0; pair < 8; ++pair) {
        absl::StrAppend(&text, pair == 0 ? "" : ":",
                        absl::Hex(bytes[2 * pair] << 8 | bytes[2 * pair + 1]));
      }
      hosts.push_back(std::move(text));
    }
  }
  return hosts;
}

CertificateUse UseOf(X509* certificate) {
  if (X509_check_ca(certificate) == 1) return CertificateUse::kAuthority;
  const bool server = (X509_get_extended_key_usage(certificate) & XKU_SSL_SERVER) != 0;
  return server ? CertificateUse::kServer : CertificateUse::kClient;
}

}  // namespace

std::string GenerateKey() {
  const Key key(EVP_EC_gen(SN_X9_62_prime256v1));
  SHEAF_CHECK(key != nullptr);
  const Bio bio(BIO_new(BIO_s_mem()));
  SHEAF_CHECK(PEM_write_bio_PKCS8PrivateKey(bio.get(), key.get(), nullptr, nullptr, 0, nullptr,
                                            nullptr) == 1);
  return TextOf(bio);
}

absl::StatusOr<std::string> MakeCertificateRequest(const std::string& key_pem) {
  const absl::StatusOr<Key> key = ParseKey(key_pem);
  if (!key.ok()) return key.status();
  const Request request(X509_REQ_new());
  X509_REQ_set_version(request.get(), 0);
  X509_REQ_set_pubkey(request.get(), key->get());
  SHEAF_CHECK(X509_REQ_sign(request.get(), key->get(), EVP_sha256()) != 0);
  const Bio bio(BIO_new(BIO_s_mem()));
  SHEAF_CHECK(PEM_write_bio_X509_REQ(bio.get(), request.get()) == 1);
  return TextOf(bio);
}

absl::StatusOr<std::string> CheckCertificateRequest(const std::string& request_pem) {
  const absl::StatusOr<Request> request = ParseRequest(request_pem);
  if (!request.ok()) return request.status();
  unsigned char* der = nullptr;
  const int size = i2d_PUBKEY(X509_REQ_get0_pubkey(request->get()), &der);
  SHEAF_CHECK(size > 0);
  std::string digest = Sha256Hex({reinterpret_cast<const char*>(der), static_cast<size_t>(size)});
  OPENSSL_free(der);
  return digest;
}

absl::StatusOr<std::string> MakeAuthorityCertificate(const CertificateTerms& terms,
                                                     const std::string& key_pem) {
  const absl::StatusOr<Key> key = ParseKey(key_pem);
  if (!key.ok()) return key.status();
  return Issue(terms, key->get(), key->get(), nullptr);
}

absl::StatusOr<std::string> IssueCertificate(const CertificateTerms& terms,
                                             const std::string& request_pem, const Issuer& issuer) {
  const absl::StatusOr<Request> request = ParseRequest(request_pem);
  if (!request.ok()) return request.status();
  const absl::StatusOr<Key> key = ParseKey(issuer.key_pem);
  if (!key.ok()) return key.status();
  const absl::StatusOr<Certificate> certificate = ParseCertificate(issuer.certificate_pem);
  if (!certificate.ok()) return certificate.status();
  return Issue(terms, X509_REQ_get0_pubkey(request->get()), key->get(), certificate->get());
}

absl::StatusOr<CertificateTerms> ReadCertificate(const std::string& certificate_pem) {
  const absl::StatusOr<Certificate> certificate = ParseCertificate(certificate_pem);
  if (!certificate.ok()) return certificate.status();
  CertificateTerms terms;
  terms.use = UseOf(certificate->get());
  terms.common_name = SubjectEntry(certificate->get(), NID_commonName);
  const std::string generation = SubjectEntry(certificate->get(), NID_serialNumber);
  if (!generation.empty() && !absl::SimpleAtoi(generation, &terms.generation)) {
    return absl::InvalidArgumentError("the certificate's subject has a malformed serialNumber");
  }
  terms.not_before = TimeOf(X509_get0_notBefore(certificate->get()));
  terms.not_after = TimeOf(X509_get0_notAfter(certificate->get()));
  terms.hosts = HostsOf(certificate->get());
  return terms;
}

absl::Status VerifyCertificate(const std::string& certificate_pem, CertificateUse use,
                               const std::string& authority_pem, absl::Time time) {
  const absl::StatusOr<Certificate> certificate = ParseCertificate(certificate_pem);
  if (!certificate.ok()) return certificate.status();
  const absl::StatusOr<Certificate> authority = ParseCertificate(authority_pem);
  if (!authority.ok()) return authority.status();
  const Store store(X509_STORE_new());
  X509_STORE_add_cert(store.get(), authority->get());
  const StoreContext context(X509_STORE_CTX_new());
  SHEAF_CHECK(X509_STORE_CTX_init(context.get(), store.get(), certificate->get(), nullptr) == 1);
  X509_VERIFY_PARAM* const parameters = X509_STORE_CTX_get0_param(context.get());
  X509_VERIFY_PARAM_set_time(parameters, absl::ToTimeT(time));
  if (use != CertificateUse::kAuthority) {
    X509_VERIFY_PARAM_set_purpose(parameters, use == CertificateUse::kServer
                                                  ? X509_PURPOSE_SSL_SERVER
                                                  : X509_PURPOSE_SSL_CLIENT);
  }
  if (X509_verify_cert(context.get()) == 1) return absl::OkStatus();
  return absl::UnauthenticatedError(
      absl::StrCat("the certificate is not accepted: ",
                   X509_verify_cert_error_string(X509_STORE_CTX_get_error(context.get()))));
}

absl::StatusOr<std::string> CertificateToDer(const std::string& certificate_pem) {
  const absl::StatusOr<Certificate> certificate = ParseCertificate(certificate_pem);
  if (!certificate.ok()) return certificate.status();
  unsigned char* der = nullptr;
  const int size = i2d_X509(certificate->get(), &der);
  SHEAF_CHECK(size > 0);
  std::string bytes(reinterpret_cast<const char*>(der), static_cast<size_t>(size));
  OPENSSL_free(der);
  return bytes;
}

absl::StatusOr<std::string> CertificateFromDer(const std::string& der) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(der.data());
  const Certificate certificate(d2i_X509(nullptr, &bytes, static_cast<long>(der.size())));
  const bool whole = bytes == reinterpret_cast<const unsigned char*>(der.data()) + der.size();
  if (certificate == nullptr || !whole) return absl::InvalidArgumentError("not a certificate");
  return ToPem(certificate.get());
}

}  // namespace sheaf
