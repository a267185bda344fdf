// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/image_textures.h"

#include <cmath>
#include <string_view>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/scene/gltf/document.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

constexpr char kTransform[] = "KHR_texture_transform";
constexpr char kBasis[] = "KHR_texture_basisu";
constexpr char kWebp[] = "EXT_texture_webp";
constexpr std::string_view kKtx2Magic = "\xabKTX 20\xbb";

// uv' = offset + rotation * scale * uv, where v points downwards and the rotation is
// counter-clockwise as seen. Source: KHR_texture_transform, and the model TextureTransformTest for
// the direction. With v upwards on both sides this is the mapping below.
UvMapping MappingOf(const tinygltf::Value* transform) {
  UvMapping mapping;
  if (transform == nullptr) return mapping;
  const std::vector<double> offset = NumbersOf(transform, "offset", 2, {0, 0});
  const std::vector<double> scale = NumbersOf(transform, "scale", 2, {1, 1});
  const double angle = NumberOf(transform, "rotation", 0);
  const double c = std::cos(angle), s = std::sin(angle);
  mapping.scale_u = static_cast<float>(c * scale[0]);
  mapping.turn_u = static_cast<float>(-s * scale[1]);
  mapping.offset_u = static_cast<float>(s * scale[1] + offset[0]);
  mapping.turn_v = static_cast<float>(s * scale[0]);
  mapping.scale_v = static_cast<float>(c * scale[1]);
  mapping.offset_v = static_cast<float>(1 - c * scale[1] - offset[1]);
  return mapping;
}

TextureWrap WrapOf(int mode) {
  switch (mode) {
    case TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE:
      return TextureWrap::kClamp;
    case TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT:
      return TextureWrap::kMirror;
    default:
      return TextureWrap::kRepeat;
  }
}

std::string_view EndingOf(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG")) return ".png";
  if (bytes.starts_with("\xff\xd8\xff")) return ".jpg";
  if (bytes.starts_with("RIFF")) return ".webp";
  return "";
}

}  // namespace

TextureRef RefOf(int index, int uv_set, const tinygltf::ExtensionMap& extensions) {
  const tinygltf::Value* transform = Find(extensions, kTransform);
  const int other_set = IndexOf(transform, "texCoord");
  return {index, other_set >= 0 ? other_set : uv_set, MappingOf(transform)};
}

TextureRef RefOf(const tinygltf::Value* extension, const std::string& key) {
  const tinygltf::Value* info = Member(extension, key);
  const tinygltf::Value* transform = Member(Member(info, "extensions"), kTransform);
  const int set = IndexOf(info, "texCoord"), other_set = IndexOf(transform, "texCoord");
  return {IndexOf(info, "index"), other_set >= 0 ? other_set : (set >= 0 ? set : 0),
          MappingOf(transform)};
}

std::string ImageTextures::Fail(const std::string& what, const std::string& problem) {
  diagnostics_->Error(kFile, absl::StrCat(what, ": ", problem));
  return "";
}

std::string ImageTextures::FailKtx2(const std::string& what, const std::string& which) {
  if (has_ktx2_) return "";
  has_ktx2_ = true;
  return Fail(what, absl::StrCat(which,
                                 " is in KTX2, which Sheaf does not read; convert it: "
                                 "gltf-transform ktxdecompress in.glb out.glb"));
}

std::string ImageTextures::Derive(int image, const unsigned char* bytes, size_t size,
                                  const std::string& what) {
  const std::string_view content(reinterpret_cast<const char*>(bytes), size);
  if (content.starts_with(kKtx2Magic)) return FailKtx2(what, absl::StrCat("image ", image));
  const std::string ending(EndingOf(content));
  if (ending.empty()) {
    return Fail(what, absl::StrCat("image ", image,
                                   " within the file is neither PNG nor JPEG nor "
                                   "WebP; export it as PNG"));
  }
  // Images may share their bytes, or a part of them.
  if (!accessors_->Charge(size)) return "";
  const std::string name = absl::StrCat(main_file_, ".image-", image, ending);
  const absl::StatusOr<std::string> path = files_->DerivedPath(name, content);
  if (!path.ok()) return Fail(what, std::string(path.status().message()));
  return name;
}

