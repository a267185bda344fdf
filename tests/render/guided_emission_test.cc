// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the rays of guided lights for every kind of light. Places: rays are found again at their
// places, and the lights' own rays have the density over places that OwnDensity says. The mixture:
// rays follow GuidedEmission's density by Pearson's chi-square over cells of places, carry the same
// flux as unguided ones, and PdfLe integrates to 1. The false-alarm probability of all chi-square
// tests together is 10^-4 (Sidak), estimates are compared within six standard errors, and the seeds
// are fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/chi_square.h"
#include "tests/support/light_setups.h"
#include "tests/support/light_tables.h"
#include "tests/support/long_tests.h"
#include "worker/render/guiding/emission_statistics.h"
#include "worker/render/guiding/guided_emission.h"
#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {
namespace {

using testing::EmissionOf;
using testing::Estimate;
using testing::kSetupRadius;
using testing::LightSetup;
using testing::LightSetups;
using testing::NextUniforms;
using testing::RandomPoints;

std::vector<LightSetup> AllSetups(const LightSetups& setups) {
  std::vector<LightSetup> all = setups.Surfaces();
  for (LightSetup& setup : setups.Positions()) all.push_back(std::move(setup));
  for (LightSetup& setup : setups.Infinite()) all.push_back(std::move(setup));
  all.push_back(setups.Mixture());
  return all;
}

EmissionOrigin OriginOf(const GuidedEmission& emission, const EmittedRay& ray) {
  return emission.OriginOf(ray.light, ray.p, ray.p, ray.n, ray.w);
}

// Learns from rays of the lights alone, which bring light where `brings` says: its square.
EmissionField Learn(const LightEmission& emission,
                    const std::function<double(const EmissionOrigin&)>& brings, int rays = 30000) {
  EmissionStatistics statistics(emission);
  RandomPoints random(3);
  EmissionField field;
  for (int iteration = 0; iteration < 2; ++iteration) {
    const GuidedEmission guided(&emission, &field);
    statistics.Begin(field, static_cast<uint64_t>(rays));
    for (int i = 0; i < rays; ++i) {
      const auto ray = guided.SampleLe(NextUniforms(&random));
      if (!ray) continue;
      const EmissionOrigin origin = OriginOf(guided, *ray);
      const double density = guided.DensityOf(origin);
      statistics.Add(static_cast<uint64_t>(i), {origin, brings(origin) / (density * density)});
    }
    field = statistics.Fit();
  }
  return field;
}

// A field with few cells, of unequal densities along every axis that the light has.
double Slopes(const EmissionOrigin& origin) {
  double product = 1;
  for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
    product *= origin.place.u[axis] < 0.25 ? 9 : (origin.place.u[axis] < 0.5 ? 1 : 0.25);
  }
  return product * (origin.light % 2 == 0 ? 4 : 0.5);
}

// --- Places --------------------------------------------------------------------------------------

TEST(EmissionPlaceTest, RaysAreFoundAgainAtTheirPlaces) {
  const LightSetups setups;
  for (const LightSetup& setup : AllSetups(setups)) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    RandomPoints random(11);
    int found = 0;
    for (int i = 0; i < 4000; ++i) {
      const auto light = static_cast<uint32_t>(i) % setup.table->light_count();
      EmissionPlace place;
      const EmissionAxes axes = emission.AxesOf(light);
      for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
        const float u = random.Next();
        if (axes.Has(axis)) place.u[axis] = static_cast<double>(u);
      }
      const auto ray = emission.RayAt(light, place);
      if (!ray) continue;
      ++found;
      const EmissionPlace again = emission.PlaceOfRay(light, ray->p, ray->p, ray->n, ray->w);
      for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
        // Squares of places have the rounding of points, which is larger near a corner.
        const double off = std::fabs(again.u[axis] - place.u[axis]);
        EXPECT_LT(std::min(off, 1 - off), 2e-3) << axis << " of " << place.u[axis];
      }
      // The same measure as PdfLe.
      const double pdf = emission.PdfLe(light, ray->p, ray->n, ray->w);
      if (pdf > 0) {
        const double choice = emission.ChoiceBegin(light + 1) - emission.ChoiceBegin(light);
        EXPECT_NEAR(pdf / (choice * emission.OwnDensity(light, ray->w) * ray->pdf), 1, 1e-5);
      }
    }
    EXPECT_GT(found, 100);
  }
}

// --- The mixture ---------------------------------------------------------------------------------

constexpr int kCellsAcross = 4;

size_t CellOf(const EmissionOrigin& origin) {
  size_t cell = origin.light;
  for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
    cell = cell * kCellsAcross + static_cast<size_t>(origin.place.u[axis] * kCellsAcross);
  }
  return cell;
}

