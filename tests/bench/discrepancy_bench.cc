// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// discrepancy_bench: prints, as JSON, the L2-star and the wrap-around discrepancy of the points by
// which images are sampled, for 16 to 4096 points. Values are the root of the mean square over
// several sets. sampling_page.py draws them.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/bench/discrepancy.h"
#include "tests/bench/sample_sets.h"

namespace sheaf::render {
namespace {

constexpr size_t kCountMin = 16, kCountMax = 4096;
constexpr int32_t kSets = 16;

// One line of the result.
template <size_t D, typename Make>
void Print(const char* name, const Make& make, bool is_last = false) {
  std::string star, torus;
  for (size_t count = kCountMin; count <= kCountMax; count *= 2) {
    const char* comma = count == kCountMin ? "" : ", ";
    star += comma;
    star += std::to_string(std::sqrt(MeanOverSets(make, L2StarSquared<D>, count, kSets)));
    torus += comma;
    torus += std::to_string(std::sqrt(MeanOverSets(make, WrapAroundSquared<D>, count, kSets)));
  }
  std::printf(
      "  {\"name\": \"%s\", \"dimensions\": %zu, \"l2_star\": [%s], \"wrap_around\": [%s]}%s\n",
      name, D, star.c_str(), torus.c_str(), is_last ? "" : ",");
}

void PrintAll() {
  std::printf("[\n");
  Print<2>("independent", IndependentPoints<2>);
  Print<2>("sobol", SobolPoints<2>);
  Print<2>("slot", SlotPoints<2>);
  Print<2>("pairs of slots", SlotPairPoints);
  Print<2>("replicates", ReplicatePoints);
  Print<2>("light paths of a pass", LightPassPoints);
  Print<4>("independent", IndependentPoints<4>);
  Print<4>("sobol", SobolPoints<4>);
  Print<4>("slot", SlotPoints<4>, /*is_last=*/true);
  std::printf("]\n");
}

}  // namespace
}  // namespace sheaf::render

int main() {
  sheaf::render::PrintAll();
  return 0;
}
