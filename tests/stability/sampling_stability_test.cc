// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows R1 to R5 of the catalogue of hard cases, and the properties of Owen scrambling. Statistics
// are converted to normal deviates; with bounds of 5 and 6 and fixed seeds a correct sampler fails
// with a probability of about 1e-5.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "common/film/film_tile.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_sampling.h"
#include "worker/render/sampling/dimensions.h"
#include "worker/render/sampling/discrete_distribution.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render {
namespace {

// Point i of one replicate of one pixel's sequence.
std::array<float, 4> PointAt(uint64_t seed, uint64_t index, uint32_t slot) {
  return Sampler(seed, 11, -7, index * kReplicateCount + 3).Get4(slot);
}

double ChiSquareDeviate(const std::vector<uint32_t>& counts, double expected) {
  double statistic = 0;
  for (uint32_t count : counts) statistic += (count - expected) * (count - expected) / expected;
  const double k = static_cast<double>(counts.size() - 1);
  return (std::cbrt(statistic / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
}

// --- R1 ----------------------------------------------------------------------------------------

TEST(SamplingStabilityTest, R1UnitFloatsAreBelowOne) {
  for (uint32_t i = 0; i < (1u << 24); ++i) {
    const float u = sobol::UnitFloat((i << 8) | 0xffu);
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    ASSERT_EQ(u, static_cast<float>(i) / 16777216.0f);
  }
  ExpectHardCase({.row = "R1",
                  .figure = "largest random number",
                  .expected = 1 - 0x1p-24,
                  .measured = sobol::UnitFloat(0xffffffffu),
                  .naive = naive::UnitFloat(0xffffffffu),
                  .naive_by = "32 bits times 2^-32"});
}

TEST(SamplingStabilityTest, R1ExtendedUnitsAreBelowOne) {
  for (uint64_t salt = 0; salt < 1000; ++salt) {
    ASSERT_LT(ExtendBits(0x1.fffffep-1f, salt * 0x9e3779b97f4a7c15u), 1.0);
    ASSERT_GE(ExtendBits(0, salt), 0.0);
  }
}

// --- R2 ----------------------------------------------------------------------------------------

// Whether 2^k consecutive points at an aligned offset put exactly one point in every elementary box
// of sides 2^-a, 2^-(k-a) of two dimensions, for every a.
void ExpectNet(uint64_t offset, uint32_t k, size_t dim_x, size_t dim_y, uint32_t t) {
  const uint32_t log_boxes = k - t;
  for (uint32_t a = 0; a <= log_boxes; ++a) {
    std::vector<uint32_t> count(size_t{1} << log_boxes);
    for (uint64_t i = 0; i < (uint64_t{1} << k); ++i) {
      const auto u = PointAt(17, offset + i, 5);
      const auto x = static_cast<uint32_t>(u[dim_x] * static_cast<float>(1u << a));
      const auto y = static_cast<uint32_t>(u[dim_y] * static_cast<float>(1u << (log_boxes - a)));
      ++count[(x << (log_boxes - a)) | y];
    }
    for (uint32_t c : count)
      ASSERT_EQ(c, 1u << t) << "offset " << offset << " k " << k << " a " << a;
  }
}

TEST(SamplingStabilityTest, R2ElementaryIntervalsHoldAtAnyOffset) {
  const uint64_t offsets[] = {0,
                              1u << 10,
                              uint64_t{1} << 32,
                              uint64_t{1} << 40,
                              (uint64_t{1} << 40) + (uint64_t{7} << 33),
                              uint64_t{1} << 58};
  for (uint64_t offset : offsets) {
    for (uint32_t k = 0; k <= 10; ++k) ExpectNet(offset, k, 0, 1, 0);
    // Dimensions beyond the second have a net parameter of t = 1 in pairs with these polynomials.
    ExpectNet(offset, 8, 1, 2, 1);
    ExpectNet(offset, 8, 0, 3, 2);
  }
  std::set<std::array<float, 4>> points, points_of_32_bits;
  for (const uint64_t offset : {uint64_t{0}, uint64_t{1} << 32}) {
    for (uint64_t i = 0; i < 1024; ++i) {
      points.insert(PointAt(17, offset + i, 5));
      points_of_32_bits.insert(PointAt(17, static_cast<uint32_t>(offset + i), 5));
    }
  }
  ExpectHardCase({.row = "R2",
                  .figure = "different points among 1024 from 0 on and 1024 from 2^32 on",
                  .expected = 2048,
                  .measured = points.size(),
                  .naive = points_of_32_bits.size(),
                  .naive_by = "index of 32 bits"});
}

TEST(SamplingStabilityTest, R2EveryDimensionIsStratified) {
  for (uint64_t offset : {uint64_t{0}, uint64_t{1} << 32, uint64_t{1} << 40}) {
    for (size_t d = 0; d < 4; ++d) {
      std::set<uint32_t> strata;
      for (uint64_t i = 0; i < 4096; ++i) {
        strata.insert(static_cast<uint32_t>(PointAt(2, offset + i, 9)[d] * 4096));
      }
      EXPECT_EQ(strata.size(), 4096u);
    }
  }
}

TEST(SamplingStabilityTest, R2FourDimensionalNets) {
  // t = 3 for the first four dimensions: 8 points in each of the 2^(k-3) boxes.
  constexpr uint32_t kLogPoints = 9;
  for (uint64_t offset : {uint64_t{0}, uint64_t{1} << 40}) {
    for (uint32_t a = 0; a <= 6; ++a) {
      for (uint32_t b = 0; a + b <= 6; ++b) {
        for (uint32_t c = 0; a + b + c <= 6; ++c) {
          const uint32_t bits[4] = {a, b, c, 6 - a - b - c};
          std::vector<uint32_t> count(64);
          for (uint64_t i = 0; i < (1u << kLogPoints); ++i) {
            const auto u = PointAt(23, offset + i, 2);
            uint32_t box = 0;
            for (size_t d = 0; d < 4; ++d) {
              box = (box << bits[d]) |
                    static_cast<uint32_t>(u[d] * static_cast<float>(1u << bits[d]));
            }
            ++count[box];
          }
          for (uint32_t n : count) ASSERT_EQ(n, 8u);
        }
      }
    }
  }
}

TEST(SamplingStabilityTest, R2SamplesDependOnlyOnTheirIndex) {
  const Sampler sampler(5, 100, 200, (uint64_t{1} << 45) + 12345);
  for (uint32_t slot : {0u, 1u, 77u, 4000000000u}) {
    const auto u = sampler.Get4(slot);
    EXPECT_EQ(u, Sampler(5, 100, 200, (uint64_t{1} << 45) + 12345).Get4(slot));
    EXPECT_EQ(sampler.Get2(slot), (Vec2f{u[0], u[1]}));
    EXPECT_EQ(sampler.Get1(slot), u[0]);
  }
}

// All samples of a pixel together form a net if they come from one sequence, and differ from the
// samples of every replicate.
TEST(SamplingStabilityTest, R2OneSequenceIsOneNet) {
  constexpr uint32_t kBits = 4;
  for (uint32_t slot : {0u, 7u, 1000u}) {
    std::vector<int> cells(1u << (2 * kBits));
    for (uint64_t i = 0; i < cells.size(); ++i) {
      const Vec2f u = Sampler(5, 3, 4, i, true).Get2(slot);
      ++cells[(static_cast<uint32_t>(u.x * (1 << kBits)) << kBits) |
              static_cast<uint32_t>(u.y * (1 << kBits))];
    }
    EXPECT_EQ(std::count(cells.begin(), cells.end(), 1), static_cast<long>(cells.size()));
    for (uint64_t i = 0; i < kReplicateCount; ++i) {
      EXPECT_NE(Sampler(5, 3, 4, i, true).Get4(slot), Sampler(5, 3, 4, i).Get4(slot));
    }
  }
}

// --- R3 ----------------------------------------------------------------------------------------

// Counts pairs of coordinates (slot a, dimension i) and (slot b, dimension j) in 8 x 8 cells, over
// pixels; within one pixel points are stratified, so the pixels are what makes pairs independent.
double PairDeviate(uint32_t slot_a, size_t i, uint32_t slot_b, size_t j, uint64_t sample_index) {
  constexpr int32_t kSide = 160;
  std::vector<uint32_t> counts(64);
  for (int32_t y = 0; y < kSide; ++y) {
    for (int32_t x = 0; x < kSide; ++x) {
      const Sampler sampler(1, x, y, sample_index);
      const auto a = static_cast<uint32_t>(sampler.Get4(slot_a)[i] * 8);
      const auto b = static_cast<uint32_t>(sampler.Get4(slot_b)[j] * 8);
      ++counts[a * 8 + b];
    }
  }
  return ChiSquareDeviate(counts, kSide * kSide / 64.0);
}

TEST(SamplingStabilityTest, R3SlotsAndDimensionsAreIndependent) {
  for (uint64_t sample_index : {uint64_t{0}, uint64_t{16}, uint64_t{17 * 16}, uint64_t{1} << 44}) {
    for (size_t i = 0; i < 4; ++i) {
      for (size_t j = 0; j < 4; ++j) {
        EXPECT_LE(PairDeviate(Slot(0, VertexSlot::kLight), i, Slot(1, VertexSlot::kLight), j,
                              sample_index),
                  5)
            << i << ' ' << j << ' ' << sample_index;
        if (i < j) {
          EXPECT_LE(PairDeviate(Slot(CameraSlot::kFilterAndLens), i,
                                Slot(CameraSlot::kFilterAndLens), j, sample_index),
                    5)
              << i << ' ' << j << ' ' << sample_index;
        }
      }
    }
  }
}

// Neighboring seeds, pixels, samples and replicates: the same coordinate at adjacent indices.
TEST(SamplingStabilityTest, R3NeighborsAreIndependent) {
  constexpr int32_t kCount = 40000;
  std::array<std::vector<uint32_t>, 4> counts;
  for (auto& c : counts) c.assign(64, 0);
  for (int32_t k = 0; k < kCount; ++k) {
    const auto here = static_cast<uint32_t>(Sampler(9, k, 4, 0).Get1(6) * 8);
    const float next[4] = {Sampler(10, k, 4, 0).Get1(6), Sampler(9, k, 5, 0).Get1(6),
                           Sampler(9, k, 4, 1).Get1(6), Sampler(9, k, 4, 0).Get1(7)};
    for (size_t n = 0; n < 4; ++n) ++counts[n][here * 8 + static_cast<uint32_t>(next[n] * 8)];
  }
  for (const auto& c : counts) EXPECT_LE(ChiSquareDeviate(c, kCount / 64.0), 5);
}

// The variance of a mean over n points whose two coordinates come from two slots: it equals that of
// points that are stratified in each slot and otherwise paired at random. The expected values are
// the integrand's variance left after the best additive fit (Stein 1987); a correlated pairing
// shows as a ratio far from 1 or as a wrong mean.
TEST(SamplingStabilityTest, R3SlotPairsAreAsGoodAsRandom) {
  const uint64_t set_count = LongTests() ? 400000 : 40000;
  constexpr uint64_t kPoints = 64;
  double sum = 0, squares = 0;
  for (uint64_t set = 0; set < set_count; ++set) {
    double mean = 0;
    for (uint64_t i = 0; i < kPoints; ++i) {
      const Sampler sampler(set, 0, 0, i * kReplicateCount);
      mean += static_cast<double>(sampler.Get1(2)) * static_cast<double>(sampler.Get1(9));
    }
    mean /= kPoints;
    sum += mean;
    squares += mean * mean;
  }
  const double count = static_cast<double>(set_count);
  const double mean = sum / count, variance = squares / count - mean * mean;
  EXPECT_NEAR(mean, 0.25, 6 * std::sqrt(variance / count));
  // Residual of x y: Var = 1/144; a finite number of strata adds O(1/n). A binary digital pairing
  // keeps halves together, which increases it by a factor of at most 1.7.
  EXPECT_LE(variance * kPoints, 1.7 / 144);
  EXPECT_GE(variance * kPoints, 0.9 / 144);
}

// White furnace in one line: the mean of a constant plus zero-mean terms is unchanged under
// reseeding.
TEST(SamplingStabilityTest, R3ReseedingKeepsTheMean) {
  double sum = 0, squares = 0;
  float sum_of_one_number = 0;
  constexpr int kSeeds = 4000;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    double value = 1;
    const Sampler sampler(seed, 2, 3, 5);
    const float u = sampler.Get4(Slot(0, VertexSlot::kBsdf))[1];
    sum_of_one_number += std::pow(2 * u, 8.0f);
    for (uint32_t depth = 0; depth < 8; ++depth) {
      value *= 2.0 * static_cast<double>(sampler.Get4(Slot(depth, VertexSlot::kBsdf))[1]);
    }
    sum += value;
    squares += value * value;
  }
  const double mean = sum / kSeeds, variance = squares / kSeeds - mean * mean;
  ExpectHardCase({.row = "R3",
                  .figure = "mean of a product of 8 factors of mean 1",
                  .expected = 1,
                  .measured = mean,
                  .standard_error = std::sqrt(variance / kSeeds),
                  .naive = sum_of_one_number / kSeeds,
                  .naive_by = "one random number for all factors"});
}

// --- Owen scrambling ---------------------------------------------------------------------------

TEST(SamplingStabilityTest, ScrambledPointsAreUniform) {
  for (uint64_t index : {0, 1, 2, 3, 7, 100, 1000000}) {
    for (size_t d = 0; d < 4; ++d) {
      std::vector<uint32_t> counts(256);
      constexpr uint64_t kSeeds = 51200;
      for (uint64_t seed = 0; seed < kSeeds; ++seed) {
        ++counts[static_cast<size_t>(PointAt(seed, index, 1)[d] * 256)];
      }
      EXPECT_LE(ChiSquareDeviate(counts, kSeeds / 256.0), 5) << index << ' ' << d;
    }
  }
}

// Two points of a scrambled sequence that share their first b bits differ at bit b + 1, and after
// it are independent and uniform: the following bits must be uniformly distributed.
TEST(SamplingStabilityTest, ScramblingIsNestedAndUniform) {
  for (uint32_t shared = 0; shared < 6; ++shared) {
    std::vector<uint32_t> counts(64);
    constexpr uint64_t kSeeds = 40960;
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
      const uint32_t hash = static_cast<uint32_t>(MixBits(seed));
      const uint32_t a = sobol::ReverseBits(sobol::ScrambleReversed(0, hash));
      const uint32_t b = sobol::ReverseBits(sobol::ScrambleReversed(1u << shared, hash));
      ASSERT_EQ(__builtin_clz(a ^ b), static_cast<int>(shared));
      ++counts[((a >> (28 - shared)) & 7) * 8 + ((b >> (28 - shared)) & 7)];
    }
    EXPECT_LE(ChiSquareDeviate(counts, kSeeds / 64.0), 5) << shared;
  }
}

TEST(SamplingStabilityTest, ShufflingKeepsAlignedBlocks) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const uint64_t hash = MixBits(seed);
    const auto shuffled = [&](uint64_t index) {
      uint64_t reversed = 0;
      for (int bit = 0; bit < 64; ++bit) reversed |= ((index >> bit) & 1) << (63 - bit);
      reversed = sobol::ShuffleReversedIndex(reversed, hash);
      uint64_t result = 0;
      for (int bit = 0; bit < 64; ++bit) result |= ((reversed >> bit) & 1) << (63 - bit);
      return result;
    };
    for (uint64_t base : {uint64_t{0}, uint64_t{64}, uint64_t{1} << 40}) {
      for (uint32_t k = 0; k <= 6; ++k) {
        std::set<uint64_t> images;
        for (uint64_t i = 0; i < (uint64_t{1} << k); ++i) images.insert(shuffled(base + i));
        EXPECT_EQ(images.size(), uint64_t{1} << k);
        EXPECT_EQ(*images.begin() >> k, *images.rbegin() >> k);
        EXPECT_TRUE(base != 0 || *images.begin() == 0);
      }
    }
  }
}