// Sums by cells of places.
struct Cell {
  double sum = 0, squares = 0;
  int count = 0;
  void Add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
};
using Cells = std::vector<Cell>;

double GuidedPdf(const GuidedEmission& emission, const EmittedRay& ray) {
  // A ray through a portal has a density beyond it alone.
  const Vec3f reached = ray.p + static_cast<float>(2 * kSetupRadius) * ray.w;
  return emission.PdfLe(ray.light, ray.is_infinite ? reached : ray.p, ray.p, ray.n, ray.w);
}

// Rays of the lights alone, each with the ratio of its densities, have the frequencies of guided
// rays. So the guided density integrates to what the own one does, 1, and is that of the rays.
void ExpectFollowsDensity(const LightSetup& setup) {
  const LightEmission emission = EmissionOf(setup);
  const EmissionField field = Learn(emission, Slopes);
  ASSERT_GT(field.cell_count(), 4u);
  const GuidedEmission guided(&emission, &field), own(&emission, nullptr);
  Cells expected(setup.table->light_count() * size_t{256}), observed(expected.size());
  Cell flux, own_flux;
  const int samples = DrawCount(200000, 2000000);
  RandomPoints random(77);
  int other_pdf = 0;
  for (int i = 0; i < samples; ++i) {
    if (const auto ray = own.SampleLe(NextUniforms(&random))) {
      expected[CellOf(OriginOf(own, *ray))].Add(GuidedPdf(guided, *ray) / ray->pdf);
      own_flux.Add(static_cast<double>(ray->power.r) / ray->pdf);
    }
    if (const auto ray = guided.SampleLe(NextUniforms(&random))) {
      observed[CellOf(OriginOf(guided, *ray))].Add(1);
      flux.Add(static_cast<double>(ray->power.r) / ray->pdf);
      other_pdf += std::fabs(GuidedPdf(guided, *ray) - ray->pdf) > 1e-5 * ray->pdf;
    }
  }
  // Rounding may change the texel of a map, or the cell of a field.
  EXPECT_LE(other_pdf, samples / 1000);
  const auto variance = [&](const Cell& cell) {
    return std::max(0.0, cell.squares - cell.sum * cell.sum / samples);
  };
  double statistic = 0;
  int cells = 0;
  Cell all_expected, all_observed;
  for (size_t i = 0; i < expected.size(); ++i) {
    all_expected.sum += expected[i].sum;
    all_expected.squares += expected[i].squares;
    all_observed.sum += observed[i].sum;
    all_observed.squares += observed[i].squares;
    if (expected[i].count < 50 || observed[i].count < 50) continue;
    const double off = expected[i].sum - observed[i].sum;
    statistic += off * off / (variance(expected[i]) + variance(observed[i]));
    ++cells;
  }
  EXPECT_GT(cells, 3);
  EXPECT_GT(sheaf::testing::UpperGammaQ(0.5 * cells, 0.5 * statistic),
            sheaf::testing::SidakThreshold(1e-4, 30))
      << statistic << " in " << cells << " cells";
  EXPECT_LT(std::fabs(all_expected.sum - all_observed.sum),
            6 * std::sqrt(variance(all_expected) + variance(all_observed)) + 1e-4 * samples)
      << all_expected.sum / all_observed.sum;
  EXPECT_LT(std::fabs(flux.sum - own_flux.sum), 6 * std::sqrt(variance(flux) + variance(own_flux)))
      << flux.sum / own_flux.sum;
}

TEST(GuidedEmissionTest, RaysOfSurfacesFollowTheirPdf) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Surfaces()) {
    SCOPED_TRACE(setup.name);
    ExpectFollowsDensity(setup);
  }
}
TEST(GuidedEmissionTest, RaysOfPositionsFollowTheirPdf) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Positions()) {
    SCOPED_TRACE(setup.name);
    ExpectFollowsDensity(setup);
  }
}
TEST(GuidedEmissionTest, RaysFromInfinityFollowTheirPdf) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Infinite()) {
    SCOPED_TRACE(setup.name);
    ExpectFollowsDensity(setup);
  }
}
TEST(GuidedEmissionTest, RaysOfManyLightsFollowTheirPdf) {
  const LightSetups setups;
  ExpectFollowsDensity(setups.Mixture());
}

