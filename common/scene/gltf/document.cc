// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/document.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/file.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/scene/gltf/parsable_json.h"
#include "common/scene/named_as_in_scene.h"

namespace sheaf::gltf {
namespace {

// The file layout of GLB: glTF 2.0 specification, sec. 4.4.
constexpr size_t kGlbHeaderBytes = 12, kChunkHeaderBytes = 8;
constexpr size_t kShownBytesMax = 200;  // Bytes of a name in a message.

absl::Status BadFile(const std::string& main_file, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(main_file, ": ", what, "; export the file again"));
}

absl::Status FirstVersion(const std::string& main_file) {
  return absl::InvalidArgumentError(absl::StrCat(
      main_file, ": is glTF 1.0, Sheaf reads 2.0; convert it, for example with gltf-pipeline"));
}

uint32_t WordAt(std::string_view bytes, size_t offset) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

int DigitOf(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char lower = absl::ascii_tolower(static_cast<unsigned char>(c));
  return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

// The JSON text of a GLB file. tinygltf relies on the lengths that are checked here.
absl::StatusOr<std::string_view> JsonOfGlb(const std::string& main_file, std::string_view bytes) {
  if (bytes.size() < kGlbHeaderBytes + kChunkHeaderBytes) {
    return BadFile(main_file, "is too short for a GLB file");
  }
  if (WordAt(bytes, 4) == 1) return FirstVersion(main_file);
  if (WordAt(bytes, 4) != 2) {
    return BadFile(main_file,
                   absl::StrCat("is GLB of version ", WordAt(bytes, 4), ", Sheaf reads version 2"));
  }
  if (WordAt(bytes, 8) > bytes.size()) {
    return BadFile(main_file, absl::StrCat("is truncated: it has ", bytes.size(),
                                           " bytes, its header says ", WordAt(bytes, 8)));
  }
  const uint64_t length = WordAt(bytes, 12);
  if (length > bytes.size() - kGlbHeaderBytes - kChunkHeaderBytes) {
    return BadFile(main_file, "has a JSON chunk that is longer than the file");
  }
  return bytes.substr(kGlbHeaderBytes + kChunkHeaderBytes, length);
}

absl::Status CheckJson(const std::string& main_file, std::string_view json) {
  if (json.size() > kJsonBytesMax) {
    return absl::ResourceExhaustedError(absl::StrCat(main_file, ": has ", json.size(),
                                                     " bytes of JSON, the limit is ", kJsonBytesMax,
                                                     "; put the data into buffers"));
  }
  int depth = 0;
  bool in_text = false;
  for (size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_text) {
      if (c == '\\') ++i;
      if (c == '"') in_text = false;
      continue;
    }
    if (c == '"') in_text = true;
    if (c == '{' || c == '[') ++depth;
    if (c == '}' || c == ']') --depth;
    if (depth > kJsonDepthMax) {
      return BadFile(main_file,
                     absl::StrCat("nests JSON deeper than the limit of ", kJsonDepthMax));
    }
  }
  return absl::OkStatus();
}

// The canonical name of what a file in the main file's folder is called there.
absl::StatusOr<std::string> NameBeside(const std::string& main_file, const std::string& name) {
  const std::string beside = CanonicalFileName(name);
  if (beside.starts_with('/') || beside == ".." || beside.starts_with("../")) {
    return absl::InvalidArgumentError(
        absl::StrCat("file \"", Printable(name, kShownBytesMax),
                     "\" lies outside of the scene's folder, which a glTF file may not leave; copy "
                     "it into the folder and export again"));
  }
  const size_t slash = main_file.rfind('/');
  if (slash == std::string::npos) return beside;
  return CanonicalFileName(main_file.substr(0, slash + 1) + beside);
}

void AppendWord(uint32_t word, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&word), sizeof word);
}

