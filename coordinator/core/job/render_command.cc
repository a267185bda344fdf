// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/render_command.h"

#include <algorithm>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "common/film/denoised_output.h"

namespace sheaf::coordinator {
namespace {

// Quotes the text as one word for a shell.
std::string Quoted(const std::string& text) {
  const auto is_plain = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || absl::StrContains("._/-+#", c);
  };
  // A name that begins with "-" would be read as an option, one that begins with "#" as a comment.
  const bool plain_start = !text.empty() && text[0] != '-' && text[0] != '#';
  if (plain_start && std::all_of(text.begin(), text.end(), is_plain)) return text;
  const std::string path = absl::StartsWith(text, "-") ? absl::StrCat("./", text) : text;
  return absl::StrCat("'", absl::StrReplaceAll(path, {{"'", "'\\''"}}), "'");
}

void AddOutputs(const FilmOutputs& outputs, std::string* command) {
  std::vector<std::string> aovs, cryptomattes;
  for (size_t i = 0; i < kAovCount; ++i) {
    const auto aov = static_cast<Aov>(i);
    if (outputs.Has(aov)) aovs.emplace_back(AovName(aov));
  }
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (outputs.HasIdNumber(kind)) aovs.push_back(absl::StrCat(IdKindName(kind), "-id"));
    if (outputs.HasCryptomatte(kind)) cryptomattes.emplace_back(IdKindName(kind));
  }
  if (!aovs.empty()) absl::StrAppend(command, " --aov ", absl::StrJoin(aovs, ","));
  if (!cryptomattes.empty()) {
    absl::StrAppend(command, " --cryptomatte ", absl::StrJoin(cryptomattes, ","));
  }
  if (HasDenoised(outputs)) absl::StrAppend(command, " --denoise");
  if (outputs.light_paths) {
    absl::StrAppend(command, " --light-paths");
  } else if (!outputs.light_groups.empty()) {
    absl::StrAppend(command, " --light-groups");
  }
}

}  // namespace

std::string RenderCommand(const std::string& scene, const FrameSettings& settings,
                          const PixelRect& tile, uint64_t sample_count) {
  const FrameSettings& s = settings;
  std::string command = absl::StrCat(
      "sheaf render ", Quoted(scene), " --crop ", tile.x0, ",", tile.y0, ",", tile.x1, ",", tile.y1,
      " --samples ", sample_count, " --seed ", s.seed, " --max-depth ", s.max_depth);
  if (s.color != ColorTransport::kAuto) {
    absl::StrAppend(&command, " --color ", ColorTransportName(s.color));
  }
  if (s.primaries != Primaries::kSrgb) {
    absl::StrAppend(&command, " --primaries ", PrimariesName(s.primaries));
  }
  if (s.single_scattering) absl::StrAppend(&command, " --single-scattering");
  if (s.one_sequence) absl::StrAppend(&command, " --one-sequence");
  if (s.similarity_after != 0) absl::StrAppend(&command, " --similarity ", s.similarity_after);
  if (s.light_samples != 0) absl::StrAppend(&command, " --light-samples ", s.light_samples);
  // The scene may name other techniques.
  absl::StrAppend(&command, " --techniques ", s.techniques.Name());
  if (s.force_generic_variant) absl::StrAppend(&command, " --generic");
  AddOutputs(s.outputs, &command);
  return command;
}

}  // namespace sheaf::coordinator
