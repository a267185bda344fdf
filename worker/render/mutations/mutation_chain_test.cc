// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests mutations and chains of them without a scene: the numbers of a chain, the balance of its
// steps, and that chains spread a density without changing it. Estimates are means over independent
// seeds, compared with closed forms in standard deviations. Seeds are fixed, so a test that passes
// once always passes.
#include "worker/render/mutations/mutation_chain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "worker/render/sampling/mutated_sampler.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render {
namespace {

constexpr uint64_t kSeed = 11;
// One of a thousand tests of some 200 normal deviates has a larger one.
constexpr double kDeviationMax = 4.6;

// Mean of independent draws.
class Mean {
 public:
  void Add(double draw) {
    sum_ += draw;
    squares_ += draw * draw;
    ++count_;
  }
  // From the expectation, in standard deviations of the mean.
  double DeviationFrom(double expected) const {
    const double mean = sum_ / count_;
    const double variance = (squares_ / count_ - mean * mean) / count_;
    return variance > 0 ? (mean - expected) / std::sqrt(variance) : (mean - expected) * 1e9;
  }

 private:
  double sum_ = 0, squares_ = 0, count_ = 0;
};

// --- Numbers -------------------------------------------------------------------------------------

TEST(MutatedSamplerTest, UnmovedNumbersAreTheSeeds) {
  const Sampler seed(kSeed, 3, 5, 77);
  MutatedSampler sampler(seed);
  const auto expect_as_seed = [&] {
    for (const uint32_t slot : {0u, 1u, 9u, 1u << 28}) {
      EXPECT_EQ(sampler.Get4(slot), seed.Get4(slot));
      EXPECT_EQ(sampler.Get2(slot).y, seed.Get2(slot).y);
      EXPECT_EQ(sampler.Get1(slot), seed.Get1(slot));
    }
    EXPECT_EQ(sampler.x(), 0);
    EXPECT_EQ(sampler.y(), 0);
  };
  expect_as_seed();
  sampler.Begin(1);
  expect_as_seed();
  sampler.Propose();
  EXPECT_NE(sampler.Get4(0), seed.Get4(0));
}

TEST(MutatedSamplerTest, AllAccessesAgree) {
  const Sampler seed(kSeed, 0, 0, 0);
  MutatedSampler sampler(seed);
  sampler.Begin(4);
  for (int step = 0; step < 10; ++step) {
    sampler.Propose();
    const std::array<float, 4> all = sampler.Get4(7);
    EXPECT_EQ(sampler.Get2(7).x, all[0]);
    EXPECT_EQ(sampler.Get2(7).y, all[1]);
    EXPECT_EQ(sampler.Get1(7), all[0]);
    for (const float u : all) EXPECT_TRUE(u >= 0 && u < 1) << u;
    if (step % 3 == 0) sampler.Accept();
  }
}

// A slot moves by all accepted steps, also by those before a path first asks for it, and beyond
// what the cache holds.
TEST(MutatedSamplerTest, NumbersDependOnNoEarlierAccess) {
  constexpr uint32_t kSlots = 1000;
  const Sampler seed(kSeed, 1, 2, 3);
  MutatedSampler often(seed), once(seed);
  often.Begin(5);
  once.Begin(5);
  for (uint32_t step = 1; step < kChainStatesMax; ++step) {
    often.Propose();
    once.Propose();
    for (uint32_t slot = step % 2; slot < kSlots; slot += 3) often.Get4(slot);
    if (step % 4 == 0) continue;
    often.Accept();
    once.Accept();
  }
  for (uint32_t slot = kSlots; slot-- > 0;) {
    ASSERT_EQ(once.Get4(slot), often.Get4(slot)) << slot;
  }
  EXPECT_EQ(once.x(), often.x());
  EXPECT_EQ(once.y(), often.y());
}

// Distances of one step: within their bounds, as many up as down, all octaves as likely.
TEST(MutatedSamplerTest, DistancesAreSymmetric) {
  constexpr int kSteps = 40000;
  std::array<Mean, MutatedSampler::kCoordinateOctaves> octaves;
  std::map<int32_t, int> pixels;
  Mean sign, size;
  for (int i = 0; i < kSteps; ++i) {
    const Sampler seed(kSeed, i, 0, 0);
    MutatedSampler sampler(seed);
    sampler.Begin(static_cast<uint64_t>(i));
    sampler.Propose();
    double moved = static_cast<double>(sampler.Get1(2)) - static_cast<double>(seed.Get1(2));
    if (std::fabs(moved) > 0.5) moved -= std::copysign(1, moved);
    ASSERT_GE(std::fabs(moved), 0x1p-14);
    ASSERT_LT(std::fabs(moved), 0x1p-6);
    sign.Add(moved > 0 ? 1 : -1);
    size.Add(moved);
    const auto octave = static_cast<size_t>(std::ilogb(moved) + 14);
    for (size_t k = 0; k < octaves.size(); ++k) octaves[k].Add(k == octave ? 1 : 0);
    ++pixels[sampler.x()];
    ++pixels[-sampler.x()];
    ASSERT_LE(std::abs(sampler.x()), 16);
    sign.Add(sampler.y() > 0 ? 1 : sampler.y() < 0 ? -1 : 0);
  }
  EXPECT_LT(std::fabs(sign.DeviationFrom(0)), kDeviationMax);
  EXPECT_LT(std::fabs(size.DeviationFrom(0)), kDeviationMax);
  for (Mean& octave : octaves) {
    EXPECT_LT(std::fabs(octave.DeviationFrom(1.0 / octaves.size())), kDeviationMax);
  }
  EXPECT_EQ(pixels.size(), 33u);
}

// --- Chains --------------------------------------------------------------------------------------

struct Point {
  std::array<float, 2> at{};
  double target = 0;
};
// The densities 6 x (1 - x) and 2 y of the unit square, and their integrals from 0 on.
double DensityAt(double x, double y) { return 6 * x * (1 - x) * 2 * y; }
double Below(double x, double y) { return x * x * (3 - 2 * x) * y * y; }

constexpr int kCells = 6;  // Along an edge of the square.
size_t CellOf(const Point& point) {
  const auto index = [](float u) { return static_cast<size_t>(u * kCells); };
  return index(point.at[0]) * kCells + index(point.at[1]);
}
double InCell(size_t cell) {
  const double edge = 1.0 / kCells;
  const double x = static_cast<double>(cell / kCells) * edge;
  const double y = static_cast<double>(cell % kCells) * edge;
  return Below(x + edge, y + edge) - Below(x, y + edge) - Below(x + edge, y) + Below(x, y);
}
Point PointOf(const MutatedSampler& sampler) {
  const Vec2f u = sampler.Get2(0);
  return {{u.x, u.y}, DensityAt(static_cast<double>(u.x), static_cast<double>(u.y))};
}

// Calls visit(number, sampler, seed point) for each of many independent seeds.
template <typename Visit>
void ForSeeds(int count, const Visit& visit) {
  for (int i = 0; i < count; ++i) {
    const Sampler seed(kSeed, i, 1, 0);
    MutatedSampler sampler(seed);
    sampler.Begin(MixBits(static_cast<uint64_t>(i)));
    const Point first = PointOf(sampler);
    if (first.target > 0) visit(&sampler, first);
  }
}

// The largest deviation of the deposits in all cells from the integrals of the density.
double LargestDeviation(uint32_t states, int seeds, double exponent) {
  std::vector<Mean> cells(kCells * kCells);
  ForSeeds(seeds, [&](MutatedSampler* sampler, const Point& first) {
    std::vector<double> deposits(cells.size());
    const auto target = [&](Point point) {
      point.target = std::pow(point.target, exponent);
      return point;
    };
    const double at_seed = RunChain(
        states, target(first), sampler, [&] { return target(PointOf(*sampler)); },
        [&](const Point& point, double part) { deposits[CellOf(point)] += part; });
    deposits[CellOf(first)] += at_seed;
    double sum = 0;
    for (size_t cell = 0; cell < cells.size(); ++cell) {
      cells[cell].Add(first.target * deposits[cell]);
      sum += deposits[cell];
    }
    ASSERT_NEAR(sum, 1, 1e-12);
  });
  double largest = 0;
  for (size_t cell = 0; cell < cells.size(); ++cell) {
    largest = std::max(largest, std::fabs(cells[cell].DeviationFrom(InCell(cell))));
  }
  return largest;
}

TEST(MutationChainTest, ChainsKeepTheDensity) {
  for (const uint32_t states : {1u, 2u, 8u, kChainStatesMax}) {
    EXPECT_LT(LargestDeviation(states, 40000, 1), kDeviationMax) << states;
  }
  // Chains with another target drift to where it is largest.
  EXPECT_GT(LargestDeviation(kChainStatesMax, 40000, 60), 2 * kDeviationMax);
}

// As much flows back to a strip as from it in a step, for seeds with the density.
TEST(MutationChainTest, StepsAreBalanced) {
  constexpr size_t kStrips = 64;
  const auto strip_of = [](const Point& point) {
    return static_cast<size_t>(point.at[0] * kStrips);
  };
  std::array<Mean, kStrips> net, stays;
  ForSeeds(60000, [&](MutatedSampler* sampler, const Point& first) {
    sampler->Propose();
    const Point next = PointOf(*sampler);
    const double accepted = std::min(1.0, next.target / first.target);
    const size_t from = strip_of(first), to = strip_of(next);
    for (size_t strip = 0; strip < kStrips; ++strip) {
      const double in = to == strip ? accepted : from == strip ? 1 - accepted : 0;
      const double stay = from == to && from == strip ? 1 : in;
      net[strip].Add(from == strip && to != strip   ? -first.target * accepted
                     : to == strip && from != strip ? first.target * accepted
                                                    : 0);
      stays[strip].Add(first.target * stay);
    }
  });
  for (size_t strip = 0; strip < kStrips; ++strip) {
    const double x = static_cast<double>(strip) / kStrips;
    EXPECT_LT(std::fabs(net[strip].DeviationFrom(0)), kDeviationMax) << strip;
    // After the step the strip holds what the density has there.
    const double mass = Below(x + 1.0 / kStrips, 1) - Below(x, 1);
    EXPECT_LT(std::fabs(stays[strip].DeviationFrom(mass)), kDeviationMax) << strip;
  }
}

TEST(MutationChainTest, OneStateIsTheSeed) {
  ForSeeds(10, [](MutatedSampler* sampler, const Point& first) {
    const auto fail = [](const Point&, double) { ADD_FAILURE(); };
    EXPECT_EQ(RunChain(
                  1, first, sampler, [&] { return PointOf(*sampler); }, fail),
              1);
  });
}

// A seed whose neighbors are all black keeps what it brings.
TEST(MutationChainTest, ALonelySeedKeepsItsPart) {
  ForSeeds(10, [](MutatedSampler* sampler, const Point& first) {
    const auto fail = [](const Point&, double) { ADD_FAILURE(); };
    EXPECT_NEAR(RunChain(
                    kChainStatesMax, first, sampler, [] { return Point(); }, fail),
                1, 1e-12);
  });
}

}  // namespace
}  // namespace sheaf::render