// The file as the parser can read it. json: of the file.
std::string Parsable(std::string bytes, std::string_view json, bool is_binary) {
  std::string text = ParsableJson(json);
  if (text == json) return bytes;
  if (!is_binary) return text;
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::string rest = bytes.substr(kGlbHeaderBytes + kChunkHeaderBytes + json.size());
  std::string file = bytes.substr(0, 8);
  AppendWord(static_cast<uint32_t>(kGlbHeaderBytes + kChunkHeaderBytes + text.size() + rest.size()),
             &file);
  AppendWord(static_cast<uint32_t>(text.size()), &file);
  return file + bytes.substr(16, 4) + text + rest;
}

// The GLB file with a binary chunk of whole words, as the parser demands it, whatever the writer
// left out. Later chunks of such a file are dropped.
std::string WithWholeWords(std::string file) {
  const size_t header = kGlbHeaderBytes + kChunkHeaderBytes + WordAt(file, 12);
  if (header + kChunkHeaderBytes > file.size()) return file;
  const uint64_t length = WordAt(file, header);
  const uint64_t begin = header + kChunkHeaderBytes;
  if (length % 4 == 0 || length > file.size() - begin) return file;
  file.resize(begin + length);
  file.resize(begin + (length + 3) / 4 * 4, '\0');
  const auto set = [&](size_t at, uint64_t value) {
    const auto word = static_cast<uint32_t>(value);
    std::memcpy(file.data() + at, &word, sizeof word);
  };
  set(8, file.size());
  set(header, file.size() - begin);
  return file;
}

// State of the parser's callbacks.
struct Access {
  std::string main_file;
  FileSource* files;
  uint64_t bytes_left;
  absl::Status status;  // The first failure.
};

bool ReadBuffer(std::vector<unsigned char>* out, std::string* error, const std::string& name,
                void* access_pointer) {
  auto* access = static_cast<Access*>(access_pointer);
  const absl::StatusOr<std::string> canonical =
      NameBeside(access->main_file, name.starts_with("./") ? name.substr(2) : name);
  const absl::StatusOr<std::string> path =
      canonical.ok() ? access->files->LocalPath(*canonical) : canonical.status();
  absl::StatusOr<std::string> bytes =
      path.ok() ? ReadWholeFile(*path, access->bytes_left) : path.status();
  if (!bytes.ok()) {
    access->status.Update(path.ok() ? NamedAsInScene(bytes.status(), *path, *canonical)
                                    : path.status());
    *error = std::string(bytes.status().message());
    return false;
  }
  access->bytes_left -= bytes->size();
  out->assign(bytes->begin(), bytes->end());
  return true;
}

bool KeepImage(tinygltf::Image* image, const int /*index*/, std::string* /*error*/,
               std::string* /*warning*/, int /*width*/, int /*height*/, const unsigned char* bytes,
               int size, void* /*user*/) {
  // Those of buffer views are taken from there, where the view can be checked.
  if (image->bufferView < 0 && size > 0) image->image.assign(bytes, bytes + size);
  return true;
}

// tinygltf 2.9 takes the size of a file first, 2.7 has no such callback.
template <typename Callbacks>
void SetSizeCallback(Callbacks* callbacks) {
  if constexpr (requires { callbacks->GetFileSizeInBytes; }) {
    callbacks->GetFileSizeInBytes = [](size_t* size, std::string*, const std::string&, void*) {
      *size = 1;  // The reader itself has the limit.
      return true;
    };
  }
}

absl::Status CheckCounts(const std::string& main_file, const tinygltf::Model& model) {
  const std::pair<const char*, size_t> counts[] = {
      {"nodes", model.nodes.size()},         {"meshes", model.meshes.size()},
      {"accessors", model.accessors.size()}, {"buffer views", model.bufferViews.size()},
      {"materials", model.materials.size()}, {"animations", model.animations.size()},
      {"images", model.images.size()},       {"textures", model.textures.size()}};
  for (const auto& [what, count] : counts) {
    if (count <= kItemsMax) continue;
    return absl::ResourceExhaustedError(absl::StrCat(main_file, ": has ", count, " ", what,
                                                     ", the limit is ", kItemsMax, "; join some"));
  }
  return absl::OkStatus();
}

std::string OneLine(std::string text) {
  absl::StripTrailingAsciiWhitespace(&text);
  return Printable(absl::StrReplaceAll(text, {{"\n", "; "}}), 500);
}

