// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TechniqueSet: the ways in which the integrator finds paths between lights and the camera. All
// but merging have the same mean; they differ in noise and cost (docs/adr/0063, 0126, 0130).
// Thread-safe.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

// A technique that is added to paths from the camera. The numbers are those of bits in messages and
// in stored jobs (TechniqueSet::Number). A new technique needs a line here and one in the table
// kTechniques, with its word in names and what it needs.
enum class Technique : uint8_t {
  // Light paths too: those that begin at lights and are connected to the camera. Both kinds are
  // combined by multiple importance sampling.
  kLightPaths = 0,
  // Light paths find all light that they can find, and camera paths only the rest: light seen
  // directly or by specular scattering alone. Names lack the word "camera".
  kLightPathsAlone = 1,
  // Path guiding: camera paths sample directions from a learned field of the light that arrives,
  // beside their BSDFs.
  kGuiding = 2,
  // Camera paths are split: several leave a vertex, where the field knows that what they find
  // matters to the pixel and is uncertain.
  kSplitting = 3,
  // Light paths are merged with camera paths at the first rough vertex behind specular ones, within
  // a radius that shrinks with the samples. This blurs the light: it alone changes the mean.
  kMerging = 4,
  // Light paths begin where light reaches the picture, by a learned field of what they brought.
  kEmissionGuiding = 5,
  // A camera path counts in all pixels whose filters cover its point on the film, not in one.
  // Frames have it beside no other technique but kViews (path_shares.h).
  kSharing = 6,
  // Camera paths are shared by several views: points of the lens, and times of the shutter.
  kViews = 7,
  // Light samples go by rows of a learned field: which lights are hidden from a region, and which
  // bring more or less than estimates say. Guided frames learn less of them (docs/adr/0190).
  kLearnedLights = 8,
  // Light samples go by the product of a light's estimate and a sketch of how the surface reflects
  // (docs/adr/0240). Beside light paths it does nothing: ChoosesByProduct.
  kProduct = 9,
  // Camera samples far brighter than their region start chains of mutations, which spread them over
  // similar paths. Frames have it beside no other technique (path_shares.h).
  kMutations = 10,
  // Vertices of camera paths are connected to small lamps through one to four smooth interfaces, by
  // walks to the chains of mirror directions and refractions between them. Frames have it beside no
  // other technique (CheckChains).
  kChains = 11,
};

// The techniques of a frame: paths from the camera and what is added to them.
class TechniqueSet {
 public:
  // The sets that messages and stored jobs number from 0 on, in this order.
  static const TechniqueSet kCamera, kCameraAndLight, kLight, kCameraGuided, kCameraAndLightGuided,
      kCameraGuidedSplit, kCameraAndLightGuidedSplit;

  constexpr TechniqueSet() = default;  // Paths from the camera alone.
  // Requires: each has what it needs.
  constexpr TechniqueSet(std::initializer_list<Technique> techniques) {
    for (const Technique technique : techniques) Add(BitOf(technique));
  }

  constexpr bool Has(Technique technique) const { return (bits_ & BitOf(technique)) != 0; }
  constexpr bool HasAll(TechniqueSet other) const { return (other.bits_ & ~uint32_t{bits_}) == 0; }
  // The same with the technique and what it needs.
  TechniqueSet With(Technique technique) const;
  // The same without the technique and without those that need it.
  TechniqueSet Without(Technique technique) const;

  // "camera", "camera+light", "light", "camera+guiding", "camera+light+guiding",
  // "camera+guiding+splitting", ...: the words in the order of the table.
  std::string Name() const;
  // Takes the words in any order, ignoring case. Errors: kNotFound for words that name no
  // technique; kInvalidArgument, with a name that can be, for techniques that lack what they need.
  static absl::StatusOr<TechniqueSet> Parse(const std::string& name);

  // In messages and stored jobs: that of one of the constants, else kNumberOfBits + the bits.
  static constexpr int kNumberOfBits = 16;
  constexpr int Number() const;
  // Nothing for numbers that no set of this version has.
  static std::optional<TechniqueSet> FromNumber(int64_t number);

  // All sets that can be, in the order of their numbers.
  static std::vector<TechniqueSet> All();

  friend constexpr bool operator==(TechniqueSet a, TechniqueSet b) = default;

 private:
  static constexpr uint32_t BitOf(Technique technique) {
    return uint32_t{1} << static_cast<int>(technique);
  }

