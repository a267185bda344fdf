// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/certified_rounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/film/error/certificate.h"

namespace sheaf::coordinator {
namespace {

constexpr int64_t kPixels = 1024;
constexpr uint64_t kMost = 4096;

StopRule Certified(double error) { return {.target_error = error, .certified = true}; }

// Two cells whose errors are 1 and 3 over the number of samples.
std::vector<CellRound> CellsWith(uint64_t samples) {
  std::vector<CellRound> cells;
  for (const double k : {1.0, 3.0}) {
    const double error = k / static_cast<double>(samples);
    const auto count = static_cast<double>(kPixels);
    cells.push_back({samples, {kPixels, count * error, count * error * error}});
  }
  return cells;
}

// Renders to the end; the certified bound exceeds the error by `excess`.
std::vector<RoundRecord> RunCertified(const StopRule& rule, double excess) {
  std::vector<RoundRecord> records;
  std::vector<CellRound> before;
  uint64_t samples = kReplicateCount;
  for (int round = 0; round < 50; ++round) {
    RoundRecord& record = records.emplace_back();
    record.round = round;
    record.cells = CellsWith(samples);
    record.certified_upper = 2 / static_cast<double>(samples) + excess;
    record.Take(DecideAfter(record, rule, kMost, before, {}));
    if (record.samples_next.empty()) return records;
    EXPECT_EQ(record.samples_next[0], record.samples_next[1]);
    EXPECT_GT(record.samples_next[0], samples);
    EXPECT_LE(record.samples_next[0], kRoundGrowthMax * samples);
    EXPECT_TRUE(IsCertifiedStop(record.samples_next[0]) || record.samples_next[0] == kMost);
    samples = record.samples_next[0];
    before = record.cells;
  }
  ADD_FAILURE() << "did not end";
  return records;
}

TEST(CertifiedRoundsTest, EndsAtTheFirstBoundBelowTheTarget) {
  const std::vector<RoundRecord> records = RunCertified(Certified(0.01), 0.004);
  const RoundRecord& last = records.back();
  EXPECT_EQ(last.stop_reason, StopReason::kTargetError);
  EXPECT_LE(last.certified_upper, 0.01);
  for (size_t i = 0; i + 1 < records.size(); ++i) EXPECT_GT(records[i].certified_upper, 0.01);
  EXPECT_EQ(last.cells[0].samples, 384u);  // 2 / 384 + 0.004; 2 / 256 is too much.
}

// No number of samples gives a certified bound of the target.
TEST(CertifiedRoundsTest, EndsWhereMoreSamplesDoNotHelp) {
  const std::vector<RoundRecord> far = RunCertified(Certified(0.01), 0.02);
  EXPECT_LE(far.back().relative_mse_upper, 0.01);
  EXPECT_GT(far.back().relative_mse_upper, kCertificateOutOfReach * 0.01);
  const std::vector<RoundRecord> near = RunCertified(Certified(0.01), 0.00999);
  EXPECT_LE(near.back().relative_mse_upper, kCertificateOutOfReach * 0.01);
  for (const auto& records : {far, near}) {
    EXPECT_LT(records.back().cells[0].samples, kMost);
    EXPECT_GT(records.back().certified_upper, 0.01);
    EXPECT_EQ(records.back().stop_reason, StopReason::kTargetError);
  }
}

TEST(CertifiedRoundsTest, EndsAtTheMaximum) {
  EXPECT_EQ(RunCertified(Certified(1e-6), 0).back().cells[0].samples, kMost);
  EXPECT_EQ(RunCertified(Certified(1e-6), 0).back().stop_reason, StopReason::kSamples);
}

TEST(CertifiedRoundsTest, TimeEndsAFrame) {
  const std::vector<CellRound> cells = CellsWith(64);
  const double now = 64.0 * 2 * kPixels;
  const auto decide = [&](double time) {
    return DecideCertifiedRound(Certified(1e-4), kMost, 3, 0.5, cells, {}, {.time = time});
  };
  EXPECT_TRUE(decide(1.4 * now).samples.empty());
  EXPECT_EQ(decide(1.4 * now).reason, StopReason::kTime);
  EXPECT_EQ(decide(2.5 * now).samples, std::vector<uint64_t>(2, 128));
  EXPECT_EQ(decide(100 * now).samples, std::vector<uint64_t>(2, 256));
}

TEST(CertifiedRoundsTest, RoundsAreReplayed) {
  std::vector<RoundRecord> records = RunCertified(Certified(0.01), 0.004);
  const size_t count = records.size();
  EXPECT_FALSE(ReplayRounds(Certified(0.01), kMost, &records));
  EXPECT_EQ(records.size(), count);
  EXPECT_TRUE(ReplayRounds(Certified(0.006), kMost, &records));
}

}  // namespace
}  // namespace sheaf::coordinator
