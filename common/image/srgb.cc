// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_io.h"
#include "common/math/elementary.h"

namespace sheaf {

float EncodeSrgb(float linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 1;
  if (linear <= 0.0031308f) return 12.92f * linear;
  return 1.055f * Pow(linear, 1 / 2.4f) - 0.055f;
}

float DecodeSrgb(float encoded) {
  if (!(encoded > 0)) return 0;
  if (encoded >= 1) return 1;
  if (encoded <= 0.04045f) return encoded / 12.92f;
  return Pow((encoded + 0.055f) / 1.055f, 2.4f);
}

uint8_t EncodeSrgb8(float linear) { return static_cast<uint8_t>(EncodeSrgb(linear) * 255 + 0.5f); }

}  // namespace sheaf
