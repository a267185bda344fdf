// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/techniques.h"

#include <algorithm>
#include <iterator>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf {
namespace {

// The first word of names, but of those with Technique::kLightPathsAlone.
constexpr char kCameraWord[] = "camera";

struct TechniqueRow {
  Technique technique;
  const char* word;           // In names; empty for Technique::kLightPathsAlone.
  TechniqueSet needs;         // Other techniques.
  bool needs_camera = false;  // Not beside Technique::kLightPathsAlone.
};

constexpr TechniqueRow kTechniques[] = {
    {Technique::kLightPaths, "light", {}},
    {Technique::kLightPathsAlone, "", {Technique::kLightPaths}},
    {Technique::kGuiding, "guiding", {}, true},
    {Technique::kSplitting, "splitting", {Technique::kGuiding}, true},
    {Technique::kMerging, "merging", {Technique::kLightPaths}},
    {Technique::kEmissionGuiding, "emission-guiding", {Technique::kLightPaths}},
    {Technique::kSharing, "sharing", {}, true},
    {Technique::kViews, "views", {Technique::kSharing}, true},
    {Technique::kLearnedLights, "learned-lights", {}, true},
    {Technique::kProduct, "product", {}, true},
    {Technique::kMutations, "mutations", {}, true},
    {Technique::kChains, "chains", {}, true},
};

// The first thing that a technique of the set needs and lacks; both are words of names.
struct Lack {
  const char* word;
  const char* needs;
};
std::optional<Lack> LackOf(TechniqueSet set) {
  for (const TechniqueRow& row : kTechniques) {
    if (!set.Has(row.technique)) continue;
    for (const TechniqueRow& other : kTechniques) {
      if (row.needs.Has(other.technique) && !set.Has(other.technique)) {
        return Lack{row.word, other.word};
      }
    }
    if (row.needs_camera && set.Has(Technique::kLightPathsAlone)) {
      return Lack{row.word, kCameraWord};
    }
  }
  return std::nullopt;
}

const TechniqueRow* RowOfWord(const std::string& word) {
  const auto* const row = std::ranges::find_if(kTechniques, [&word](const TechniqueRow& candidate) {
    return *candidate.word != 0 && absl::EqualsIgnoreCase(candidate.word, word);
  });
  return row == std::end(kTechniques) ? nullptr : row;
}

absl::Status LackError(const std::string& name, const Lack& lack, TechniqueSet possible) {
  return absl::InvalidArgumentError(absl::StrCat("\"", name, "\": ", lack.word, " needs ",
                                                 lack.needs, "; give ", possible.Name()));
}

}  // namespace

TechniqueSet TechniqueSet::With(Technique technique) const {
  TechniqueSet set = *this;
  set.Add(BitOf(technique));
  while (LackOf(set)) {
    for (const TechniqueRow& row : kTechniques) {
      if (!set.Has(row.technique)) continue;
      set.Add(row.needs.bits_);
      if (row.needs_camera) set.Remove(Technique::kLightPathsAlone);
    }
  }
  return set;
}

TechniqueSet TechniqueSet::Without(Technique technique) const {
  TechniqueSet set = *this;
  set.Remove(technique);
  for (size_t i = 0; i < std::size(kTechniques); ++i) {
    for (const TechniqueRow& row : kTechniques) {
      if (!set.HasAll(row.needs)) set.Remove(row.technique);
    }
  }
  return set;
}

std::string TechniqueSet::Name() const {
  std::string name;
  const auto add = [&name](const char* word) {
    absl::StrAppend(&name, name.empty() ? "" : "+", word);
  };
  if (!Has(Technique::kLightPathsAlone)) add(kCameraWord);
  for (const TechniqueRow& row : kTechniques) {
    if (Has(row.technique) && *row.word != 0) add(row.word);
  }
  return name;
}

absl::StatusOr<TechniqueSet> TechniqueSet::Parse(const std::string& name) {
  TechniqueSet set;
  bool has_camera = false;
  for (const std::string& word : std::vector<std::string>(absl::StrSplit(name, '+'))) {
    if (absl::EqualsIgnoreCase(word, kCameraWord)) {
      has_camera = true;
    } else if (const TechniqueRow* const row = RowOfWord(word); row != nullptr) {
      set.Add(BitOf(row->technique));
    } else {
      return absl::NotFoundError(absl::StrCat("no technique is named \"", word, "\""));
    }
  }
  TechniqueSet possible = set;
  if (!has_camera && set.Has(Technique::kLightPaths)) set.Add(BitOf(Technique::kLightPathsAlone));
  for (const TechniqueRow& row : kTechniques) {
    if (set.Has(row.technique)) possible = possible.With(row.technique);
  }
  if (const std::optional<Lack> lack = LackOf(set)) return LackError(name, *lack, possible);
  const auto* const first = std::ranges::find_if(
      kTechniques, [set](const TechniqueRow& row) { return set.Has(row.technique); });
  if (!has_camera && !set.Has(Technique::kLightPaths)) {
    return LackError(name, {first->word, kCameraWord}, possible);
  }
  return set;
}

std::optional<TechniqueSet> TechniqueSet::FromNumber(int64_t number) {
  TechniqueSet set;
  if (number >= 0 && number < std::ssize(kNumberedTechniques)) return kNumberedTechniques[number];
  if (number < kNumberOfBits || number - kNumberOfBits >= int64_t{1} << std::size(kTechniques)) {
    return std::nullopt;
  }
  set.Add(static_cast<uint32_t>(number - kNumberOfBits));
  // A set of the constants has one number alone.
  if (LackOf(set) || set.Number() != number) return std::nullopt;
  return set;
}

std::vector<TechniqueSet> TechniqueSet::All() {
  std::vector<TechniqueSet> sets;
  for (int number = 0; number < kNumberOfBits + (1 << std::size(kTechniques)); ++number) {
    if (const std::optional<TechniqueSet> set = FromNumber(number)) sets.push_back(*set);
  }
  return sets;
}

std::vector<std::string> TechniquesNames() {
  std::vector<std::string> names;
  for (const TechniqueSet set : TechniqueSet::All()) names.push_back(set.Name());
  return names;
}

TechniqueSet TechniquesOfIntegrator(const std::string& integrator) {
  if (integrator == "bdpt" || integrator == "mlt") return TechniqueSet::kCameraAndLight;
  // Files ask for photon maps to see caustics in mirrors and through glass, which light paths find
  // by merging alone.
  if (integrator == "sppm") return TechniqueSet::kCameraAndLight.With(Technique::kMerging);
  return integrator == "lightpath" ? TechniqueSet::kLight : TechniqueSet::kCamera;
}

}  // namespace sheaf
