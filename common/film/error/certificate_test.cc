// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the certificate on images whose samples follow known distributions, among them those that
// mislead estimates from the spread: how often its bounds are missed, and how wide they are.
#include "common/film/error/certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "tests/support/long_tests.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

// A distribution of samples in [0, 1].
struct Samples {
  const char* name;
  double mean, variance;
  std::function<double(std::mt19937_64&)> draw;
};

double UnitUniform(std::mt19937_64& random) { return std::ldexp(double(random() >> 11), -53); }

// 1 with probability p, else 0.
Samples Spikes(const char* name, double p) {
  return {name, p, p * (1 - p),
          [p](std::mt19937_64& random) { return UnitUniform(random) < p ? 1 : 0; }};
}
Samples Smooth() { return {"smooth", 0.5, 1.0 / 12, UnitUniform}; }
// A dim background with a rare highlight of the largest value.
Samples Glint() {
  constexpr double kBackground = 0.02, kChance = 1.0 / 512;
  return {"glint", kBackground + kChance * (1 - kBackground),
          kChance * (1 - kChance) * (1 - kBackground) * (1 - kBackground),
          [](std::mt19937_64& random) { return UnitUniform(random) < kChance ? 1 : kBackground; }};
}
Samples Constant() {
  return {"constant", 0.3, 0, [](std::mt19937_64&) { return 0.3; }};
}

constexpr int32_t kSide = 16;
constexpr std::array<double, 3> kMostOfGray{1, 1, 1};

// An image of gray pixels, each with one of the distributions in turn.
class SyntheticImage {
 public:
  SyntheticImage(std::vector<Samples> kinds, uint64_t seed)
      : kinds_(std::move(kinds)), random_(seed), planes_({0, 0, kSide, kSide}, kMostOfGray) {}

  void AddSamples(uint64_t count_of_replicate) {
    samples_ += count_of_replicate * kReplicateCount;
    FilmTile tile({0, 0, kSide, kSide}, {0, std::bit_ceil(samples_)});
    const double now = static_cast<double>(samples_) / kReplicateCount;
    for (size_t p = 0; p < tile.plane_size(); ++p) {
      const Samples& kind = kinds_[p % kinds_.size()];
      for (uint32_t r = 0; r < kReplicateCount; ++r) {
        double& sum = sums_[p * kReplicateCount + r];
        for (uint64_t i = 0; i < count_of_replicate; ++i) sum += kind.draw(random_);
        for (size_t c = 0; c < 3; ++c) tile.replicate(r, c)[p] = static_cast<float>(sum);
        tile.replicate(r, 3)[p] = static_cast<float>(now);
      }
    }
    planes_.TakeTile(tile);
  }
  CertificatePlanes::Result Certified() const { return planes_.CertifiedError(samples_); }
  // The expectation that is bounded.
  double RelativeMse() const {
    double mean = 0, sum = 0;
    for (const Samples& kind : kinds_) mean += kind.mean / static_cast<double>(kinds_.size());
    for (size_t p = 0; p < kSide * kSide; ++p) {
      const Samples& kind = kinds_[p % kinds_.size()];
      sum += kind.variance / static_cast<double>(samples_) /
             (kind.mean * kind.mean + 0.01 * mean * mean);
    }
    return sum / (kSide * kSide);
  }

 private:
  std::vector<Samples> kinds_;
  std::mt19937_64 random_;
  uint64_t samples_ = 0;
  std::vector<double> sums_ = std::vector<double>(size_t{kSide} * kSide * kReplicateCount);
  CertificatePlanes planes_;
};

TEST(CertificateTest, StopsAreMultiplesOfTwoAndThree) {
  std::vector<uint64_t> stops;
  for (uint64_t samples = 0; stops.size() < 9; stops.push_back(samples)) {
    samples = NextCertifiedStop(samples);
    EXPECT_TRUE(IsCertifiedStop(samples));
  }
  EXPECT_THAT(stops, ::testing::ElementsAre(16, 32, 48, 64, 96, 128, 192, 256, 384));
  EXPECT_EQ(NextCertifiedStop(100), 128u);
  EXPECT_EQ(NextCertifiedStop(65), 96u);
  EXPECT_FALSE(IsCertifiedStop(80));
  EXPECT_FALSE(IsCertifiedStop(24));
}

TEST(CertificateTest, MissesOfAllCountsAddUpToTheWhole) {
  double sum = 0;
  for (uint64_t points = 1; points <= 1'000'000; ++points) {
    sum += MissProbabilityAt(points * kReplicateCount);
  }
  EXPECT_LE(sum, kCertificateMissProbability);
  EXPECT_GT(sum, 0.9 * kCertificateMissProbability);
}

// The bound of n zeros is the value that n zeros of a spike's pixels would still permit: at least
// 1 - p^(1 / n) of `most`, and no more than the share of the stakes adds.
TEST(CertificateTest, ZerosAreBoundedByWhatTheyExclude) {
  const std::vector<double> zeros(1000, 0.0);
  const double least = 1 - std::pow(0.01, 1.0 / 1000);
  const double bound = UpperBoundOfMean(zeros, 1, 0.01);
  EXPECT_GE(bound, least);
  EXPECT_LE(bound, 4 * least);
  EXPECT_NEAR(UpperBoundOfMean(zeros, 8, 0.01), 8 * bound, 1e-3 * bound);
}

