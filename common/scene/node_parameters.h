// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The parameters of Blender's texture nodes (NodeTexture): names, defaults and ranges, in the order
// of NodeTexture::numbers. Sources: the manual of Blender 4.3, and the values of its nodes.
#pragma once

#include <array>
#include <string_view>

#include "common/scene/pattern_textures.h"

namespace sheaf {

struct NodeParameter {
  std::string_view name;
  float fallback = 0, least = 0, greatest = 0;
  // For a choice, whose number is the place in the list: its words, separated by spaces.
  std::string_view words = {};
};
struct NodeParameters {
  NodeTexture::Kind kind;
  std::string_view name;                                        // In scene files.
  std::array<NodeParameter, NodeTexture::kNumbers> parameters;  // Names of unused ones are empty.
};

inline constexpr float kNodeNumberMax = 1e6f, kNodeDetailMax = 15;
inline constexpr NodeParameter kNodeScale = {"scale", 5, -kNodeNumberMax, kNodeNumberMax};
inline constexpr NodeParameter kNodeDetail = {"detail", 2, 0, kNodeDetailMax};
inline constexpr NodeParameter kNodeRoughness = {"roughness", 0.5f, 0, kNodeNumberMax};
inline constexpr NodeParameter kNodeDistortion = {"distortion", 0, -kNodeNumberMax, kNodeNumberMax};
inline constexpr NodeParameter kNodeDimensions = {"dimensions", 3, 1, 4};
// How the octaves of a noise are joined.
inline constexpr NodeParameter kNodeFractal = {"type", 0, 0, 4,
                                               "fbm multifractal hybrid ridged hetero"};
inline constexpr NodeParameter kNodeOffset = {"offset", 0, -kNodeNumberMax, kNodeNumberMax};
inline constexpr NodeParameter kNodeGain = {"gain", 1, 0, kNodeNumberMax};
// The place in one dimension, and the fourth coordinate in four; "x" is that of the place.
inline constexpr NodeParameter kNodeW = {"w", 0, -kNodeNumberMax, kNodeNumberMax};
inline constexpr NodeParameter kNodeWFrom = {"w_from", 0, 0, 1, "value x"};

namespace node_number {
enum Noise {
  kNoiseDimensions,
  kNoiseScale,
  kNoiseDetail,
  kNoiseRoughness,
  kNoiseLacunarity,
  kNoiseDistortion,
  kNoiseNormalize,
  kNoiseW,
  kNoiseWFrom,
  kNoiseType,
  kNoiseOffset,
  kNoiseGain
};
enum Musgrave {
  kMusgraveType,
  kMusgraveScale,
  kMusgraveDetail,
  kMusgraveDimension,
  kMusgraveLacunarity,
  kMusgraveOffset,
  kMusgraveGain,
  kMusgraveDimensions,
  kMusgraveW,
  kMusgraveWFrom
};
enum Voronoi {
  kVoronoiDimensions,
  kVoronoiFeature,
  kVoronoiMetric,
  kVoronoiScale,
  kVoronoiSmoothness,
  kVoronoiExponent,
  kVoronoiRandomness,
  kVoronoiDetail,
  kVoronoiRoughness,
  kVoronoiLacunarity,
  kVoronoiNormalize,
  kVoronoiW,
  kVoronoiWFrom
};
enum Wave {
  kWaveType,
  kWaveDirection,
  kWaveProfile,
  kWaveScale,
  kWaveDistortion,
  kWaveDetail,
  kWaveDetailScale,
  kWaveDetailRoughness,
  kWavePhase
};
enum Magic { kMagicDepth, kMagicScale, kMagicDistortion };
enum Brick {
  kBrickScale,
  kBrickMortarSize,
  kBrickMortarSmooth,
  kBrickBias,
  kBrickWidth,
  kBrickRowHeight,
  kBrickOffset,
  kBrickOffsetFrequency,
  kBrickSquash,
  kBrickSquashFrequency,
  kBrickOutput
};
enum Gradient { kGradientType };
enum White { kWhiteDimensions, kWhiteW, kWhiteWFrom };
enum Attribute { kAttributeChannel };
enum AttributeChannel { kLuminance, kMeanColor, kRed, kGreen, kBlue, kAlpha };
}  // namespace node_number

inline constexpr std::array<NodeParameters, 9> kNodeParameters = {{
    {NodeTexture::Kind::kNoise,
     "noise",
     {{kNodeDimensions,
       kNodeScale,
       kNodeDetail,
       kNodeRoughness,
       {"lacunarity", 2, 0, kNodeNumberMax},
       kNodeDistortion,
       {"normalize", 1, 0, 1},
       kNodeW,
       kNodeWFrom,
       kNodeFractal,
       kNodeOffset,
       kNodeGain}}},
    {NodeTexture::Kind::kMusgrave,
     "musgrave",
     {{kNodeFractal,
       kNodeScale,
       kNodeDetail,
       {"dimension", 2, 1e-5f, kNodeNumberMax},
       {"lacunarity", 2, 1e-5f, kNodeNumberMax},
       kNodeOffset,
       kNodeGain,
       kNodeDimensions,
       kNodeW,
       kNodeWFrom}}},
    {NodeTexture::Kind::kVoronoi,
     "voronoi",
     {{kNodeDimensions,
       {"feature", 0, 0, 3, "f1 f2 smooth_f1 distance_to_edge"},
       {"metric", 0, 0, 3, "euclidean manhattan chebychev minkowski"},
       kNodeScale,
       {"smoothness", 1, 0, 1},
       {"exponent", 0.5f, 0.01f, 32},
       {"randomness", 1, 0, 1},
       {"detail", 0, 0, kNodeDetailMax},
       {"roughness", 0.5f, 0, 1},
       {"lacunarity", 2, 1e-5f, kNodeNumberMax},
       {"normalize", 0, 0, 1},
       kNodeW,
       kNodeWFrom}}},
    {NodeTexture::Kind::kWave,
     "wave",
     {{{"type", 0, 0, 1, "bands rings"},
       {"direction", 0, 0, 3, "x y z diagonal"},
       {"profile", 0, 0, 2, "sine saw triangle"},
       kNodeScale,
       kNodeDistortion,
       kNodeDetail,
       {"detail_scale", 1, -kNodeNumberMax, kNodeNumberMax},
       {"detail_roughness", 0.5f, 0, kNodeNumberMax},
       {"phase", 0, -kNodeNumberMax, kNodeNumberMax}}}},
    {NodeTexture::Kind::kMagic,
     "magic",
     {{{"depth", 2, 0, 10}, kNodeScale, {"distortion", 1, -kNodeNumberMax, kNodeNumberMax}}}},
    {NodeTexture::Kind::kBrick,
     "brick",
     {{kNodeScale,
       {"mortar_size", 0.02f, 0, kNodeNumberMax},
       {"mortar_smooth", 0.1f, 0, kNodeNumberMax},
       {"bias", 0, -1, 1},
       {"brick_width", 0.5f, 1e-5f, kNodeNumberMax},
       {"row_height", 0.25f, 1e-5f, kNodeNumberMax},
       {"offset", 0.5f, -kNodeNumberMax, kNodeNumberMax},
       {"offset_frequency", 2, 1, 99},
       {"squash", 1, 1e-5f, 99},
       {"squash_frequency", 2, 1, 99},
       {"output", 0, 0, 1, "mortar tint"}}}},
    {NodeTexture::Kind::kGradient,
     "gradient",
     {{{"type", 0, 0, 6, "linear quadratic easing diagonal radial quadratic_sphere spherical"}}}},
    {NodeTexture::Kind::kWhiteNoise, "white_noise", {{kNodeDimensions, kNodeW, kNodeWFrom}}},
    {NodeTexture::Kind::kAttribute,
     "attribute",
     {{{"channel", 0, 0, 5, "luminance mean red green blue alpha"}}}},
}};

}  // namespace sheaf
