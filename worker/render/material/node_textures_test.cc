// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/node_textures.h"

#include <bit>
#include <cmath>
#include <string_view>

#include "common/math/elementary.h"
#include "common/math/lattice_noise.h"
#include "common/math/mix_bits.h"
#include "common/scene/node_parameters.h"
#include "gtest/gtest.h"
#include "worker/render/material/voronoi_cells.h"

namespace sheaf::render {
namespace {

// A node with its defaults but for one number.
NodeTexture Node(NodeTexture::Kind kind, std::string_view name = "", float value = 0) {
  NodeTexture node;
  node.kind = kind;
  for (const NodeParameters& known : kNodeParameters) {
    if (known.kind != kind) continue;
    for (size_t i = 0; i < known.parameters.size(); ++i) {
      node.numbers[i] = known.parameters[i].name == name ? value : known.parameters[i].fallback;
    }
  }
  return node;
}
NodeTexture With(NodeTexture node, size_t number, float value) {
  node.numbers[number] = value;
  return node;
}
using Kind = NodeTexture::Kind;
constexpr Vec3d kAt[] = {{0.31, 0.72, -0.23}, {-5.1, 2.2, 8.9}, {40.25, -3.5, 0.125}};

TEST(NodeTexturesTest, NoiseIsTheMeanOfItsOctavesByTheirAmplitudes) {
  const NodeTexture node = Node(Kind::kNoise, "detail", 1.5f);
  for (const Vec3d p : kAt) {
    double n[3];
    for (int i = 0; i < 3; ++i) n[i] = LatticeNoise(std::ldexp(5.0, i) * p);
    const double two = (n[0] + 0.5 * n[1]) / 1.5, three = (n[0] + 0.5 * n[1] + 0.25 * n[2]) / 1.75;
    EXPECT_NEAR(NodeFactor(node, p), 0.5 + 0.25 * (two + three), 1e-6);
    const Rgb color = NodeColor(node, p);
    EXPECT_EQ(color.r, NodeFactor(node, p));
    EXPECT_NE(color.g, color.r);
    EXPECT_NE(color.b, color.g);
  }
}

TEST(NodeTexturesTest, NoiseOfThePlaneIgnoresHeight) {
  const NodeTexture node = Node(Kind::kNoise, "dimensions", 2);
  EXPECT_EQ(NodeFactor(node, {0.3, 0.4, 0}), NodeFactor(node, {0.3, 0.4, 7}));
  EXPECT_NE(NodeFactor(node, {0.3, 0.4, 0}), NodeFactor(Node(Kind::kNoise), {0.3, 0.4, 0}));
}

TEST(NodeTexturesTest, MusgraveOctavesFallByTheDimension) {
  const NodeTexture node = Node(Kind::kMusgrave);  // Dimension, lacunarity and detail are 2.
  for (const Vec3d p : kAt) {
    EXPECT_NEAR(NodeFactor(node, p), LatticeNoise(5.0 * p) + 0.25 * LatticeNoise(10.0 * p), 1e-6);
    const NodeTexture ridged = With(With(node, 0, 3), 5, 0.8f);
    const double first = std::pow(static_cast<double>(0.8f) - std::fabs(LatticeNoise(5.0 * p)), 2);
    const double second =
        std::pow(static_cast<double>(0.8f) - std::fabs(LatticeNoise(10.0 * p)), 2) *
        std::fmin(first, 1);
    EXPECT_NEAR(NodeFactor(ridged, p), first + 0.25 * second, 1e-6);
  }
}

// Since Blender 4.1 noises have Musgrave's types: one octave more than the detail, a fall by the
// roughness, and a weight for what a hybrid has in part.
TEST(NodeTexturesTest, NoiseHasTypes) {
  const auto noise = [](int i, Vec3d p) { return LatticeNoise(std::ldexp(5.0, i) * p); };
  NodeTexture node = With(Node(Kind::kNoise, "detail", 1), node_number::kNoiseRoughness, 0.25f);
  node.numbers[node_number::kNoiseOffset] = 0.75f;
  const auto of_type = [&](float type) { return With(node, node_number::kNoiseType, type); };
  for (const Vec3d p : kAt) {
    const double first = noise(0, p), second = noise(1, p), third = noise(2, p);
    EXPECT_NEAR(NodeFactor(of_type(1), p), (1 + first) * (1 + 0.25 * second), 1e-6);
    EXPECT_NEAR(NodeFactor(of_type(4), p), (first + 0.75) * (1 + 0.25 * (second + 0.75)), 1e-6);
    const double ridge = std::pow(0.75 - std::fabs(first), 2);
    EXPECT_NEAR(NodeFactor(of_type(3), p),
                ridge + 0.25 * std::pow(0.75 - std::fabs(second), 2) * std::fmin(ridge, 1), 1e-6);
    const double low = first + 0.75, middle = 0.25 * (second + 0.75),
                 weight = low > 0.001 ? std::fmin(low, 1) : 0;
    EXPECT_NEAR(NodeFactor(of_type(2), p), low + weight * middle, 1e-6);
    const NodeTexture part = With(of_type(2), node_number::kNoiseDetail, 1.5f);
    const double last = weight * middle > 0.001 ? std::fmin(weight * middle, 1) : 0;
    EXPECT_NEAR(NodeFactor(part, p), low + weight * middle + 0.5 * last * 0.0625 * (third + 0.75),
                1e-6);
    EXPECT_EQ(NodeColor(of_type(1), p).r, NodeFactor(of_type(1), p));
    EXPECT_NE(NodeColor(of_type(1), p).g, NodeColor(of_type(1), p).r);
  }
  // As Musgrave's of the dimension log2(1 / roughness), but for a hybrid's part.
  NodeTexture musgrave = With(Node(Kind::kMusgrave, "detail", 2), node_number::kMusgraveType, 3);
  musgrave.numbers[node_number::kMusgraveOffset] = 0.75f;
  EXPECT_EQ(NodeFactor(musgrave, kAt[0]), NodeFactor(of_type(3), kAt[0]));
}

TEST(NodeTexturesTest, VoronoiDistancesAreThoseToTheNearestPoints) {
  VoronoiOptions f1, f2{.feature = VoronoiFeature::kF2}, edge{};
  edge.feature = VoronoiFeature::kDistanceToEdge;
  VoronoiOptions smooth{.feature = VoronoiFeature::kSmoothF1, .smoothness = 1e-6};
  for (int i = 0; i < 200; ++i) {
    const Vec3d p{i * 0.137 - 9, i * 0.311, i * -0.071};
    const double first = VoronoiCellAt(f1, {p}).distance, second = VoronoiCellAt(f2, {p}).distance;
    EXPECT_LE(first, second);
    EXPECT_LE(first, std::sqrt(3.0));
    EXPECT_NEAR(VoronoiCellAt(smooth, {p}).distance, first, 1e-5);
    // The bisector of two points is half of the difference of the distances away, at least.
    EXPECT_GE(VoronoiCellAt(edge, {p}).distance, 0.5 * (second - first) - 1e-12);
  }
}

// Without randomness the points are the corners of the lattice.
TEST(NodeTexturesTest, VoronoiMetricsMeasureTheLattice) {
  VoronoiOptions options{.exponent = 3, .randomness = 0};
  const Vec3d p{4.25, -2.125, 7.5 - 0.0625};
  const double x = 0.25, y = 0.125, z = 0.4375, w = -2.375;
  const auto distance = [&](VoronoiMetric metric) {
    options.metric = metric;
    return VoronoiCellAt(options, {p, w}).distance;
  };
  EXPECT_NEAR(distance(VoronoiMetric::kEuclidean), std::sqrt(x * x + y * y + z * z), 1e-12);
  EXPECT_NEAR(distance(VoronoiMetric::kManhattan), x + y + z, 1e-12);
  EXPECT_NEAR(distance(VoronoiMetric::kChebychev), z, 1e-12);
  EXPECT_NEAR(distance(VoronoiMetric::kMinkowski), std::cbrt(x * x * x + y * y * y + z * z * z),
              1e-12);
  options.feature = VoronoiFeature::kDistanceToEdge;
  EXPECT_NEAR(distance(VoronoiMetric::kEuclidean), 0.5 - z, 1e-12);
  options.dimensions = 2;
  EXPECT_NEAR(distance(VoronoiMetric::kEuclidean), 0.5 - x, 1e-12);
  options.dimensions = 1;
  EXPECT_NEAR(distance(VoronoiMetric::kEuclidean), 0.5 - 0.375, 1e-12);
  options.feature = VoronoiFeature::kF1;
  EXPECT_NEAR(distance(VoronoiMetric::kManhattan), 0.375, 1e-12);
  options.dimensions = 4;
  EXPECT_NEAR(distance(VoronoiMetric::kManhattan), x + y + z + 0.375, 1e-12);
  EXPECT_NEAR(VoronoiReach(options, 0.5), 2, 1e-12);
}

// Blender 4.0 and later have octaves of smaller cells, and divide by the largest distance.
TEST(NodeTexturesTest, VoronoiHasOctaves) {
  NodeTexture node = Node(Kind::kVoronoi, "detail", 1.5f);
  const auto once = [](Vec3d p) { return VoronoiCellAt({}, {p}).distance; };
  for (const Vec3d p : kAt) {
    const double sum = once(5.0 * p) + 0.5 * once(10.0 * p) + 0.5 * 0.25 * once(20.0 * p);
    EXPECT_NEAR(NodeFactor(node, p), sum, 1e-5);
    const NodeTexture normalized = With(node, node_number::kVoronoiNormalize, 1);
    EXPECT_NEAR(NodeFactor(normalized, p), sum / (1.625 * std::sqrt(3.0)), 1e-5);
    const NodeTexture edges = With(node, node_number::kVoronoiFeature, 3);
    EXPECT_LE(NodeFactor(edges, p), NodeFactor(Node(Kind::kVoronoi, "feature", 3), p) + 1e-6f);
  }
}

// In one dimension the place is w, or the place's x; in four w is the last coordinate.
TEST(NodeTexturesTest, NoiseOfOneAndFourDimensions) {
  NodeTexture node = With(Node(Kind::kNoise, "dimensions", 1), node_number::kNoiseDetail, 0);
  EXPECT_EQ(NodeFactor(node, kAt[0]), 0.5f);  // 0 at integers.
  node.numbers[node_number::kNoiseW] = 0.1f;
  EXPECT_NEAR(NodeFactor(node, kAt[0]), 0.5 + 0.5 * LatticeNoise(0.5), 1e-6);
  EXPECT_EQ(NodeFactor(node, kAt[0]), NodeFactor(node, kAt[1]));
  node.numbers[node_number::kNoiseWFrom] = 1;
  EXPECT_NEAR(NodeFactor(node, {0.3, 9, 9}), 0.5 + 0.5 * LatticeNoise(1.5), 1e-6);
  NodeTexture four = With(Node(Kind::kNoise, "dimensions", 4), node_number::kNoiseDetail, 0);
  four.numbers[node_number::kNoiseW] = 0.125f;
  EXPECT_NEAR(NodeFactor(four, kAt[0]), 0.5 + 0.5 * LatticeNoise(5.0 * kAt[0], 0.625), 1e-6);
  EXPECT_EQ(LatticeNoise(Vec3d{3, -2, 7}, 1), 0);
  // On a line through the centers of two cells the noises of two seeds differ.
  EXPECT_NE(NodeColor(four, kAt[0]).g, NodeColor(four, kAt[0]).b);
  for (const Kind kind : {Kind::kMusgrave, Kind::kVoronoi, Kind::kWhiteNoise}) {
    const NodeTexture with = Node(kind, "dimensions", 4), line = Node(kind, "dimensions", 1);
    NodeTexture moved = with;
    moved.numbers[kind == Kind::kMusgrave  ? size_t{node_number::kMusgraveW}
                  : kind == Kind::kVoronoi ? size_t{node_number::kVoronoiW}
                                           : size_t{node_number::kWhiteW}] = 0.3f;
    EXPECT_NE(NodeFactor(with, kAt[0]), NodeFactor(moved, kAt[0]));
    EXPECT_EQ(NodeFactor(line, kAt[0]), NodeFactor(line, kAt[1]));
  }
}

TEST(NodeTexturesTest, AttributesAreColorsOfVertices) {
  const auto of = [](float channel) {
    return AttributeFactor(Node(Kind::kAttribute, "channel", channel), {0.1f, 0.4f, 0.7f, 0.9f});
  };
  EXPECT_FLOAT_EQ(of(0), 0.2126f * 0.1f + 0.7152f * 0.4f + 0.0722f * 0.7f);
  EXPECT_FLOAT_EQ(of(1), 0.4f);
  EXPECT_EQ(of(2), 0.1f);
  EXPECT_EQ(of(4), 0.7f);
  EXPECT_EQ(of(5), 0.9f);
}

TEST(NodeTexturesTest, WavesAreBandsOrRingsOfTheirProfile) {
  const NodeTexture bands = Node(Kind::kWave);
  EXPECT_NEAR(NodeFactor(bands, {0.2, 9, 9}), 0.5 - 0.5 * std::cos(20.0), 1e-4);
  const NodeTexture rings = With(With(bands, 0, 1), 1, 3);
  EXPECT_NEAR(NodeFactor(rings, {0.12, 0, 0.16}), 0.5 - 0.5 * std::cos(20.0), 1e-4);
  const double turns = 20 / (2 * kPi);
  EXPECT_NEAR(NodeFactor(With(bands, 2, 1), {0.2, 0, 0}), turns - 3, 1e-4);
  EXPECT_NEAR(NodeFactor(With(bands, 2, 2), {0.2, 0, 0}), 2 * (turns - 3), 1e-4);
}

TEST(NodeTexturesTest, MagicIsSinesOfSums) {
  const NodeTexture node = With(Node(Kind::kMagic), 0, 0);
  const Rgb c = NodeColor(node, {0.1, 0.2, 0.3});
  EXPECT_NEAR(c.r, 0.5 - 0.5 * std::sin(15.0), 1e-5);
  EXPECT_NEAR(c.g, 0.5 - 0.5 * std::cos(-5.0), 1e-5);
  EXPECT_NEAR(c.b, 0.5 + 0.5 * std::cos(0.0), 1e-5);
  EXPECT_NEAR(NodeFactor(node, {0.1, 0.2, 0.3}), (c.r + c.g + c.b) / 3, 1e-6);
}

// At scale 5, bricks are 0.1 by 0.05, and rows of even numbers are moved by half a brick.
TEST(NodeTexturesTest, BricksLieInRows) {
  const NodeTexture node = With(Node(Kind::kBrick), 2, 0);
  EXPECT_EQ(NodeFactor(node, {0.1, 0.025, 0}), 0);
  EXPECT_EQ(NodeFactor(node, {0.05, 0.025, 0}), 1);
  EXPECT_EQ(NodeFactor(node, {0.05, 0.075, 0}), 0);
  EXPECT_EQ(NodeFactor(node, {0.05, 0.051, 0}), 1);
  const NodeTexture tint = With(node, 10, 1);
  EXPECT_EQ(NodeFactor(tint, {0.06, 0.01, 0}), NodeFactor(tint, {0.14, 0.04, 0}));
  EXPECT_NE(NodeFactor(tint, {0.06, 0.01, 0}), NodeFactor(tint, {0.16, 0.01, 0}));
}

TEST(NodeTexturesTest, GradientsHaveTheirForms) {
  const auto at = [](int type, Vec3d p) {
    return NodeFactor(With(Node(Kind::kGradient), 0, static_cast<float>(type)), p);
  };
  EXPECT_FLOAT_EQ(at(0, {0.25, 9, 9}), 0.25f);
  EXPECT_FLOAT_EQ(at(0, {-2, 0, 0}), 0);
  EXPECT_FLOAT_EQ(at(1, {0.5, 0, 0}), 0.25f);
  EXPECT_FLOAT_EQ(at(2, {0.25, 0, 0}), 0.15625f);
  EXPECT_FLOAT_EQ(at(3, {0.25, 0.5, 0}), 0.375f);
  EXPECT_FLOAT_EQ(at(4, {0, 1, 0}), 0.75f);
  EXPECT_NEAR(at(5, {0.5, 0, 0}), 0.25, 1e-5);
  EXPECT_NEAR(at(6, {0, 0.75, 0}), 0.25, 1e-5);
}

TEST(NodeTexturesTest, BadPlacesGiveNumbersOfEveryNode) {
  for (const NodeParameters& known : kNodeParameters) {
    const NodeTexture node = Node(known.kind);
    for (const double bad : {std::nan(""), 1e300, -1e300}) {
      const Vec3d p{bad, bad, 0.5};
      EXPECT_TRUE(std::isfinite(NodeFactor(node, p))) << known.name;
      EXPECT_TRUE(std::isfinite(NodeColor(node, p).b)) << known.name;
    }
    EXPECT_GT(NodeFrequency(node), 0) << known.name;
    EXPECT_GE(NodeOctaves(node), known.kind == Kind::kAttribute ? 0 : 1) << known.name;
  }
}

}  // namespace
}  // namespace sheaf::render