// --- R4 ----------------------------------------------------------------------------------------

// Expected by the catalogue: 0 times of 10^8.
TEST(SamplingStabilityTest, R4ZeroWeightsAreNeverChosen) {
  const std::vector<std::vector<double>> cases = {
      {0, 1, 0}, {0, 0, 3, 0, 1e-30, 0}, {1e-300, 0, 1e300, 0}, {1, 0, 0, 0}, {0, 0, 0, 1}};
  const uint64_t draws = LongTests() ? 100000000 : 2000000;
  int wrong_ends = 0, naive_wrong_ends = 0;
  for (const std::vector<double>& weights : cases) {
    const DiscreteDistribution distribution(weights);
    for (uint64_t i = 0; i < draws; ++i) {
      const double u = static_cast<double>(MixBits(i) >> 11) * 0x1p-53;
      ASSERT_GT(weights[distribution.Sample(u)], 0);
    }
    for (const double u : {0.0, 0x1.fffffffffffffp-1}) {
      wrong_ends += weights[distribution.Sample(u)] == 0;
      const size_t chosen = naive::Choose(weights, static_cast<float>(u));
      naive_wrong_ends += chosen == weights.size() || !(weights[chosen] > 0);
    }
    double sum = 0;
    for (size_t i = 0; i < weights.size(); ++i) sum += distribution.Probability(i);
    EXPECT_NEAR(sum, 1, 1e-15);
  }
  ExpectHardCase({.row = "R4",
                  .figure = "entries of weight 0 chosen by the least and the largest u, of 10",
                  .expected = 0,
                  .measured = wrong_ends,
                  .naive = naive_wrong_ends,
                  .naive_by = "first running sum that is not below u"});
  EXPECT_TRUE(DiscreteDistribution({0, 0}).empty());
  EXPECT_TRUE(DiscreteDistribution(std::vector<double>{}).empty());
}

