// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/protobuf_log.h"

#include <google/protobuf/stubs/logging.h>

#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf {
namespace {

// "String field 'sheaf.v1.X.y' contains invalid UTF-8 data when serializing a protocol buffer. ..."
constexpr std::string_view kField = "String field 'sheaf.v1.", kFault = "' contains invalid UTF-8";

std::string& LastField() {
  thread_local std::string field;
  return field;
}

void Note(google::protobuf::LogLevel, const char*, int, const std::string& text) {
  const size_t begin = text.find(kField), end = text.find(kFault);
  if (begin != std::string::npos && end != std::string::npos && end > begin + kField.size()) {
    LastField() = text.substr(begin + kField.size(), end - begin - kField.size());
  }
  LogDebug(absl::StrCat("protobuf: ", text));
}

// Before any message is made, by whatever thread.
[[maybe_unused]] const auto kHandlerBefore = google::protobuf::SetLogHandler(&Note);

}  // namespace

std::string TakeFieldThatIsNotUtf8() { return std::exchange(LastField(), ""); }

}  // namespace sheaf
