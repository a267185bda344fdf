// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film_outputs.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <iterator>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/film/denoised_output.h"
#include "common/film/light_path_kind.h"
#include "common/film/task_kind.h"

namespace sheaf {
namespace {

struct AovRow {
  const char* name;
  const char* channels[3];  // Null after the last.
  bool is_direction;
};
// In the order of Aov.
constexpr AovRow kAovs[kAovCount] = {{"position", {"P.X", "P.Y", "P.Z"}, false},
                                     {"normal-geometric", {"N.X", "N.Y", "N.Z"}, true},
                                     {"normal-shading", {"Ns.X", "Ns.Y", "Ns.Z"}, true},
                                     {"uv", {"u", "v", nullptr}, false},
                                     {"motion", {"motion.X", "motion.Y", nullptr}, false}};
// In the order of IdKind.
constexpr const char* kIdKinds[kIdKindCount] = {"object", "material", "asset"};
constexpr char kIdSuffix[] = "-id";
constexpr const char* kAlwaysThere[] = {"albedo", "normal", "depth"};
constexpr char kCameraSpace[] = "space:camera";
constexpr char kLightPrefix[] = "light:";
constexpr char kLightPaths[] = "light-paths";
constexpr char kDenoisedWord[] = "denoised";
constexpr char kMergeBiasWord[] = "merge-bias";
constexpr char kCryptomatteWord[] = "cryptomatte:";
// Layers of every image and part, in lower case.
constexpr const char* kReservedLayers[] = {
    "albedo",        "normal",           "depth", "stderr", "lo", "p", "n",   "ns",   "motion",
    "samples",       "weight",           "r",     "g",      "b",  "a", "ids", "rest", "denoised",
    "denoisederror", "denoised_external"};

size_t ChannelCountOf(const AovRow& row) { return row.channels[2] != nullptr ? 3 : 2; }

bool AddAov(std::string_view name, FilmOutputs* outputs) {
  for (size_t i = 0; i < kAovCount; ++i) {
    if (name != kAovs[i].name) continue;
    outputs->Add(static_cast<Aov>(i));
    return true;
  }
  return false;
}

bool AddIdNumber(std::string_view name, FilmOutputs* outputs) {
  for (size_t i = 0; i < kIdKindCount; ++i) {
    if (name != absl::StrCat(kIdKinds[i], kIdSuffix)) continue;
    outputs->AddIdNumber(static_cast<IdKind>(i));
    return true;
  }
  return false;
}

bool AddCryptomatte(std::string_view name, FilmOutputs* outputs) {
  for (size_t i = 0; i < kIdKindCount; ++i) {
    if (name != kIdKinds[i]) continue;
    outputs->AddCryptomatte(static_cast<IdKind>(i));
    return true;
  }
  return false;
}

// Whether this is a part's name of a replicate: "r00" etc.
bool IsReplicateLayer(std::string_view name) {
  return name.size() == 3 && name[0] == 'r' && absl::ascii_isdigit(name[1]) &&
         absl::ascii_isdigit(name[2]);
}

}  // namespace

std::string WhyNotLightGroup(std::string_view name) {
  constexpr size_t kNameBytesMax = 64;
  const auto is_allowed = [](char c) { return absl::ascii_isalnum(c) || c == '_' || c == '-'; };
  if (name.empty() || name.size() > kNameBytesMax ||
      !std::all_of(name.begin(), name.end(), is_allowed)) {
    return absl::StrCat("is not a name of a light group: 1 to ", kNameBytesMax,
                        " letters, digits, \"_\" and \"-\"");
  }
  const std::string small = absl::AsciiStrToLower(std::string(name));
  const bool reserved = std::find(std::begin(kReservedLayers), std::end(kReservedLayers), small) !=
                            std::end(kReservedLayers) ||
                        IsReplicateLayer(small) || small.starts_with("crypto");
  return reserved ? "is the name of other channels; choose another name for the light group" : "";
}

std::vector<std::string> LightPathLayers() {
  std::vector<std::string> layers;
  for (const LightPathName& kind : kLightPathNames) layers.emplace_back(kind.name);
  return layers;
}

void FilmOutputs::AddLightPaths() {
  light_paths = true;
  light_groups = LightPathLayers();
}

std::vector<MeanChannel> MeanChannelsOf(const FilmOutputs& outputs) {
  std::vector<MeanChannel> channels;
  for (size_t i = 0; i < kAovCount; ++i) {
    if (!outputs.Has(static_cast<Aov>(i))) continue;
    for (size_t k = 0; k < ChannelCountOf(kAovs[i]); ++k) {
      channels.push_back({kAovs[i].channels[k], true, kAovs[i].is_direction && k == 0, false});
    }
  }
  if (HasDenoised(outputs)) {
    for (const char* guide : kGuideChannels) {
      channels.push_back({absl::StrCat("even.", guide), false, false, false});
    }
  }
  for (const std::string& group : outputs.light_groups) {
    for (const char* component : {".R", ".G", ".B"}) {
      channels.push_back({group + component, false, false, component[1] == 'R'});
    }
  }
  if (HasMergeBias(outputs)) {
    for (const auto& channel_of : {MergeBiasChannel, EvenMergeBiasChannel}) {
      for (const char* component : {"R", "G", "B"}) {
        channels.push_back({channel_of(component), false, false, component[0] == 'R'});
      }
    }
  }
  return channels;
}

size_t MeanChannelCount(const FilmOutputs& outputs) {
  size_t count = 3 * outputs.light_groups.size();
  for (size_t i = 0; i < kAovCount; ++i) {
    if (outputs.Has(static_cast<Aov>(i))) count += ChannelCountOf(kAovs[i]);
  }
  if (HasDenoised(outputs)) count += kGuideCount;
  if (HasMergeBias(outputs)) count += kMergeBiasMeanCount;
  return count;
}

size_t FirstGuideMean(const FilmOutputs& outputs) {
  if (!HasDenoised(outputs)) return SIZE_MAX;
  const size_t behind =
      3 * outputs.light_groups.size() + (HasMergeBias(outputs) ? kMergeBiasMeanCount : 0);
  return MeanChannelCount(outputs) - behind - kGuideCount;
}

const char* AovName(Aov aov) { return kAovs[static_cast<size_t>(aov)].name; }

absl::Status AddAovs(std::string_view names, FilmOutputs* outputs) {
  for (const std::string& name :
       static_cast<std::vector<std::string>>(absl::StrSplit(std::string(names), ','))) {
    bool known = AddAov(name, outputs) || AddIdNumber(name, outputs);
    for (const char* there : kAlwaysThere) known |= name == there;
    if (known) continue;
    std::vector<std::string> all;
    for (const AovRow& row : kAovs) all.emplace_back(row.name);
    for (const char* kind : kIdKinds) all.push_back(absl::StrCat(kind, kIdSuffix));
    for (const char* there : kAlwaysThere) all.emplace_back(there);
    return absl::InvalidArgumentError(absl::StrCat(
        "\"", name, "\" is not an output; the outputs are ", absl::StrJoin(all, ", ")));
  }
  return absl::OkStatus();
}

const char* IdKindName(IdKind kind) { return kIdKinds[static_cast<size_t>(kind)]; }

std::string IdNumberChannel(IdKind kind) { return absl::StrCat(IdKindName(kind), "Id"); }

absl::Status AddCryptomattes(std::string_view names, FilmOutputs* outputs) {
  for (const std::string& name :
       static_cast<std::vector<std::string>>(absl::StrSplit(std::string(names), ','))) {
    if (AddCryptomatte(name, outputs)) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "\"", name, "\" has no cryptomatte; the cryptomattes are ", absl::StrJoin(kIdKinds, ", ")));
  }
  return absl::OkStatus();
}

