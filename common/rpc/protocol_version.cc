// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/protocol_version.h"

#include <algorithm>
#include <cctype>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

constexpr size_t kShownBytesMax = 40;

// Digits alone: no sign and no space.
bool ParseVersion(std::string_view text, int* version) {
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  return !text.empty() && std::ranges::all_of(text, is_digit) &&
         absl::SimpleAtoi(absl::string_view(text.data(), text.size()), version) &&
         *version <= kProtocolVersionMax;
}

std::string Words(const ProtocolRange& range) {
  return range.oldest == range.newest
             ? absl::StrCat("version ", range.newest)
             : absl::StrCat("versions ", range.oldest, " to ", range.newest);
}

}  // namespace

std::string FormatProtocol(const ProtocolRange& range) {
  return absl::StrCat(range.oldest, "-", range.newest);
}

absl::StatusOr<ProtocolRange> ParseProtocol(std::string_view text) {
  if (text.empty()) return ProtocolRange{};
  const size_t dash = text.find('-');
  ProtocolRange range;
  if (dash != std::string_view::npos && ParseVersion(text.substr(0, dash), &range.oldest) &&
      ParseVersion(text.substr(dash + 1), &range.newest) && range.oldest <= range.newest) {
    return range;
  }
  return absl::FailedPreconditionError(absl::StrCat(
      kProtocolKey, ": \"", Printable(text, kShownBytesMax),
      "\" does not say which versions of Sheaf's protocol a program understands, as \"",
      FormatProtocol(kProtocol), "\" does; use programs of one release"));
}

absl::StatusOr<int> AgreeOnProtocol(const ProtocolRange& client, const ProtocolRange& coordinator) {
  const int version = std::min(client.newest, coordinator.newest);
  if (version >= std::max(client.oldest, coordinator.oldest)) return version;
  const bool client_is_older = client.newest < coordinator.newest;
  return absl::FailedPreconditionError(absl::StrCat(
      "this program speaks ", Words(client), " of Sheaf's protocol, and the coordinator ",
      Words(coordinator), ": ",
      client_is_older
          ? "this program is older; install the coordinator's release here"
          : "the coordinator's program is older; update it, or use its release here meanwhile"));
}

std::string DescribeProtocol() {
  return absl::StrCat("protocol ", kProtocolVersion, ", understands ", kOldestProtocolVersion,
                      " to ", kProtocolVersion);
}

}  // namespace sheaf