// The ends of every interval: the guide table must not move a boundary.
TEST(SamplingStabilityTest, R4IntervalsAreExact) {
  std::vector<double> weights(1000);
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = i % 3 == 0 ? 0 : static_cast<double>(MixBits(i) >> 40);
  }
  const DiscreteDistribution distribution(weights);
  for (size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    const double begin = distribution.Begin(i), end = begin + distribution.Probability(i);
    EXPECT_EQ(distribution.Sample(begin), i);
    EXPECT_EQ(distribution.Sample(std::nextafter(end, 0.0)), i);
  }
}

// --- R5 ----------------------------------------------------------------------------------------

// Pearson's statistic in standard deviations, exact for any number of draws; it is nearly normal
// because of the number of cells. Source: Haldane 1937, "The Exact Value of the Moments of the
// Distribution of chi^2".
double ManyCellsDeviate(const std::vector<uint32_t>& counts, const std::vector<double>& weights,
                        double draws) {
  double weight_sum = 0, inverse_sum = 0, statistic = 0;
  for (const double w : weights) weight_sum += w;
  for (size_t i = 0; i < counts.size(); ++i) {
    const double p = weights[i] / weight_sum, off = counts[i] - draws * p;
    statistic += off * off / (draws * p);
    inverse_sum += 1 / p;
  }
  const double k = static_cast<double>(counts.size());
  const double variance = 2 * (k - 1) + (inverse_sum - k * k - 2 * k + 2) / draws;
  return (statistic - (k - 1)) / std::sqrt(variance);
}

