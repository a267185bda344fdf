// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The fields of messages that hold the fields of views.
#pragma once

#include <google/protobuf/descriptor.h>

#include <vector>

#include "coordinator/service/view/view_field.h"

namespace sheaf::coordinator {

// From the message down to the field; empty if the message does not hold it.
using FieldPath = std::vector<const google::protobuf::FieldDescriptor*>;

// Requires: the message has the field that the description names.
FieldPath PathOf(const google::protobuf::Descriptor& message, const ViewField& field);

// The paths of a view's fields, in the order of VisitFields; made at the first call. Requires: a
// view has one message.
template <typename View>
const std::vector<FieldPath>& PathsOf(const google::protobuf::Descriptor& message) {
  static const auto* const kPaths = [&message] {
    auto* paths = new std::vector<FieldPath>;
    const View any{};
    VisitFields(any, [&](const ViewField& field, const auto&) {
      paths->push_back(PathOf(message, field));
    });
    return paths;
  }();
  return *kPaths;
}

}  // namespace sheaf::coordinator
