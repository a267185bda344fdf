// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/tls/credential_store.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/surroundings/home_directory.h"
#include "common/base/surroundings/local_time.h"

namespace sheaf {
namespace {

constexpr uint64_t kAddressesBytesMax = 64 << 10;
constexpr size_t kFolderNameDigits = 16;

CredentialFiles FilesIn(const std::string& folder) {
  return {absl::StrCat(folder, "/key.pem"), absl::StrCat(folder, "/certificate.pem"),
          absl::StrCat(folder, "/authority.pem")};
}

std::vector<std::string> AddressesOf(const std::string& folder) {
  const absl::StatusOr<std::string> text =
      ReadWholeFile(absl::StrCat(folder, "/addresses"), kAddressesBytesMax);
  if (!text.ok()) return {};
  return absl::StrSplit(*text, '\n', absl::SkipEmpty());
}

absl::Status WriteAddresses(const std::string& folder, std::vector<std::string> addresses) {
  if (addresses.size() > kAddressesOfCoordinatorMax) {
    addresses.erase(addresses.begin(), addresses.end() - kAddressesOfCoordinatorMax);
  }
  return WriteSecretAtomically(absl::StrCat(folder, "/addresses"),
                               absl::StrCat(absl::StrJoin(addresses, "\n"), "\n"));
}

// Removes the addresses from the list; returns whether any was there.
bool EraseAddresses(const std::vector<std::string>& addresses, std::vector<std::string>* list) {
  return std::erase_if(*list, [&](const std::string& known) {
           return std::find(addresses.begin(), addresses.end(), known) != addresses.end();
         }) > 0;
}

// A directory below one that the environment names, or below the home directory; empty without
// both.
std::string UserDirectory(const char* variable, const char* default_below_home, const char* below) {
  if (const char* base = std::getenv(variable); base != nullptr && base[0] == '/') {
    return absl::StrCat(base, below);
  }
  const std::string home = HomeDirectory();
  return home.empty() ? "" : absl::StrCat(home, default_below_home, below);
}

}  // namespace

double LifeFraction(const CertificateTerms& certificate, absl::Time now) {
  return absl::FDivDuration(now - certificate.not_before,
                            certificate.not_after - certificate.not_before);
}

std::string WhyNotYetValid(const CertificateTerms& certificate, absl::Time now) {
  if (now >= certificate.not_before - kClockSkewMax) return "";
  const auto text = [](absl::Time time) {
    return absl::FormatTime("%Y-%m-%d %H:%M", time, LocalZone());
  };
  return absl::StrCat("the certificate of ", certificate.common_name, " is not valid before ",
                      text(certificate.not_before), ", and the clock of this machine says ",
                      text(now), ": set the clock, otherwise calls are refused");
}

std::string CredentialStore::PersonalDirectory() {
  return UserDirectory("XDG_CONFIG_HOME", "/.config", "/sheaf/coordinators");
}

std::string CredentialStore::WorkerDirectory() {
  return UserDirectory("XDG_STATE_HOME", "/.local/state", "/sheaf/worker");
}

std::vector<std::string> CredentialStore::Folders() const {
  std::vector<std::string> folders;
  std::error_code error;
  std::filesystem::directory_iterator entry(directory_, error);
  for (; !error && entry != std::filesystem::directory_iterator() &&
         folders.size() < kCoordinatorsMax;
       entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_directory(ignored)) folders.push_back(entry->path().string());
  }
  return folders;
}

std::optional<CredentialFiles> CredentialStore::Find(const std::string& address) const {
  for (const std::string& folder : Folders()) {
    const std::vector<std::string> addresses = AddressesOf(folder);
    if (std::find(addresses.begin(), addresses.end(), address) != addresses.end()) {
      return FilesIn(folder);
    }
  }
  return std::nullopt;
}

absl::Status CredentialStore::RemoveAddresses(const std::string& folder,
                                              const std::vector<std::string>& addresses) const {
  std::vector<std::string> known = AddressesOf(folder);
  return EraseAddresses(addresses, &known) ? WriteAddresses(folder, std::move(known))
                                           : absl::OkStatus();
}

absl::StatusOr<CredentialFiles> CredentialStore::Put(
    const Credentials& credentials, const std::vector<std::string>& addresses) const {
  if (directory_.empty()) {
    return absl::FailedPreconditionError(
        "credentials: no directory to keep them in, because neither HOME nor the list of users "
        "names a home directory; set HOME");
  }
  const absl::StatusOr<std::string> der = CertificateToDer(credentials.authority_pem);
  if (!der.ok()) return der.status();
  const std::string folder =
      absl::StrCat(directory_, "/", Sha256Hex(*der).substr(0, kFolderNameDigits));
  for (const std::string& path : {directory_, folder}) {
    if (absl::Status status = MakePrivateDirectory(path); !status.ok()) return status;
  }
  const CredentialFiles files = FilesIn(folder);
  const std::pair<std::string, std::string> contents[] = {
      {files.authority_path, credentials.authority_pem},
      {files.key_path, credentials.key_pem},
      {files.certificate_path, credentials.certificate_pem}};
  for (const auto& [path, text] : contents) {
    absl::Status status = WriteSecretAtomically(path, text);
    if (!status.ok()) return status;
  }
  for (const std::string& other : Folders()) {
    if (other == folder) continue;
    if (absl::Status status = RemoveAddresses(other, addresses); !status.ok()) return status;
  }
  std::vector<std::string> known = AddressesOf(folder);
  EraseAddresses(addresses, &known);
  known.insert(known.end(), addresses.begin(), addresses.end());
  if (absl::Status status = WriteAddresses(folder, std::move(known)); !status.ok()) return status;
  return files;
}

}  // namespace sheaf