// Expected by the catalogue: leaf frequencies by chi-square at 2^20 lights. Numbers of 24 bits
// choose among them, and the remaining bits give the point on the light.
TEST(SamplingStabilityTest, R5AMillionLightsAreChosenUniformly) {
  constexpr size_t kLights = size_t{1} << 20;
  std::vector<double> weights(kLights);
  for (size_t i = 0; i < kLights; ++i) weights[i] = 1 + static_cast<double>(i % 7);
  const DiscreteDistribution distribution(weights);
  const uint64_t draws = LongTests() ? 200000000 : 4000000;
  std::vector<uint32_t> leaf_counts(kLights), residue_counts(7);
  std::vector<uint32_t> low_counts(256), place_counts(64), halving_counts(64);
  for (uint64_t i = 0; i < draws; ++i) {
    const uint64_t bits = MixBits(i);
    const float u = static_cast<float>(bits >> 40) * 0x1p-24f;
    const Vec2f v{static_cast<float>(bits & 0xffffff) * 0x1p-24f,
                  static_cast<float>(MixBits(~i) >> 40) * 0x1p-24f};
    ++halving_counts[static_cast<size_t>(naive::AfterHalving(u, 20) * 64)];
    const size_t light = distribution.Sample(ExtendBits(u, SaltOf(v)));
    // Among lights of weight 1: correlation of the last bits with the point on the light.
    if (light % 7 == 0) {
      ++low_counts[(light / 7) % 256];
      ++place_counts[((light / 7) % 8) * 8 + static_cast<size_t>(v.x * 8)];
    }
    ++leaf_counts[light];
    ++residue_counts[light % 7];
  }
  EXPECT_LE(std::fabs(ManyCellsDeviate(leaf_counts, weights, static_cast<double>(draws))), 5);
  double weight_sum = 0;
  for (double w : weights) weight_sum += w;
  for (size_t r = 0; r < 7; ++r) {
    double weight = 0;
    for (size_t i = r; i < kLights; i += 7) weight += weights[i];
    const double p = weight / weight_sum, expected = p * static_cast<double>(draws);
    EXPECT_NEAR(residue_counts[r], expected, 6 * std::sqrt(expected * (1 - p)));
  }
  double low_total = 0;
  for (uint32_t c : low_counts) low_total += c;
  EXPECT_LE(ChiSquareDeviate(low_counts, low_total / 256), 6);
  ExpectHardCase({.row = "R5",
                  .figure = "deviate of chi-square over lights and places on them",
                  .expected = 0,
                  .measured = ChiSquareDeviate(place_counts, low_total / 64),
                  .standard_error = 1,
                  .naive = ChiSquareDeviate(halving_counts, static_cast<double>(draws) / 64),
                  .naive_by = "places by the bits that 20 halvings leave"});
}

}  // namespace
}  // namespace sheaf::render
