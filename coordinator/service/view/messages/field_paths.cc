// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/messages/field_paths.h"

#include <string>

#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/base/check.h"

namespace sheaf::coordinator {

FieldPath PathOf(const google::protobuf::Descriptor& message, const ViewField& field) {
  using enum ViewField::Shown;
  FieldPath path;
  if (field.shown == kOnlyHttp || field.shown == kInMessageElsewhere) return path;
  const absl::string_view text = *field.in_message == 0 ? field.name : field.in_message;
  const google::protobuf::Descriptor* holder = &message;
  for (const absl::string_view name : absl::StrSplit(text, '.')) {
    SHEAF_CHECK(holder != nullptr);
    const auto* found = holder->FindFieldByName(std::string(name));
    if (found == nullptr) {
      found = holder->FindFieldByName(std::string(absl::StripSuffix(name, "_seconds")));
    }
    SHEAF_CHECK(found != nullptr);
    path.push_back(found);
    holder = found->message_type();
  }
  return path;
}

}  // namespace sheaf::coordinator
