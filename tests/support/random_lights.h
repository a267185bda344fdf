// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Random lights, points and rows of learned visibility, for tests of the choice among lights.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/choice/light_visibility_row.h"

namespace sheaf::render {

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  float Between(float low, float high) {
    return low + (high - low) * static_cast<float>(engine_() >> 40) * 0x1p-24f;
  }
  Vec3f Vector(float size) {
    const float x = Between(-size, size), y = Between(-size, size);
    return {x, y, Between(-size, size)};
  }
  Vec3f Direction() {
    for (;;) {
      const Vec3f v = Vector(1);
      if (LengthSquared(v) > 1e-3f) return Normalize(v);
    }
  }

 private:
  std::mt19937_64 engine_;
};

// Cycles through the kinds: one-sided and two-sided panels, spheres, points and spots.
inline LightBounds MakeLight(size_t i, Random* random, float size) {
  LightBounds light;
  light.center = random->Vector(10 * size);
  light.normal = random->Direction();
  light.radius = random->Between(0.01f, 0.5f) * size;
  light.area = 2 * light.radius * light.radius;
  light.strength = random->Between(0.1f, 3);
  switch (i % 5) {
    case 0:
    case 1:
      light.kind = LightBounds::Kind::kPlanar;
      light.two_sided = i % 5 == 1;
      break;
    case 2:
      light.kind = LightBounds::Kind::kSphere;
      break;
    default:
      light.kind = LightBounds::Kind::kPoint;
      light.radius = light.area = 0;
      light.strength *= size * size;
      light.cos_end = i % 5 == 3 ? -1 : random->Between(-0.5f, 0.99f);
  }
  return light;
}

inline std::vector<LightBounds> MakeLights(size_t count, uint64_t seed, float size = 1) {
  Random random(seed);
  std::vector<LightBounds> lights;
  for (size_t i = 0; i < count; ++i) lights.push_back(MakeLight(i, &random, size));
  return lights;
}

// The steps of a LightVisibilityRow.
inline std::vector<uint8_t> RandomSteps(size_t slot_count, uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::vector<uint8_t> steps;
  while (steps.size() < slot_count) {
    steps.push_back(static_cast<uint8_t>(std::max<uint64_t>(engine() % 256, kVisibilityStepMin)));
  }
  return steps;
}

}  // namespace sheaf::render
