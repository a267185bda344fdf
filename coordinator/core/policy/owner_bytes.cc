// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/policy/owner_bytes.h"

#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sheaf::coordinator {

std::string FormatBytes(uint64_t bytes) {
  constexpr const char* kUnits[] = {"KiB", "MiB", "GiB", "TiB", "PiB"};
  if (bytes < 1024) return absl::StrCat(bytes, " bytes");
  double value = static_cast<double>(bytes) / 1024;
  size_t unit = 0;
  for (; value >= 1024 && unit + 1 < std::size(kUnits); ++unit) value /= 1024;
  return absl::StrFormat("%.1f %s", value, kUnits[unit]);
}

std::string DescribeBytes(const OwnerBytes& bytes) {
  return absl::StrCat(FormatBytes(bytes.part_bytes), " of parts, ", FormatBytes(bytes.image_bytes),
                      " of images, ", FormatBytes(bytes.preview_bytes), " of previews and ",
                      FormatBytes(bytes.content_bytes), " of files that others do not share");
}

absl::Status CheckOwnerBytes(const std::string& owner, const OwnerBytes& kept, uint64_t more,
                             uint64_t bytes_max) {
  const uint64_t total = kept.Total();
  if (total < bytes_max && more <= bytes_max - total) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      owner, " keeps ", FormatBytes(total), " on the coordinator: ", DescribeBytes(kept), "; ",
      more > 0 ? FormatBytes(more) : "a job", " more would exceed ", FormatBytes(bytes_max),
      ", the limit of a user. sheaf unpin jobs that need not stay and sheaf cancel those that need "
      "not end, then ask an operator for sheaf gc, for a shorter --keep-parts or --keep-jobs, or "
      "for a higher --user-bytes-max; sheaf usage shows what is kept"));
}

}  // namespace sheaf::coordinator