  constexpr void Add(uint32_t bits) { bits_ = static_cast<uint16_t>(bits_ | bits); }
  constexpr void Remove(Technique technique) {
    bits_ = static_cast<uint16_t>(bits_ & ~BitOf(technique));
  }

  uint16_t bits_ = 0;
};

inline constexpr TechniqueSet TechniqueSet::kCamera;
inline constexpr TechniqueSet TechniqueSet::kCameraAndLight{Technique::kLightPaths};
inline constexpr TechniqueSet TechniqueSet::kLight{Technique::kLightPaths,
                                                   Technique::kLightPathsAlone};
inline constexpr TechniqueSet TechniqueSet::kCameraGuided{Technique::kGuiding};
inline constexpr TechniqueSet TechniqueSet::kCameraAndLightGuided{Technique::kLightPaths,
                                                                  Technique::kGuiding};
inline constexpr TechniqueSet TechniqueSet::kCameraGuidedSplit{Technique::kGuiding,
                                                               Technique::kSplitting};
inline constexpr TechniqueSet TechniqueSet::kCameraAndLightGuidedSplit{
    Technique::kLightPaths, Technique::kGuiding, Technique::kSplitting};

inline constexpr TechniqueSet kNumberedTechniques[] = {
    TechniqueSet::kCamera,
    TechniqueSet::kCameraAndLight,
    TechniqueSet::kLight,
    TechniqueSet::kCameraGuided,
    TechniqueSet::kCameraAndLightGuided,
    TechniqueSet::kCameraGuidedSplit,
    TechniqueSet::kCameraAndLightGuidedSplit,
};

constexpr int TechniqueSet::Number() const {
  for (size_t i = 0; i < std::size(kNumberedTechniques); ++i) {
    if (kNumberedTechniques[i] == *this) return static_cast<int>(i);
  }
  return kNumberOfBits + static_cast<int>(bits_);
}

// Whether paths begin at lights too; otherwise the image is that of camera paths alone.
constexpr bool HasLightPaths(TechniqueSet techniques) {
  return techniques.Has(Technique::kLightPaths);
}
// Whether camera paths are guided by a learned field.
constexpr bool IsGuided(TechniqueSet techniques) { return techniques.Has(Technique::kGuiding); }
// Whether camera paths are split.
constexpr bool SplitsPaths(TechniqueSet techniques) {
  return techniques.Has(Technique::kSplitting);
}

// Whether light paths are merged with camera paths.
constexpr bool MergesLightPaths(TechniqueSet techniques) {
  return techniques.Has(Technique::kMerging);
}
// Whether the beginnings of light paths are guided by a learned field.
constexpr bool GuidesEmission(TechniqueSet techniques) {
  return techniques.Has(Technique::kEmissionGuiding);
}
// Whether camera paths count in all pixels whose filters cover them.
constexpr bool SharesPaths(TechniqueSet techniques) { return techniques.Has(Technique::kSharing); }
// Whether bright camera samples are spread over chains of mutations.
constexpr bool MutatesPaths(TechniqueSet techniques) {
  return techniques.Has(Technique::kMutations);
}
// Whether several views share a camera path.
constexpr bool SharesViews(TechniqueSet techniques) { return techniques.Has(Technique::kViews); }
// Whether regions learn which lights to sample, in cuts of the light tree.
constexpr bool LearnsLights(TechniqueSet techniques) {
  return techniques.Has(Technique::kLearnedLights);
}
// Whether camera paths choose lights by what the surface reflects of them. Not beside light paths:
// these weigh the light samples of a camera path at a vertex before they know from where the camera
// sees it, on which the choice depends.
constexpr bool ChoosesByProduct(TechniqueSet techniques) {
  return techniques.Has(Technique::kProduct) && !HasLightPaths(techniques);
}
// Whether camera paths are connected to lamps through smooth interfaces.
constexpr bool HasChains(TechniqueSet techniques) { return techniques.Has(Technique::kChains); }
// Whether fields are learned before the first sample.
constexpr bool NeedsTraining(TechniqueSet techniques) {
  return IsGuided(techniques) || GuidesEmission(techniques) || LearnsLights(techniques);
}

// The names of all sets, in the order of their numbers.
std::vector<std::string> TechniquesNames();

// The techniques of pbrt-v4's integrator of this name; kCamera for unknown names.
TechniqueSet TechniquesOfIntegrator(const std::string& integrator);

}  // namespace sheaf