// The measure in which paths from the camera find the light.
TEST(GuidedEmissionTest, DensitiesKeepTheRatioOfPdfs) {
  const LightSetups setups;
  for (const LightSetup& setup : AllSetups(setups)) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    const EmissionField field = Learn(emission, Slopes);
    const GuidedEmission guided(&emission, &field), unguided(&emission, nullptr);
    RandomPoints random(5);
    int compared = 0;
    for (int i = 0; i < 1000; ++i) {
      const auto ray = guided.SampleLe(NextUniforms(&random));
      if (!ray) continue;
      const Vec3f p = ray->p + 3 * ray->w;
      const double own = emission.DensityAt(ray->light, p, ray->p, ray->n, ray->w);
      if (!(own > 0)) continue;
      ++compared;
      const double ratio = GuidedPdf(guided, *ray) / GuidedPdf(unguided, *ray);
      EXPECT_NEAR(guided.DensityAt(ray->light, p, ray->p, ray->n, ray->w) / own / ratio, 1, 1e-3);
    }
    EXPECT_GT(compared, 100);
  }
}

// --- The field -----------------------------------------------------------------------------------

TEST(GuidedEmissionTest, AFieldThatKnowsNothingChangesNoBit) {
  const LightSetups setups;
  for (const LightSetup& setup : AllSetups(setups)) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    EmissionStatistics statistics(emission);
    statistics.Begin({}, 100);
    const EmissionField field = statistics.Fit();
    EXPECT_TRUE(field.empty());
    const GuidedEmission guided(&emission, &field);
    RandomPoints random(5);
    for (int i = 0; i < 200; ++i) {
      const EmissionUniforms u = NextUniforms(&random);
      const auto ray = guided.SampleLe(u), own = emission.SampleLe(u);
      ASSERT_EQ(ray.has_value(), own.has_value());
      if (!ray) continue;
      EXPECT_EQ(ray->pdf, own->pdf);
      EXPECT_EQ(ray->p, own->p);
      EXPECT_EQ(ray->w, own->w);
    }
  }
}

// Few places bring light: most guided rays begin there, and the cells are much smaller than places
// that were seen at once.
TEST(GuidedEmissionTest, RaysBeginWhereLightIs) {
  const LightSetups setups;
  for (const LightSetup& setup : AllSetups(setups)) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    const auto brings = [&](const EmissionOrigin& origin) {
      const EmissionAxes axes = emission.AxesOf(origin.light);
      for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
        // Not at the border of a cell.
        const double u = origin.place.u[axis];
        const double side = axes.position && axes.direction ? 0.3 : 0.1;
        if (axes.Has(axis) && !(u > 0.41 && u < 0.41 + side)) return 0.0;
      }
      return 1.0;
    };
    const EmissionField field = Learn(emission, brings, 60000);
    const auto share = [&](const EmissionField& by) {
      const GuidedEmission guided(&emission, &by);
      RandomPoints random(6);
      int there = 0, rays = 0;
      for (int i = 0; i < 20000; ++i) {
        const auto ray = guided.SampleLe(NextUniforms(&random));
        if (!ray) continue;
        ++rays;
        there += brings(OriginOf(guided, *ray)) > 0;
      }
      return static_cast<double>(there) / rays;
    };
    const double before = share({});
    EXPECT_LT(before, 0.3);
    if (before == 0) continue;  // Black there.
    EXPECT_GT(share(field), std::min(0.5, 8 * before)) << before << ", " << field.cell_count();
  }
}

// The field does not depend on the order in which threads add paths, nor on the unit of light.
TEST(GuidedEmissionTest, TheFieldIsAFunctionOfThePaths) {
  const LightSetups setups;
  const LightSetup setup = setups.Mixture();
  const LightEmission emission = EmissionOf(setup);
  const auto learn = [&](double scale, bool backwards) {
    constexpr uint64_t kPaths = 5000;
    EmissionStatistics statistics(emission);
    statistics.Begin({}, kPaths);
    const GuidedEmission guided(&emission, nullptr);
    for (uint64_t i = 0; i < kPaths; ++i) {
      const uint64_t path = backwards ? kPaths - 1 - i : i;
      RandomPoints random(path);
      const auto ray = guided.SampleLe(NextUniforms(&random));
      if (!ray) continue;
      const EmissionOrigin origin = OriginOf(guided, *ray);
      statistics.Add(path, {origin, scale * Slopes(origin)});
    }
    return statistics.Fit().Encode();
  };
  const std::string field = learn(1, false);
  EXPECT_GT(field.size(), 100u);
  EXPECT_TRUE(learn(1, true) == field);
  EXPECT_TRUE(learn(0x1p40, false) == field);
  EXPECT_TRUE(learn(0x1p-40, false) == field);
  const auto decoded = EmissionField::Decode(field, emission.choice_count());
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_TRUE(decoded->Encode() == field);
}

}  // namespace
}  // namespace sheaf::render
