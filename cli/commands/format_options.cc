// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/format_options.h"

#include <string>
#include <utility>
#include <vector>

#include "common/command_line/command_line.h"

namespace sheaf::cli {

void AddFormatOptions(CLI::App* command, ImageFormat* format) {
  const OptionGroup group(command, "Form of EXRs");
  AddChoice(command, "--exr-type", &format->exr.type,
            std::vector<std::pair<std::string, ExrType>>{{"float", ExrType::kFloat},
                                                         {"half", ExrType::kHalf}},
            "half: colors as 16-bit floats; depth, ids, errors and other data stay 32-bit floats. "
            "Such a copy cannot be resumed");
  std::vector<std::pair<std::string, ExrCompression>> compressions;
  for (const ExrCompression compression :
       {ExrCompression::kUncompressed, ExrCompression::kZip, ExrCompression::kZips,
        ExrCompression::kPiz, ExrCompression::kDwaa, ExrCompression::kDwab}) {
    compressions.emplace_back(ExrCompressionName(compression), compression);
  }
  AddChoice(command, "--exr-compression", &format->exr.compression, compressions,
            "Compression (default zip). dwaa and dwab are smaller, but lose precision of colors; "
            "data are stored in parts of their own without loss");
  AddChoice(command, "--exr-parts", &format->exr.parts,
            std::vector<std::pair<std::string, ExrParts>>{{"single", ExrParts::kSingle},
                                                          {"multi", ExrParts::kMulti}},
            "multi: a part for each layer, so that programs read only the layers they need");
  command
      ->add_option("--exr-tiles", format->exr.tile_size_px,
                   "Store tiles with this edge in pixels, not scan lines")
      ->check(InRange(kExrTileSizePxMin, kExrTileSizePxMax));
  AddChoice(command, "--exr-depth", &format->depth,
            std::vector<std::pair<std::string, ExrDepth>>{{"ray", ExrDepth::kRay},
                                                          {"plane", ExrDepth::kPlane}},
            "plane: depth.Z as compositing programs expect it, the distance from the camera's "
            "plane, and 1e10 where nothing is. Such a copy cannot be resumed");
  command->add_option("--exr-owner", format->owner, "The attribute owner");
  command->add_option("--exr-comments", format->comments, "The attribute comments");
  command->add_option("--exr-fps", format->frames_per_second,
                      "The attribute framesPerSecond: 24 or 24000/1001");
  command->add_flag("--exr-date", format->date,
                    "Write when the file was written (capDate): equal images are then different "
                    "files");
  command->add_flag("--exr-render-time", format->render_time,
                    "Write the wall and CPU time of the frame: equal images are then different "
                    "files");
}

}  // namespace sheaf::cli
