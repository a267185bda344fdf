// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Delta and residual ratio tracking against quadrature, through a lumpy grid; and the hard cases of
// tracking by name (V3, V4, V5, V11, V15). The limits are z below 4.7 and p above 1e-6, so that
// some 100 tests fail by chance with a probability of 1e-4. With 2e5 walks a bias of 1 % of the
// standard deviation of one walk is detected.
#include "worker/render/medium/delta_tracking.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/volume/volume_array.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_media.h"
#include "worker/render/medium/cloud_density.h"

namespace sheaf::render {
namespace {

constexpr double kZMax = 4.7;

// Lumps of very different density, with holes, in 24^3 voxels, and a ray through them.
class LumpyMedium {
 public:
  LumpyMedium() {
    EventStream random({4, 2, 4, 2});
    std::vector<float> values(24 * 24 * 24);
    for (size_t i = 0; i < values.size(); ++i) {
      const bool is_hole = (i / 6) % 3 == 0;
      const double u = random.Uniform();
      values[i] = is_hole ? 0.0f : static_cast<float>(0.05 + u * u * u * u * 4);
    }
    auto grid = VolumeGridFromArray("a", "density", {{24, 24, 24}, {}, {1, 1, 1}}, values);
    grid_.emplace(*std::move(grid));
    majorants_ = MajorantGrid::Build(GridDensitySource(*grid_), {.extinction_per_voxel = 1});
    // The integral of the density up to the ends of kStepCount equal steps.
    depth_.assign(1, 0);
    for (int i = 0; i < kStepCount; ++i) {
      const double h = kLength / kStepCount;
      const double mid = DensityAt((i + 0.5) * h);
      const double ends = DensityAt(i * h) + DensityAt((i + 1) * h);
      depth_.push_back(depth_.back() + h * (4 * mid + ends) / 6);
    }
  }

  static constexpr double kLength = 30;
  static constexpr int kStepCount = 400000;
  double DensityAt(double t) const {
    VolumeGrid::Cursor cursor(*grid_);
    const Vec3d p = o + t * d;
    for (size_t a = 0; a < 3; ++a) {
      if (p[a] < grid_->box().lo[a] || p[a] > grid_->box().hi[a]) return 0;
    }
    return grid_->At(p, &cursor);
  }
  // Integral of the density over [0, t].
  double Depth(double t) const {
    const double at = t / kLength * kStepCount;
    const auto i = std::min(static_cast<size_t>(at), size_t{kStepCount} - 1);
    return depth_[i] + (at - static_cast<double>(i)) * (depth_[i + 1] - depth_[i]);
  }
  MajorantWalk Walk() const { return {majorants_, o, d, 0, kLength}; }

  const Vec3d o{-1, 3.3, 7.1}, d = Normalize(Vec3d{1, 0.41, 0.22});

