// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Conversion of protobuf durations to numbers.
#pragma once

#include <google/protobuf/duration.pb.h>

namespace sheaf::cli {

inline double Seconds(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9;
}

}  // namespace sheaf::cli
