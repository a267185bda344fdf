// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The time zone in which people read and write times.
#pragma once

#include <string>

#include "absl/time/time.h"

namespace sheaf {

// The zone of localtime(3): TZ as a name (Europe/Berlin), a file or a rule of POSIX (JST-9,
// EST5EDT,M3.2.0,M11.1.0), and without TZ the machine's. absl::LocalTimeZone() knows names alone.
// The first call warns if TZ is none of these, since the C library then takes UTC.
// Requires: what people write is read with FromLocal.
absl::TimeZone LocalZone();

// The time of a clock in the zone. If the clock shows it twice, returns the first one; if the clock
// skips it, a time as much later after the change. absl::FromCivil and absl::ParseTime are up to an
// hour off in the C library's zone, whose rules absl cannot see: this asks the zone only for
// offsets.
absl::Time FromLocal(absl::CivilSecond clock, absl::TimeZone zone);

// Why the value of TZ names no zone, and what to write. Empty where it names one.
std::string WhyNoZone(const std::string& tz);

}  // namespace sheaf
