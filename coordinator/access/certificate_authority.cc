// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/certificate_authority.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/base/surroundings/host_name.h"

namespace sheaf::coordinator {
namespace {

constexpr uint64_t kHostsBytesMax = 64 << 10;
constexpr size_t kHostBytesMax = 253;  // Limit of a DNS name.
// Other machines' clocks may be behind the coordinator's.

std::string AuthorityKeyPath(const std::string& directory) { return directory + "/authority.key"; }
std::string AuthorityPath(const std::string& directory) { return directory + "/authority.pem"; }
std::string HostsPath(const std::string& directory) { return directory + "/hosts"; }

absl::Status WriteSecret(const std::string& path, const std::string& text) {
  return WriteSecretAtomically(path, text);
}

absl::Status CheckHost(const std::string& host) {
  const bool allowed = std::all_of(host.begin(), host.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '.' || c == '-' || c == '_' || c == ':' || c == '*';
  });
  if (!host.empty() && host.size() <= kHostBytesMax && allowed) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "\"", host, "\" is neither a host's name nor an address; write it without a port"));
}

// Writes a new authority, its certificate last, which marks the directory as complete.
absl::Status MakeAuthority(const std::string& directory, absl::Time now) {
  const std::string key = GenerateKey();
  CertificateTerms terms;
  terms.use = CertificateUse::kAuthority;
  // Each authority has its own name, so that errors about one do not look like another's.
  terms.common_name =
      absl::StrCat("Sheaf farm ", absl::FormatTime("%Y%m%d%H%M%S", now, absl::UTCTimeZone()));
  terms.not_before = now - kClockSkewMax;
  terms.not_after = now + kAuthorityLifetime;
  const absl::StatusOr<std::string> certificate = MakeAuthorityCertificate(terms, key);
  if (!certificate.ok()) return certificate.status();
  if (absl::Status s = WriteSecret(directory + "/server.key", GenerateKey()); !s.ok()) return s;
  if (absl::Status s = WriteSecret(AuthorityKeyPath(directory), key); !s.ok()) return s;
  return WriteSecret(AuthorityPath(directory), *certificate);
}

// UnixEpoch if it is not a certificate.
absl::Time ExpiryOf(const std::string& certificate_pem) {
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(certificate_pem);
  return terms.ok() ? terms->not_after : absl::UnixEpoch();
}

void AddAddress(const sockaddr* address, std::vector<std::string>* hosts) {
  char text[INET6_ADDRSTRLEN] = {};
  if (address->sa_family == AF_INET) {
    const auto* ipv4 = reinterpret_cast<const sockaddr_in*>(address);
    ::inet_ntop(AF_INET, &ipv4->sin_addr, text, sizeof text);
  } else if (address->sa_family == AF_INET6) {
    const auto* ipv6 = reinterpret_cast<const sockaddr_in6*>(address);
    if (IN6_IS_ADDR_LINKLOCAL(&ipv6->sin6_addr)) return;  // Means nothing without an interface.
    ::inet_ntop(AF_INET6, &ipv6->sin6_addr, text, sizeof text);
  }
  if (text[0] != '\0') hosts->push_back(text);
}

}  // namespace

bool CertificateAuthority::Exists(const std::string& directory) {
  std::error_code ignored;
  return std::filesystem::exists(AuthorityPath(directory), ignored);
}

absl::Status CertificateAuthority::Create(const std::string& directory,
                                          const std::vector<std::string>& hosts, absl::Time now) {
  for (const std::string& host : hosts) {
    if (absl::Status status = CheckHost(host); !status.ok()) return status;
  }
  if (absl::Status status = MakePrivateDirectory(directory); !status.ok()) return status;
  if (!Exists(directory)) {
    if (absl::Status status = MakeAuthority(directory, now); !status.ok()) return status;
  }
  const absl::StatusOr<std::unique_ptr<CertificateAuthority>> authority = Open(directory);
  if (!authority.ok()) return authority.status();
  absl::StatusOr<std::vector<std::string>> all = (*authority)->Hosts();
  if (!all.ok()) return all.status();
  for (const std::string& host : hosts) {
    if (std::find(all->begin(), all->end(), host) == all->end()) all->push_back(host);
  }
  if (all->size() > kServerHostsMax) {
    return absl::ResourceExhaustedError(
        absl::StrCat(all->size(), " names of the coordinator are more than ", kServerHostsMax,
                     "; edit ", HostsPath(directory)));
  }
  const absl::Status written =
      WriteSecret(HostsPath(directory), absl::StrCat(absl::StrJoin(*all, "\n"), "\n"));
  if (!written.ok()) return written;
  return (*authority)->RenewServerCertificate(now).status();
}

