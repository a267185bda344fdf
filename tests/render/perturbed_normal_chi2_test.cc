// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the sampler of BSDFs with perturbed normals against its pdf.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>

#include "tests/render/perturbed_surface.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::ChiSquareResult;
using sheaf::testing::ChiSquareTest;
using testing::FromAngles;
using testing::kNormalSources;
using testing::PerturbedSurface;

// One test for each fixture and perturbation: 1e6 draws against the pdf, at a significance of 1 %
// for all of them together.
TEST(PerturbedNormalChiSquareTest, SamplesFollowThePdf) {
  constexpr uint64_t kSamples = 1000000;
  const BsdfFixture fixtures[] = {
      sheaf::testing::MakeDiffuseFixture(Rgb::Gray(0.5f)),
      sheaf::testing::MakeSheetFixture(Rgb::Gray(0.3f), Rgb::Gray(0.6f)),
      sheaf::testing::MakeMirrorFixture(0.5f, 0.3f, false)};
  const double threshold = sheaf::testing::SidakThreshold(0.01, 12);
  for (const BsdfFixture& fixture : fixtures) {
    for (const double tilt : {25.0, 65.0}) {
      for (const float mirror : {0.0f, 0.5f}) {
        // Vertex normals turn one way and maps the other: each is tested with every fixture.
        const PerturbedNormal::Source source = kNormalSources[mirror > 0 ? 1 : 0];
        const Vec3f wo = FromAngles(40, 150);
        const auto sample = [&](std::array<float, 3> u) -> std::optional<Vec3f> {
          // One uniform number is used twice: its leading digits and its trailing ones.
          const float coarse = std::floor(u[0] * 4096) / 4096, fine = (u[0] - coarse) * 4096;
          const PerturbedSurface t(tilt, wo, {0.3f, mirror + 0.5f * fine}, source);
          const auto drawn = t.normal.Sample<kAllTraits>(fixture.bsdf, t.wo, coarse, {u[1], u[2]});
          if (!drawn) return std::nullopt;
          return t.frame.ToWorld(drawn->wi);
        };
        const PerturbedSurface t(tilt, wo, {0.3f, mirror}, source);
        const auto pdf = [&](Vec3f wi) {
          return static_cast<double>(
              t.normal.Eval<kAllTraits>(fixture.bsdf, t.wo, t.frame.ToLocal(wi)).pdf);
        };
        const ChiSquareResult result = ChiSquareTest(sample, pdf, {}, kSamples);
        EXPECT_GT(result.p_value, threshold) << fixture.name << ' ' << tilt << ' ' << result.text;
      }
    }
  }
}

}  // namespace
}  // namespace sheaf::render