std::string FormatOutputs(const FilmOutputs& outputs) {
  std::vector<std::string> words;
  for (size_t i = 0; i < kAovCount; ++i) {
    if (outputs.Has(static_cast<Aov>(i))) words.emplace_back(kAovs[i].name);
  }
  for (size_t i = 0; i < kIdKindCount; ++i) {
    if (outputs.HasIdNumber(static_cast<IdKind>(i))) {
      words.push_back(absl::StrCat(kIdKinds[i], kIdSuffix));
    }
  }
  for (size_t i = 0; i < kIdKindCount; ++i) {
    if (outputs.HasCryptomatte(static_cast<IdKind>(i))) {
      words.push_back(absl::StrCat(kCryptomatteWord, kIdKinds[i]));
    }
  }
  if (outputs.camera_space) words.emplace_back(kCameraSpace);
  if (HasDenoised(outputs)) words.emplace_back(kDenoisedWord);
  if (HasMergeBias(outputs)) words.emplace_back(kMergeBiasWord);
  if (outputs.light_paths) {
    words.emplace_back(kLightPaths);
  } else {
    for (const std::string& group : outputs.light_groups) words.push_back(kLightPrefix + group);
  }
  return absl::StrJoin(words, ",");
}

absl::StatusOr<FilmOutputs> ParseOutputs(std::string_view text) {
  FilmOutputs outputs;
  if (text.empty()) return outputs;
  for (const std::string& word :
       static_cast<std::vector<std::string>>(absl::StrSplit(std::string(text), ','))) {
    if (word == kCameraSpace) {
      outputs.camera_space = true;
    } else if (word == kDenoisedWord) {
      AddDenoised(&outputs);
    } else if (word == kMergeBiasWord) {
      AddMergeBias(&outputs);
    } else if (word == kLightPaths) {
      outputs.AddLightPaths();
    } else if (word.starts_with(kLightPrefix)) {
      outputs.light_groups.push_back(word.substr(std::strlen(kLightPrefix)));
      const std::string why_not = WhyNotLightGroup(outputs.light_groups.back());
      if (!why_not.empty()) return absl::InvalidArgumentError(absl::StrCat(word, " ", why_not));
    } else if (word.starts_with(kCryptomatteWord)) {
      if (!AddCryptomatte(word.substr(std::strlen(kCryptomatteWord)), &outputs)) {
        return absl::InvalidArgumentError(absl::StrCat("unknown output \"", word, "\""));
      }
    } else if (!AddAov(word, &outputs) && !AddIdNumber(word, &outputs)) {
      return absl::InvalidArgumentError(absl::StrCat("unknown output \"", word, "\""));
    }
  }
  const std::vector<std::string>& groups = outputs.light_groups;
  if (groups.size() > kLightGroupsMax) return absl::InvalidArgumentError("too many light groups");
  const bool ascending =
      outputs.light_paths ||
      std::adjacent_find(groups.begin(), groups.end(), std::greater_equal<>()) == groups.end();
  if (FormatOutputs(outputs) != text || !ascending) {
    return absl::InvalidArgumentError("the outputs are not in their order");
  }
  return outputs;
}

}  // namespace sheaf
