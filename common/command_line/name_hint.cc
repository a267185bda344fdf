// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/name_hint.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/base/nearest_name.h"

namespace sheaf {
namespace {

// The words of other renderers and farms, of kubectl and Unix.
struct OtherWord {
  absl::string_view word, ours;
};
constexpr OtherWord kOtherWords[] = {{"--spp", "--samples"},
                                     {"--pixelsamples", "--samples"},
                                     {"--outfile", "--output"},
                                     {"--nthreads", "--threads"},
                                     {"--cropwindow", "--crop"},
                                     {"--resolution", "--size"},
                                     {"--crop-window", "--crop"},
                                     {"--pixelbounds", "--crop"},
                                     {"--region", "--crop"},
                                     {"--width", "--size"},
                                     {"--height", "--size"},
                                     {"--max-bounces", "--max-depth"},
                                     {"--bounces", "--max-depth"},
                                     {"--depth", "--max-depth"},
                                     {"--integrator", "--techniques"},
                                     {"--time-limit", "--time"},
                                     {"--noise-threshold", "--target-error"},
                                     {"--denoiser", "--denoise"},
                                     {"--aovs", "--aov"},
                                     {"--camera-name", "--camera"},
                                     {"--compression", "--exr-compression"},
                                     {"--cores", "--threads"},
                                     {"--num-threads", "--threads"},
                                     {"--name", "--title"},
                                     {"--host", "--coordinator"},
                                     {"--server", "--coordinator"},
                                     {"--address", "--coordinator"},
                                     {"jobs", "list"},
                                     {"ls", "list"},
                                     {"status", "show"},
                                     {"info", "show"},
                                     {"describe", "show"},
                                     {"nodes", "workers"},
                                     {"estimate", "quote"},
                                     {"diff", "compare"},
                                     {"rm", "delete"},
                                     {"remove", "delete"},
                                     {"log", "logs"},
                                     {"events", "logs"},
                                     {"history", "logs"}};

}  // namespace

std::string NameHint(const std::string& name, const std::vector<std::string>& names) {
  for (const OtherWord& other : kOtherWords) {
    if (name != other.word || std::find(names.begin(), names.end(), other.ours) == names.end()) {
      continue;
    }
    return absl::StrCat("; did you mean \"", other.ours, "\"?");
  }
  return NearestNameHint(name, names);
}

}  // namespace sheaf
