// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/image/false_color.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sheaf::coordinator {
namespace {

// Coefficients by channel, from the highest power to the constant.
constexpr std::array<std::array<double, 7>, 3> kViridis = {{
    {-5.435455855934631, 4.776384997670288, 6.228269936347081, -4.634230498983486,
     -0.3308618287255563, 0.1050930431085774, 0.2777273272234177},
    {4.645852612178535, -13.74514537774601, 14.17993336680509, -5.799100973351585,
     0.214847559468213, 1.404613529898575, 0.005407344544966578},
    {26.3124352495832, -65.35303263337234, 56.69055260068105, -19.33244095627987,
     0.09509516302823659, 1.384590162594685, 0.3340998053353061},
}};

}  // namespace

Rgb8 Viridis(double t) {
  const double x = t > 0 ? std::min(t, 1.0) : 0;  // NaN is not greater.
  const auto level = [x](const std::array<double, 7>& coefficients) {
    double sum = 0;
    for (const double coefficient : coefficients) sum = sum * x + coefficient;
    return static_cast<uint8_t>(std::lround(std::clamp(sum, 0.0, 1.0) * 255));
  };
  return {level(kViridis[0]), level(kViridis[1]), level(kViridis[2])};
}

}  // namespace sheaf::coordinator
