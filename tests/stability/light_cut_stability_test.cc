// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L9, L11 and L30 of the catalogue of hard cases, as far as they concern the parts into which
// a light tree is split.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/support/hard_case.h"
#include "tests/support/naive_lights.h"
#include "worker/render/light/choice/light_tree.h"

namespace sheaf::render {
namespace {

constexpr Vec3f kCutOrigin{0, 0, 0};

LightBounds PointAt(Vec3f center, float strength) {
  return {.kind = LightBounds::Kind::kPoint, .center = center, .strength = strength};
}

// The probabilities of all lights within their parts: the number of parts.
double SumOfProbabilities(const LightTree& tree, const LightTree::Cut& cut, size_t count, Vec3f p) {
  double sum = 0;
  for (uint32_t i = 0; i < count; ++i) {
    sum += static_cast<double>(tree.ProbabilityIn(cut, i, p, {}));
  }
  return sum;
}

TEST(LightCutStability, L9CoincidentLightsAreSplit) {
  constexpr size_t kCount = 1000;
  const Vec3f place{3, 4, 5};
  const LightTree tree(std::vector<LightBounds>(kCount, PointAt(place, 1)), true);
  for (const Vec3f& p : {kCutOrigin, place}) {
    const LightTree::Cut cut = tree.CutAt(p, {}, LightTree::kPartsMax);
    EXPECT_GE(cut.size(), 1u);
    ExpectHardCase(
        {.row = "L9",
         .figure = "probabilities in the parts of 1000 lights at one point, a part",
         .expected = 1,
         .measured = SumOfProbabilities(tree, cut, kCount, p) / static_cast<double>(cut.size()),
         .tolerance = 1e-5,
         .naive = naive::PlaceInBounds(place.x, place.x, place.x),
         .naive_by = "place in the bounds of all, for a split"});
  }
}

TEST(LightCutStability, L11LightsOfNoPowerAreInNoPart) {
  std::vector<LightBounds> lights;
  std::vector<float> powers;
  for (int i = 0; i < 100; ++i) {
    powers.push_back(i % 3 == 0 ? 0.0f : 1.0f);
    lights.push_back(
        PointAt({static_cast<float>(i % 10), static_cast<float>(i / 10), 1}, powers.back()));
  }
  const LightTree tree(lights, true);
  const LightTree::Cut cut = tree.CutAt(kCutOrigin, {}, 8);
  double dark = 0;
  for (uint32_t i = 0; i < lights.size(); i += 3) {
    dark += static_cast<double>(tree.ProbabilityIn(cut, i, kCutOrigin, {}));
  }
  ExpectHardCase({.row = "L11",
                  .figure = "probability of black lights in the parts of a cut",
                  .expected = 0,
                  .measured = dark,
                  .tolerance = 0,
                  .naive = naive::LightOfPositive(powers) * 0,
                  .naive_by = "the light of those of positive power, times 0"});
  EXPECT_NEAR(SumOfProbabilities(tree, cut, lights.size(), kCutOrigin),
              static_cast<double>(cut.size()), 1e-5);
}

// The point is in the sphere about its lights, of which one is 2^40 times as bright as the others.
TEST(LightCutStability, L30PointsAmongTheirLights) {
  for (const float size : {0x1p-20f, 1.0f, 0x1p20f}) {
    std::vector<LightBounds> lights;
    for (int i = 0; i < 1000; ++i) {
      lights.push_back(
          PointAt(Vec3f{static_cast<float>(i % 10) - 4.5f, static_cast<float>(i / 10 % 10) - 4.5f,
                        static_cast<float>(i / 100) - 4.5f} *
                      size,
                  i == 555 ? 0x1p40f : 1.0f));
    }
    const LightTree tree(lights, true);
    const LightTree::Cut cut = tree.CutAt(kCutOrigin, {}, LightTree::kPartsMax);
    EXPECT_GE(cut.size(), 1u);
    ExpectHardCase({.row = "L30",
                    .figure = "probabilities in the parts at a point among its lights, a part",
                    .expected = 1,
                    .measured = SumOfProbabilities(tree, cut, lights.size(), kCutOrigin) /
                                static_cast<double>(cut.size()),
                    .tolerance = 1e-5,
                    .naive = naive::VariationOfInverseSquares(0, 4.5f),
                    .naive_by = "variation of 1 / d^2 from d - r to d + r"});
    // The lights beside it without the bright one: each part has lights of its own.
    lights[555].strength = 1;
    const LightTree even(lights, true);
    const LightTree::Cut parts = even.CutAt(kCutOrigin, {}, LightTree::kPartsMax);
    EXPECT_GE(parts.size(), 8u);
    EXPECT_NEAR(SumOfProbabilities(even, parts, lights.size(), kCutOrigin),
                static_cast<double>(parts.size()), 1e-4);
  }
}

}  // namespace
}  // namespace sheaf::render
