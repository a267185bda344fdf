// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/normal_distribution.h"

#include <boost/math/distributions/normal.hpp>

namespace sheaf {

using boost::math::normal;

double NormalCdf(double deviations) { return cdf(normal(), deviations); }

double NormalQuantile(double probability) { return quantile(normal(), probability); }

}  // namespace sheaf
