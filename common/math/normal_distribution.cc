// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/normal_distribution.h"

#include <boost/math/distributions/normal.hpp>

namespace sheaf {

using boost::math::complement;
using boost::math::normal;

double NormalShareBelow(double deviations) { return cdf(normal(), deviations); }
double NormalShareAbove(double deviations) { return cdf(complement(normal(), deviations)); }

double NormalQuantileBelow(double share) { return quantile(normal(), share); }
double NormalQuantileAbove(double share) { return quantile(complement(normal(), share)); }

}  // namespace sheaf
