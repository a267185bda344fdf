// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/host_name.h"

#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

constexpr size_t kHostNameBytesMax = 256;

}  // namespace

std::string UsableHostName(std::string_view name) {
  if (name.empty()) return "unnamed-host";
  std::string usable(name);
  for (size_t at = FindUnprintable(usable); at != std::string::npos; at = FindUnprintable(usable)) {
    usable[at] = '_';
  }
  return usable;
}

std::string HostName() {
  static const std::string host = [] {
    char name[kHostNameBytesMax] = {};
    if (::gethostname(name, sizeof name - 1) != 0) name[0] = '\0';
    std::string usable = UsableHostName(name);
    if (usable != name) {
      LogWarning(absl::StrCat("the name of this machine, \"", Printable(name),
                              "\", is empty or not printable UTF-8; it is shown as ", usable,
                              "; set another with hostnamectl hostname NAME"));
    }
    return usable;
  }();
  return host;
}

}  // namespace sheaf
