// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/render_command.h"

#include <algorithm>
#include <type_traits>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "common/film/denoised_output.h"
#include "common/scene/settings/frame_settings_fields.h"
#include "common/scene/settings/path_shares.h"

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
  std::string command = absl::StrCat("sheaf render ", Quoted(scene));
  if (settings.IsStereo()) {
    absl::StrAppend(&command, " --stereo ", settings.eye_distance);
    if (settings.eye_convergence > 0) absl::StrAppend(&command, ",", settings.eye_convergence);
  }
  if (!HasOneTile(settings)) {  // Otherwise the tile is the whole frame.
    absl::StrAppend(&command, " --crop ", tile.x0, ",", tile.y0, ",", tile.x1, ",", tile.y1);
  }
  absl::StrAppend(&command, " --samples ", sample_count);
  VisitFrameSettings(settings, [&command]<typename T>(const SettingField& field, const T& value) {
    const SettingName& flag = field.flag;
    if (*flag.name == '\0' || (!flag.always && IsDefaultSetting(value))) return;
    absl::StrAppend(&command, " --", flag.name);
    if constexpr (!std::is_same_v<T, bool>) {
      absl::StrAppend(&command, " ", SettingText(field, value));
    }
  });
  AddOutputs(settings.outputs, &command);
  return command;
}

}  // namespace sheaf::coordinator