 private:
  std::optional<VolumeGrid> grid_;
  MajorantGrid majorants_;
  std::vector<double> depth_;
};

const LumpyMedium& Lumps() {
  static const LumpyMedium medium;
  return medium;
}

// A mean and the variance of that mean.
struct Mean {
  double sum = 0, squares = 0, count = 0;
  void Add(double v) {
    sum += v;
    squares += v * v;
    ++count;
  }
  double mean() const { return sum / count; }
  double variance() const { return std::max(squares / count - mean() * mean(), 0.0) / (count - 1); }
  // rare_variance: lower bound of the variance of the mean, for events so rare that a sample may
  // contain none.
  double Z(double expected, double rare_variance = 0) const {
    const double deviation = std::sqrt(std::max(variance(), rare_variance));
    return std::fabs(mean() - expected) / std::max(deviation, 1e-7 * expected + 1e-30);
  }
};

TEST(TrackingTest, CollisionsFollowTheDensity) {
  const LumpyMedium& medium = Lumps();
  const int count = DrawCount(200000, 4000000), bins = 64;
  for (const float sigma : {0.02f, 0.3f, 3.0f}) {
    std::vector<double> seen(bins + 1, 0);
    TrackingTally tally;
    for (int i = 0; i < count; ++i) {
      EventStream stream({static_cast<uint32_t>(i), 1, 2, 3});
      MajorantWalk walk = medium.Walk();
      const auto sample = TrackCollision(
          &walk, [&](double t) { return medium.DensityAt(t); }, Rgb::Gray(sigma), Rgb::Gray(1),
          &stream, &tally);
      ASSERT_EQ(sample.weight, Rgb::Gray(1));
      const auto bin = static_cast<size_t>(sample.t / LumpyMedium::kLength * bins);
      ++seen[sample.collides ? std::min<size_t>(bin, bins - 1) : bins];
    }
    EXPECT_EQ(tally.violation_count, 0u);
    double chi = 0, pooled_seen = 0, pooled_expected = 0;
    int freedom = -1;
    double before = 1;
    for (int b = 0; b <= bins; ++b) {
      const double after =
          b == bins ? 0 : std::exp(-sigma * medium.Depth((b + 1) * LumpyMedium::kLength / bins));
      pooled_seen += seen[static_cast<size_t>(b)];
      pooled_expected += count * (before - after);
      before = after;
      if (pooled_expected < 5) continue;
      chi += (pooled_seen - pooled_expected) * (pooled_seen - pooled_expected) / pooled_expected;
      ++freedom;
      pooled_seen = pooled_expected = 0;
    }
    EXPECT_GT(sheaf::testing::UpperGammaQ(0.5 * freedom, 0.5 * chi), 1e-6) << sigma << ": " << chi;
    EXPECT_GE(freedom, 3);
  }
}

TEST(TrackingTest, TransmittanceIsUnbiasedAtAnyThickness) {
  const LumpyMedium& medium = Lumps();
  const double whole = medium.Depth(LumpyMedium::kLength);
  const int count = DrawCount(200000, 4000000);
  for (const double thickness : {1e-8, 1e-4, 1e-2, 0.3, 1.0, 3.0, 10.0, 1e3}) {
    const auto sigma = static_cast<float>(thickness / whole);
    const double expected = std::exp(-double{sigma} * whole);
    Mean ratio, delta;
    TrackingTally tally;
    for (int i = 0; i < count; ++i) {
      EventStream stream({static_cast<uint32_t>(i), 5, 6, 7});
      const auto density = [&](double t) { return medium.DensityAt(t); };
      MajorantWalk walk = medium.Walk();
      ratio.Add(TrackTransmittance(&walk, density, Rgb::Gray(sigma), &stream, &tally).r);
      if (i % 4 != 0) continue;
      MajorantWalk again = medium.Walk();
      delta.Add(
          TrackCollision(&again, density, Rgb::Gray(sigma), Rgb::Gray(1), &stream, &tally).collides
              ? 0
              : 1);
    }
    const double rare = thickness < 1e-3 ? thickness / count : 0;
    EXPECT_LT(ratio.Z(expected, rare), kZMax) << thickness << " " << ratio.mean();
    EXPECT_LT(delta.Z(expected, 4 * std::max(rare, expected / count)), kZMax) << thickness;
    if (thickness > 0.1 && thickness < 5) {
      // Ratio tracking with local bounds is less noisy than counting survivors; variances are per
      // walk.
      EXPECT_LT(ratio.variance() * ratio.count, 0.7 * delta.variance() * delta.count) << thickness;
    }
    EXPECT_EQ(tally.violation_count, 0u);
  }
}

// V10: emission proportional to the density gives (1 - e^-tau) / sigma times it, however thin the
// medium is.
TEST(TrackingTest, V10EmissionIsUnbiasedAtAnyThickness) {
  const LumpyMedium& medium = Lumps();
  const double whole = medium.Depth(LumpyMedium::kLength);
  const int count = DrawCount(50000, 1000000);
  const auto density = [&](double t) { return medium.DensityAt(t); };
  const auto source = [](double) { return Rgb{1, 2, 3}; };
  for (const double thickness : {0.0, 1e-8, 1e-4, 1e-2, 0.3, 1.0, 10.0, 1e3}) {
    SCOPED_TRACE(thickness);
    const auto sigma = static_cast<float>(thickness / whole);
    Mean measured;
    TrackingTally tally;
    for (int i = 0; i < count; ++i) {
      EventStream stream({static_cast<uint32_t>(i), 8, 9, 1});
      MajorantWalk walk = medium.Walk();
      const Rgb sum = TrackEmission(&walk, density, source, Rgb::Gray(sigma), &stream, &tally);
      ASSERT_NEAR(sum.b, 3 * sum.r, 1e-5 * sum.b);
      measured.Add(sum.r);
    }
    const double taken = -std::expm1(-double{sigma} * whole);
    const double expected = thickness > 0 ? taken / double{sigma} : whole;
    EXPECT_LT(measured.Z(expected), kZMax) << measured.mean() << " for " << expected;
    EXPECT_EQ(tally.violation_count, 0u);
    // A single walk is already informative, unless the medium is thick.
    if (thickness < 2) {
      EXPECT_LT(measured.variance() * count, 0.5 * expected * expected);
    }
  }
}

// V11: extinctions of 1 : 10 : 100 in one walk.
TEST(TrackingTest, V11ChromaticMediaAreUnbiasedPerComponent) {
  const LumpyMedium& medium = Lumps();
  const double whole = medium.Depth(LumpyMedium::kLength);
  const auto base = static_cast<float>(0.05 / whole);
  const Rgb sigma{base, 10 * base, 100 * base};
  const int count = DrawCount(200000, 4000000);
  Mean passed[3], collided[3], all[3], ratio[3], emission[3];
  float largest_weight = 0;
  TrackingTally tally;
  for (int i = 0; i < count; ++i) {
    EventStream stream({static_cast<uint32_t>(i), 8, 8, 8});
    const auto density = [&](double t) { return medium.DensityAt(t); };
    MajorantWalk walk = medium.Walk();
    const auto sample = TrackCollision(&walk, density, sigma, Rgb::Gray(1), &stream, &tally);
    MajorantWalk again = medium.Walk();
    const Rgb passing = TrackTransmittance(&again, density, sigma, &stream, &tally);
    MajorantWalk third = medium.Walk();
    const Rgb emitted = TrackEmission(
        &third, density, [&](double) { return sigma; }, sigma, &stream, &tally);
    for (size_t c = 0; c < 3; ++c) {
      passed[c].Add(sample.collides ? 0 : sample.weight[c]);
      collided[c].Add(sample.collides ? sample.weight[c] : 0);
      all[c].Add(sample.weight[c]);
      ratio[c].Add(passing[c]);
      emission[c].Add(emitted[c]);
    }
    largest_weight = std::max(largest_weight, MaxComponent(sample.weight));
  }
  for (size_t c = 0; c < 3; ++c) {
    const double transmittance = std::exp(-double{sigma[c]} * whole);
    EXPECT_LT(passed[c].Z(transmittance), kZMax) << c;
    EXPECT_LT(collided[c].Z(1 - transmittance), kZMax) << c;
    EXPECT_LT(ratio[c].Z(transmittance), kZMax) << c;
    EXPECT_LT(all[c].Z(1), kZMax) << c;
    // V10: a medium whose emission equals its absorption gives 1 - T.
    EXPECT_LT(emission[c].Z(1 - transmittance), kZMax) << c;
  }
  ExpectHardCase({.row = "V11",
                  .figure = "most by which a weight exceeds the number of components",
                  .expected = 0,
                  .measured = std::max(0.0f, largest_weight - 3),
                  .tolerance = 1e-4,
                  .naive = naive::WeightByThickest(0.05f, 5) - 3,
                  .naive_by = "the thickest component sampled alone"});
}

// A walk of one segment with bounds chosen by a test.
struct OneSegment {
  MajorantSegment segment;
  bool is_done = false;
  bool Next(MajorantSegment* out) {
    if (is_done) return false;
    is_done = true;
    *out = segment;
    return true;
  }
};

TEST(TrackingTest, V4DensityEqualToItsMajorantIsHomogeneous) {
  uint64_t nulls = 0;
  for (const float sigma : {1e-6f, 0.7f, 1e5f}) {
    for (uint32_t i = 0; i < 1000; ++i) {
      EventStream stream({i, 0, 0, 1}), same({i, 0, 0, 1});
      OneSegment walk{{0, 1e6, {0.3f, 0.3f}}};
      TrackingTally tally;
      const auto sample = TrackCollision(
          &walk, [](double) { return double{0.3f}; }, Rgb::Gray(sigma), Rgb::Gray(1), &stream,
          &tally);
      const double expected = same.Exponential() / (double{sigma} * 0.3f);
      ASSERT_EQ(sample.collides, expected < 1e6);
      if (sample.collides) {
        ASSERT_EQ(sample.t, expected);
        // The least density decides each collision; a null collision would look the density up.
        nulls += tally.look_up_count;
      }
      ASSERT_EQ(sample.weight, Rgb::Gray(1));
      ASSERT_EQ(tally.violation_count, 0u);
    }
  }
  ExpectHardCase({.row = "V4",
                  .figure = "null collisions where the density is its majorant",
                  .expected = 0,
                  .measured = nulls,
                  .naive = naive::NullExtinction(0.7f, 0.4f, 0.3f),
                  .naive_by = "extinction left of 0.7 - 0.4 - 0.3"});
}

TEST(TrackingTest, V5DensitiesBeyondTheMajorantAreCounted) {
  EventStream stream({0, 0, 0, 5});
  TrackingTally tally;
  for (int i = 0; i < 1000; ++i) {
    OneSegment walk{{0, 10, {0, 1}}};
    const auto density = [](double t) { return t > 5 ? 1.5 : 0.5; };
    TrackCollision(&walk, density, Rgb::Gray(0.5f), Rgb::Gray(1), &stream, &tally);
  }
  EXPECT_GT(tally.violation_count, 50u);
  EXPECT_LT(tally.violation_count, tally.look_up_count);
}

// V15: a constant grid is homogeneous and recognized as such: no lookup is made.
TEST(TrackingTest, V15ConstantGridIsHomogeneous) {
  const std::vector<float> values(40 * 40 * 40, 0.75f);
  auto grid = VolumeGridFromArray("a", "density", {{40, 40, 40}, {}, {1, 1, 1}}, values);
  ASSERT_TRUE(grid.ok());
  grid->set_box({{8, 8, 8}, {32, 32, 32}});
  const MajorantGrid majorants = MajorantGrid::Build(GridDensitySource(*grid), {});
  for (const float sigma : {1e-8f, 1e-3f, 0.1f, 1.0f}) {
    EventStream stream({0, 0, 1, 5});
    TrackingTally tally;
    MajorantWalk walk(majorants, {-2, 7.7, 9.1}, {0.5, 0.125, 0.25}, 0, 64);
    const Rgb passed = TrackTransmittance(
        &walk, [](double) { return 0.75; }, Rgb::Gray(sigma), &stream, &tally);
    const double expected = std::exp(-0.75 * double{sigma} * (64 - 20));
    EXPECT_NEAR(passed.r / expected, 1, 1e-6) << sigma;
    if (sigma == 1) {
      ExpectHardCase({.row = "V15",
                      .figure = "transmittance of a constant grid over its value",
                      .expected = 1,
                      .measured = passed.r / expected,
                      .tolerance = 1e-6,
                      .naive = std::exp(-naive::MarchedThickness(0.75f, 64 - 20, 1000000)) /
                               static_cast<float>(expected),
                      .naive_by = "10^6 even steps"});
    }
    EXPECT_EQ(tally.look_up_count, 0u);
  }
}

// V3: without density there is no collision and all light passes; also to infinity.
TEST(TrackingTest, V3VacuumTransmitsEverything) {
  const MajorantGrid none;
  EventStream stream({0, 0, 0, 3});
  TrackingTally tally;
  MajorantWalk walk(none, {0, 0, 0}, {0, 0, 1}, 0, std::numeric_limits<double>::infinity());
  const auto density = [](double) { return 0.0; };
  EXPECT_FALSE(
      TrackCollision(&walk, density, Rgb::Gray(1e30f), Rgb::Gray(1), &stream, &tally).collides);
  MajorantWalk again(none, {0, 0, 0}, {0, 0, 1}, 0, std::numeric_limits<double>::infinity());
  ExpectHardCase(
      {.row = "V3",
       .figure = "transmittance where the majorant is 0",
       .expected = 1,
       .measured = TrackTransmittance(&again, density, Rgb::Gray(1e30f), &stream, &tally).g,
       .naive = std::exp(-naive::StepThickness(0, 0.5f)),
       .naive_by = "steps of -log(1 - u) / majorant"});
}

}  // namespace
}  // namespace sheaf::render