absl::Status Parse(Access* access, const std::string& bytes, bool is_binary, tinygltf::Model* model,
                   std::string* its_warning) {
  tinygltf::TinyGLTF parser;
  tinygltf::FsCallbacks callbacks{};
  callbacks.FileExists = [](const std::string&, void*) { return true; };
  callbacks.ExpandFilePath = [](const std::string& path, void*) { return path; };
  callbacks.ReadWholeFile = &ReadBuffer;
  // Never called; but tinygltf 2.9 takes all callbacks or none.
  callbacks.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&,
                                void*) { return false; };
  callbacks.user_data = access;
  SetSizeCallback(&callbacks);
  parser.SetFsCallbacks(callbacks);
  parser.SetImageLoader(&KeepImage, nullptr);
  std::string error, warning;
  bool ok = false;
  // Its JSON library reports by exceptions, some of which pass through.
  try {
    const auto size = static_cast<unsigned>(bytes.size());
    ok = is_binary ? parser.LoadBinaryFromMemory(
                         model, &error, &warning,
                         reinterpret_cast<const unsigned char*>(bytes.data()), size, "")
                   : parser.LoadASCIIFromString(model, &error, &warning, bytes.data(), size, "");
  } catch (const std::exception& exception) {
    error = exception.what();
    ok = false;
  }
  *its_warning = OneLine(warning);
  if (!access->status.ok()) return Annotate(access->status, access->main_file);
  if (ok) return CheckCounts(access->main_file, *model);
  return BadFile(access->main_file, absl::StrCat("is not valid glTF: ", OneLine(error)));
}

}  // namespace

absl::StatusOr<std::string> NameOfUri(const std::string& main_file, std::string_view uri) {
  std::string decoded;
  for (size_t i = 0; i < uri.size(); ++i) {
    const int high = i + 2 < uri.size() && uri[i] == '%' ? DigitOf(uri[i + 1]) : -1;
    const int low = high >= 0 ? DigitOf(uri[i + 2]) : -1;
    if (low < 0) {
      decoded.push_back(uri[i]);
      continue;
    }
    decoded.push_back(static_cast<char>(16 * high + low));
    i += 2;
  }
  return NameBeside(main_file, decoded);
}

absl::StatusOr<std::unique_ptr<tinygltf::Model>> LoadDocument(const std::string& main_file,
                                                              FileSource& files,
                                                              const SceneReaderLimits& limits,
                                                              std::string* warning) {
  const absl::StatusOr<std::string> path = files.LocalPath(main_file);
  if (!path.ok()) return path.status();
  // The parser counts in 32 bits.
  const uint64_t bytes_max = std::min<uint64_t>(
      {limits.file_bytes_max, limits.memory_bytes_max, std::numeric_limits<uint32_t>::max()});
  absl::StatusOr<std::string> bytes = ReadWholeFile(*path, bytes_max);
  if (!bytes.ok()) return NamedAsInScene(bytes.status(), *path, main_file);
  const bool is_binary = bytes->starts_with("glTF");
  std::string_view json = *bytes;
  if (is_binary) {
    const absl::StatusOr<std::string_view> chunk = JsonOfGlb(main_file, *bytes);
    if (!chunk.ok()) return chunk.status();
    json = *chunk;
  }
  if (absl::Status status = CheckJson(main_file, json); !status.ok()) return status;
  std::string parsable = Parsable(*std::move(bytes), json, is_binary);
  if (is_binary) parsable = WithWholeWords(std::move(parsable));
  auto model = std::make_unique<tinygltf::Model>();
  Access access{main_file, &files, bytes_max, absl::OkStatus()};
  const absl::Status status = Parse(&access, parsable, is_binary, model.get(), warning);
  // The parser passes over the objects of the first version, or fails at what is not there.
  const bool is_first = access.status.ok() && model->meshes.empty() && IsFirstVersion(parsable);
  if (is_first) return FirstVersion(main_file);
  if (!status.ok()) return status;
  return model;
}

}  // namespace sheaf::gltf
