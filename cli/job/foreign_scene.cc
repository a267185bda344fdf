// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/foreign_scene.h"

#include <memory>
#include <string_view>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "cli/usd/usd_scene.h"
#include "common/scene/formats/text_input.h"
#include "common/scene/gltf/gltf_view.h"

namespace sheaf::cli {
namespace {

constexpr size_t kHeadBytes = 4096;

constexpr char kAssimp[] = "convert it, for example with: assimp export ROOM.fbx room.glb";
constexpr char kGltfName[] = "name it .gltf or .glb";
constexpr char kUsdName[] = "name it .usd";
constexpr char kByBlender[] =
    "open it in Blender and export it as glTF, or as pbrt-v4 with Sheaf's add-on";
constexpr char kByHand[] = "docs/pbrt-v4.md describes the scenes that Sheaf reads";
constexpr char kImage[] = "give the scene that uses it";
constexpr char kMesh[] =
    "put it into a scene, as a .ply: Shape \"plymesh\" \"string filename\" \"model.ply\"";
constexpr char kVolume[] =
    "put it into a scene: MakeNamedMedium \"smoke\" \"string type\" \"nanovdb\" "
    "\"string filename\" \"smoke.nvdb\"";

// How a format is recognized. Empty magic: by the file's name only. Empty ending: by its bytes
// only.
struct Format {
  std::string_view magic, ending;
  const char* what;
  const char* advice;
};
using namespace std::string_view_literals;  // NOLINT: magic numbers hold zeros.
constexpr Format kFormats[] = {
    {"BLENDER"sv, ".blend"sv, "a Blender file", kByBlender},
    {"glTF"sv, ""sv, "a glTF file", kGltfName},
    {"PXR-USDC"sv, ""sv, "a USD file", kUsdName},
    {"#usda"sv, ""sv, "a USD file", kUsdName},
    {"Ogawa"sv, ".abc"sv, "an Alembic file", kByBlender},
    {"Kaydara FBX Binary"sv, ".fbx"sv, "an FBX file", kAssimp},
    {""sv, ".dae"sv, "a COLLADA file", kAssimp},
    {""sv, ".obj"sv, "an OBJ mesh", kAssimp},
    {""sv, ".stl"sv, "an STL mesh", kMesh},
    {"ply\n"sv, ".ply"sv, "a PLY mesh", kMesh},
    {"ply\r"sv, ""sv, "a PLY mesh", kMesh},
    {"NanoVDB"sv, ".nvdb"sv, "a NanoVDB volume", kVolume},
    {" BDV\0\0\0\0"sv, ".vdb"sv, "an OpenVDB volume", kVolume},
    {"\x76\x2f\x31\x01"sv, ".exr"sv, "an EXR image", kImage},
    {"\x89PNG"sv, ".png"sv, "a PNG image", kImage},
    {"\xff\xd8\xff"sv, ".jpg"sv, "a JPEG image", kImage},
    {"\xff\xfe"sv, ""sv, "text in UTF-16", "save it as UTF-8"},
    {"\xfe\xff"sv, ""sv, "text in UTF-16", "save it as UTF-8"},
    {"\x89HDF"sv, ""sv, "an HDF5 or an old Alembic file", kByBlender},
    {"%PDF"sv, ""sv, "a PDF document", kByHand},
    {"PK\x03\x04"sv, ".zip"sv, "a zip archive", "unpack it and give the scene in it"},
    {"7z\xbc\xaf"sv, ".7z"sv, "a 7z archive", "unpack it and give the scene in it"},
    {"\x28\xb5\x2f\xfd"sv, ".zst"sv, "compressed by zstd", "unpack it, or compress it with gzip"},
    {"\x7f"
     "ELF"sv,
     ""sv, "a program", kByHand},
};

bool EndsSo(const std::string& path, std::string_view ending) {
  return !ending.empty() && absl::EndsWithIgnoreCase(path, std::string(ending));
}

absl::Status Refusal(const std::string& path, const std::string& what, const std::string& advice) {
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": is ", what, ", not a pbrt-v4 or glTF scene; ", advice));
}

}  // namespace

absl::Status CheckSceneFormat(const std::string& path, const std::string& head) {
  // Their readers say what is wrong with them.
  if (IsGltfName(NameAsRead(path))) return absl::OkStatus();
  // The name is checked first: a .blend may be compressed.
  for (const Format& format : kFormats) {
    if (EndsSo(path, format.ending)) return Refusal(path, format.what, format.advice);
  }
  for (const Format& format : kFormats) {
    if (!format.magic.empty() && std::string_view(head).starts_with(format.magic)) {
      return Refusal(path, format.what, format.advice);
    }
  }
  const size_t first = head.find_first_not_of(" \t\r\n");
  const std::string text = first == std::string::npos ? "" : head.substr(first);
  if (text.starts_with("<")) {
    const bool is_mitsuba = absl::StrContains(text, "<scene");
    return Refusal(path, is_mitsuba ? "a Mitsuba scene" : "an XML file", kByHand);
  }
  if (text.starts_with("{")) {
    const bool is_gltf = absl::StrContains(text, "\"asset\"");
    return Refusal(path, is_gltf ? "a glTF file" : "a JSON file", is_gltf ? kGltfName : kByHand);
  }
  if (head.find('\0') != std::string::npos) return Refusal(path, "a binary file", kByHand);
  return absl::OkStatus();
}

absl::Status CheckSceneFormatOf(const std::string& path) {
  const absl::StatusOr<std::unique_ptr<TextInput>> input = TextInput::Open(path, 2 * kHeadBytes);
  if (!input.ok()) return absl::OkStatus();
  std::string head(kHeadBytes, '\0');
  const absl::StatusOr<size_t> count = (*input)->Read(head.data(), head.size());
  if (!count.ok()) return absl::OkStatus();
  head.resize(*count);
  return CheckSceneFormat(path, head);
}

}  // namespace sheaf::cli