std::string ImageTextures::FileOfImage(int index, const std::string& what) {
  const tinygltf::Image& image = model_->images[static_cast<size_t>(index)];
  if (!image.image.empty()) return Derive(index, image.image.data(), image.image.size(), what);
  if (image.bufferView < 0 && absl::EndsWithIgnoreCase(image.uri, ".ktx2")) {
    return FailKtx2(what, absl::StrCat("image ", index));
  }
  if (image.bufferView < 0) {
    const absl::StatusOr<std::string> name = NameOfUri(main_file_, image.uri);
    const absl::StatusOr<std::string> path = name.ok() ? files_->LocalPath(*name) : name.status();
    return path.ok() ? *name : Fail(what, std::string(path.status().message()));
  }
  const std::string bad = absl::StrCat("image ", index,
                                       " lies outside of its buffer; export the "
                                       "file again");
  if (!HasIndex(model_->bufferViews, image.bufferView)) return Fail(what, bad);
  const tinygltf::BufferView& view = model_->bufferViews[static_cast<size_t>(image.bufferView)];
  if (!HasIndex(model_->buffers, view.buffer)) return Fail(what, bad);
  const std::vector<unsigned char>& data = model_->buffers[static_cast<size_t>(view.buffer)].data;
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset) {
    return Fail(what, bad);
  }
  return Derive(index, data.data() + view.byteOffset, view.byteLength, what);
}

std::string ImageTextures::FileOf(const TextureRef& ref, const std::string& what) {
  if (!HasIndex(model_->textures, ref.index)) {
    return Fail(what,
                absl::StrCat("texture ", ref.index, " does not exist; export the file again"));
  }
  const tinygltf::Texture& texture = model_->textures[static_cast<size_t>(ref.index)];
  int source = texture.source;
  if (const tinygltf::Value* webp = Find(texture.extensions, kWebp);
      webp != nullptr && source < 0) {
    source = IndexOf(webp, "source");
  }
  if (source < 0 && Find(texture.extensions, kBasis) != nullptr) {
    return FailKtx2(what, absl::StrCat("texture ", ref.index, " (", kBasis, ")"));
  }
  if (!HasIndex(model_->images, source)) {
    return Fail(what, absl::StrCat("texture ", ref.index, " has no image; export the file again"));
  }
  const auto [entry, is_new] = files_of_images_.try_emplace(source);
  if (is_new) entry->second = FileOfImage(source, what);
  return entry->second;
}

std::optional<ImageTexture> ImageTextures::Image(const TextureRef& ref, const std::string& what) {
  ImageTexture image;
  image.file = FileOf(ref, what);
  if (image.file.empty()) return std::nullopt;
  image.mapping = ref.mapping;
  const int sampler = model_->textures[static_cast<size_t>(ref.index)].sampler;
  if (!HasIndex(model_->samplers, sampler)) return image;
  const tinygltf::Sampler& modes = model_->samplers[static_cast<size_t>(sampler)];
  image.wrap = WrapOf(modes.wrapS);
  if (modes.wrapT != modes.wrapS) image.wrap_v = WrapOf(modes.wrapT);
  if (modes.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST) {
    image.filter = ImageTexture::Filter::kPoint;
  }
  return image;
}

bool ImageTextures::SetEmission(const TextureRef& ref, const std::string& what,
                                AreaLightDescription* light) {
  const std::optional<ImageTexture> image = Image(ref, what);
  if (!image) return false;
  light->file = image->file;
  light->placement = {image->mapping, image->wrap, image->wrap_v.value_or(image->wrap),
                      image->filter == ImageTexture::Filter::kPoint};
  return true;
}

int32_t ImageTextures::Add(const std::string& what, bool is_color, ColorRole role,
                           ImageTexture image) {
  TextureDescription texture;
  texture.name = what;
  texture.is_color = is_color;
  texture.role = role;
  texture.texture = std::move(image);
  texture.location = kFile;
  scene_->textures.push_back(std::move(texture));
  return static_cast<int32_t>(scene_->textures.size() - 1);
}

int32_t ImageTextures::Color(const TextureRef& ref, Rgb tint, const std::string& what) {
  std::optional<ImageTexture> image = Image(ref, what);
  if (!image) return kNone;
  image->encoding = ColorEncoding::kSrgb;
  image->tint = tint;
  return Add(what, true, ColorRole::kReflectance, *std::move(image));
}

int32_t ImageTextures::NormalMap(const TextureRef& ref, const std::string& what) {
  std::optional<ImageTexture> image = Image(ref, what);
  if (!image) return kNone;
  image->encoding = ColorEncoding::kLinear;
  return Add(what, true, ColorRole::kUnbounded, *std::move(image));
}

int32_t ImageTextures::Channel(const TextureRef& ref, int channel, float scale,
                               std::optional<float> threshold, const std::string& what) {
  std::optional<ImageTexture> image = Image(ref, what);
  if (!image) return kNone;
  // Alpha is never encoded; colors beside it are not looked at.
  image->encoding = ColorEncoding::kLinear;
  image->channel = channel;
  image->scale = scale;
  image->threshold = threshold;
  return Add(what, false, ColorRole::kUnbounded, *std::move(image));
}

}  // namespace sheaf::gltf