absl::StatusOr<std::unique_ptr<CertificateAuthority>> CertificateAuthority::Open(
    const std::string& directory) {
  const absl::StatusOr<std::string> certificate =
      ReadWholeFile(AuthorityPath(directory), kPemBytesMax);
  if (!certificate.ok()) return certificate.status();
  const absl::StatusOr<std::string> key = ReadWholeFile(AuthorityKeyPath(directory), kPemBytesMax);
  if (!key.ok()) return key.status();
  for (const absl::Status& status :
       {ReadCertificate(*certificate).status(), MakeCertificateRequest(*key).status()}) {
    if (!status.ok()) {
      return absl::FailedPreconditionError(
          absl::StrCat(directory, ": the certificate authority is damaged: ", status.message(),
                       "; restore it from a backup, or remove the directory, run "
                       "sheaf-coordinator init and enrol all machines again"));
    }
  }
  return std::unique_ptr<CertificateAuthority>(
      new CertificateAuthority(directory, Issuer{*key, *certificate}));
}

CredentialFiles CertificateAuthority::server_files() const {
  return {directory_ + "/server.key", directory_ + "/server.pem", AuthorityPath(directory_)};
}

absl::StatusOr<std::vector<std::string>> CertificateAuthority::Hosts() const {
  const absl::StatusOr<std::string> text = ReadWholeFile(HostsPath(directory_), kHostsBytesMax);
  if (absl::IsNotFound(text.status())) return std::vector<std::string>();
  if (!text.ok()) return text.status();
  std::vector<std::string> hosts = absl::StrSplit(*text, '\n', absl::SkipEmpty());
  return hosts;
}

absl::Time CertificateAuthority::Expiry() const { return ExpiryOf(issuer_.certificate_pem); }

absl::Time CertificateAuthority::ServerExpiry() const {
  const absl::StatusOr<std::string> present =
      ReadWholeFile(server_files().certificate_path, kPemBytesMax);
  return present.ok() ? ExpiryOf(*present) : absl::UnixEpoch();
}

absl::StatusOr<bool> CertificateAuthority::RenewServerCertificate(absl::Time now) const {
  const absl::StatusOr<std::vector<std::string>> hosts = Hosts();
  if (!hosts.ok()) return hosts.status();
  const absl::StatusOr<std::string> present =
      ReadWholeFile(server_files().certificate_path, kPemBytesMax);
  if (present.ok()) {
    const absl::StatusOr<CertificateTerms> terms = ReadCertificate(*present);
    const double life = terms.ok() ? LifeFraction(*terms, now) : 1;
    // A certificate that is not yet valid was made while the clock was ahead: clients reject it.
    if (life >= 0 && life < 0.5) {
      const bool all_there = std::all_of(hosts->begin(), hosts->end(), [&](const std::string& h) {
        return h.find(':') != std::string::npos ||  // An IPv6 address has several spellings.
               std::find(terms->hosts.begin(), terms->hosts.end(), h) != terms->hosts.end();
      });
      if (all_there) return false;
    }
  }
  if (absl::Status status = IssueServerCertificate(*hosts, now); !status.ok()) return status;
  return true;
}

absl::Status CertificateAuthority::IssueServerCertificate(const std::vector<std::string>& hosts,
                                                          absl::Time now) const {
  const CredentialFiles files = server_files();
  const absl::StatusOr<std::string> key = ReadWholeFile(files.key_path, kPemBytesMax);
  if (!key.ok()) return key.status();
  const absl::StatusOr<std::string> request = MakeCertificateRequest(*key);
  if (!request.ok()) return Annotate(request.status(), files.key_path);
  CertificateTerms terms;
  terms.use = CertificateUse::kServer;
  terms.common_name = "Sheaf coordinator";
  terms.hosts = hosts;
  terms.not_before = now - kClockSkewMax;
  terms.not_after = now + kServerLifetime;
  const absl::StatusOr<std::string> certificate = IssueCertificate(terms, *request, issuer_);
  if (!certificate.ok()) return certificate.status();
  return WriteSecret(files.certificate_path, *certificate);
}

absl::StatusOr<std::string> CertificateAuthority::IssueClientCertificate(
    const Identity& identity, const std::string& request_pem, absl::Time now,
    absl::Duration lifetime) const {
  CertificateTerms terms;
  terms.use = CertificateUse::kClient;
  terms.common_name = FormatIdentity(identity.id);
  terms.generation = identity.generation;
  terms.not_before = now;  // Only the coordinator checks it, by the same clock.
  terms.not_after = now + lifetime;
  return IssueCertificate(terms, request_pem, issuer_);
}

std::vector<std::string> HostsOfThisMachine() {
  std::vector<std::string> hosts = {"localhost"};
  const std::string name = HostName();
  // A certificate holds names of ASCII letters only.
  if (std::all_of(name.begin(), name.end(), absl::ascii_isascii)) hosts.push_back(name);
  ifaddrs* interfaces = nullptr;
  if (::getifaddrs(&interfaces) != 0) return hosts;
  for (const ifaddrs* at = interfaces; at != nullptr; at = at->ifa_next) {
    if (at->ifa_addr != nullptr && (at->ifa_flags & IFF_UP) != 0) AddAddress(at->ifa_addr, &hosts);
  }
  ::freeifaddrs(interfaces);
  return hosts;
}

}  // namespace sheaf::coordinator