TEST(CertificateTest, NothingIsExcludedByFewValues) {
  EXPECT_EQ(UpperBoundOfMean(std::vector<double>{0.0, 0.0}, 1, 1e-9), 1);
  EXPECT_EQ(LowerBoundOfMean(std::vector<double>{1.0}, 1, 1e-9), 0);
}

TEST(CertificateTest, BoundsApproachTheMean) {
  std::mt19937_64 random(1);
  std::vector<double> values(200'000);
  for (double& value : values) value = UnitUniform(random);
  EXPECT_NEAR(UpperBoundOfMean(values, 1, 0.01), 0.5, 0.005);
  EXPECT_NEAR(LowerBoundOfMean(values, 1, 0.01), 0.5, 0.005);
  EXPECT_GT(UpperBoundOfMean(values, 1, 0.01), 0.5);
  EXPECT_LT(LowerBoundOfMean(values, 1, 0.01), 0.5);
}

// Values of unequal distributions, few of them, in which a spike is seldom observed.
TEST(CertificateTest, BoundsOfRareValuesAreMissedAsSeldomAsPromised) {
  const int runs = DrawCount(2000, 20'000);
  for (const double chance : {0.002, 0.02, 0.3}) {
    std::mt19937_64 random(7);
    int above = 0, below = 0;
    for (int run = 0; run < runs; ++run) {
      std::vector<double> values;
      for (int i = 0; i < 100; ++i) {
        values.push_back(i % 2 == 0 ? 0 : UnitUniform(random) < 2 * chance ? 1 : 0);
      }
      above += UpperBoundOfMean(values, 1, 0.05) < chance ? 1 : 0;
      below += LowerBoundOfMean(values, 1, 0.05) > chance ? 1 : 0;
    }
    EXPECT_LE(above, 0.06 * runs) << chance;
    EXPECT_LE(below, 0.06 * runs) << chance;
  }
}

struct Scene {
  const char* name;
  std::vector<Samples> kinds;
};
std::vector<Scene> Scenes() {
  return {{"smooth", {Smooth()}},
          {"lamps over black", {Spikes("lamp", 0.5), Spikes("edge", 0.02), Constant()}},
          {"glints", {Glint()}},
          {"one pixel in four is noisy", {Constant(), Constant(), Constant(), Glint()}}};
}

// A frame that stops at the first bound that is small enough has a larger error in at most one of
// twenty cases.
TEST(CertificateTest, StopsAreMissedAsSeldomAsPromised) {
  const int runs = DrawCount(150, 2500);
  for (const Scene& scene : Scenes()) {
    int missed = 0;
    for (int run = 0; run < runs; ++run) {
      SyntheticImage image(scene.kinds, static_cast<uint64_t>(run) + 1);
      for (const uint64_t count : {1, 1, 1, 1, 2, 2, 4}) {
        image.AddSamples(count);
        const CertificatePlanes::Result result = image.Certified();
        if (result.relative_mse_upper == 0) continue;
        if (result.relative_mse_upper < image.RelativeMse()) {
          ++missed;
          break;
        }
      }
    }
    EXPECT_LE(missed, 0.05 * runs) << scene.name;
  }
}

std::string WhyNot(const std::function<void(FilmTile*)>& change) {
  FilmTile tile({0, 0, 4, 1}, {0, 16});
  for (size_t p = 0; p < 4; ++p) {
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      for (size_t c = 0; c < 4; ++c) tile.replicate(r, c)[p] = 1;
    }
  }
  change(&tile);
  CertificatePlanes planes(tile.rect(), kMostOfGray);
  planes.TakeTile(tile);
  return planes.CertifiedError(16).why_not;
}

TEST(CertificateTest, SaysWhyThereIsNone) {
  EXPECT_EQ(WhyNot([](FilmTile*) {}), "");
  EXPECT_THAT(WhyNot([](FilmTile* tile) { tile->replicate(3, 1)[2] = -1; }), HasSubstr("negative"));
  EXPECT_THAT(WhyNot([](FilmTile* tile) { tile->replicate(3, 3)[2] = 2; }), HasSubstr("invalid"));
  EXPECT_THAT(WhyNot([](FilmTile* tile) { tile->channel(FilmChannel::kNonFiniteCount)[0] = 1; }),
              HasSubstr("invalid"));
  EXPECT_THAT(WhyNot([](FilmTile* tile) {
                for (uint32_t r = 0; r < kReplicateCount; ++r) tile->replicate(r, 3)[1] = 2;
              }),
              HasSubstr("different numbers"));
  EXPECT_THAT(WhyNot([](FilmTile* tile) { tile->replicate(0, 0)[1] = 2; }), HasSubstr("invalid"));
  EXPECT_THAT(WhyNot([](FilmTile* tile) {
                for (uint32_t r = 0; r < kReplicateCount; ++r) {
                  for (size_t p = 0; p < 4; ++p) {
                    for (size_t c = 0; c < 3; ++c) tile->replicate(r, c)[p] = 0;
                  }
                }
              }),
              HasSubstr("black"));
}

}  // namespace
}  // namespace sheaf
