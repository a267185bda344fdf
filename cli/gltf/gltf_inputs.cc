// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/gltf/gltf_inputs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/image/image_io.h"
#include "worker/render/color/file_primaries.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::cli {
namespace {

// Edge of the map, and samples along the edge of a texel: more than the image has texels there.
constexpr int kMapSizeMin = 16, kMapSizeMax = 2048, kSamples = 4;
constexpr double kPiOfMap = 3.141592653589793;

// Linear RGB of the texel; columns repeat, rows end.
Rgb TexelOf(const FloatImage& image, int x, int y) {
  x = (x % image.width + image.width) % image.width;
  y = std::clamp(y, 0, image.height - 1);
  Rgb color;
  for (int c = 0; c < 3; ++c) {
    const float linear = image.At(x, y, image.channels < 3 ? 0 : c);
    color[static_cast<size_t>(c)] = std::isfinite(linear) && linear > 0 ? linear : 0;
  }
  return color;
}

Rgb LookUp(const FloatImage& image, Vec3d d) {
  const double u = 0.5 + std::atan2(d.z, d.x) / (2 * kPiOfMap);
  const double v = std::acos(std::clamp(d.y, -1.0, 1.0)) / kPiOfMap;
  const double x = u * image.width - 0.5, y = v * image.height - 0.5;
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const auto fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  return (TexelOf(image, x0, y0) * (1 - fx) + TexelOf(image, x0 + 1, y0) * fx) * (1 - fy) +
         (TexelOf(image, x0, y0 + 1) * (1 - fx) + TexelOf(image, x0 + 1, y0 + 1) * fx) * fy;
}

Vec3d Turn(const std::array<double, 9>& m, Vec3d d) {
  return {m[0] * d.x + m[1] * d.y + m[2] * d.z, m[3] * d.x + m[4] * d.y + m[5] * d.z,
          m[6] * d.x + m[7] * d.y + m[8] * d.z};
}

// Converts by the primaries that the file gives.
void MoveToSrgb(const std::string& path, FloatImage* image) {
  const std::optional<Matrix4> srgb_from_file =
      render::SrgbFromFile(image->chromaticities, ColorRole::kIlluminant, path);
  if (!srgb_from_file) return;
  for (size_t i = 0; i + 2 < image->pixels.size(); i += 3) {
    Rgb color{image->pixels[i], image->pixels[i + 1], image->pixels[i + 2]};
    render::MoveToSrgb(*srgb_from_file, &color);
    for (size_t c = 0; c < 3; ++c) image->pixels[i + c] = color[c];
  }
}

}  // namespace

GltfView ViewOf(const GltfArguments& arguments, const FilmSize& size, int32_t frame_number) {
  GltfView view;
  view.camera = arguments.camera;
  view.right_camera = arguments.right_camera;
  view.animation = arguments.animation;
  view.time_s = (frame_number - 1) / arguments.fps;
  view.shutter_s = arguments.shutter / arguments.fps;
  view.width_px = size.width_px;
  view.height_px = size.height_px;
  return view;
}

absl::StatusOr<std::string> EqualAreaEnvironment(const std::string& path,
                                                 const UsdEnvironment& turned) {
  absl::StatusOr<FloatImage> image = ReadImage(path);
  if (!image.ok()) return image.status();
  MoveToSrgb(path, &*image);
  if (image->width != 2 * image->height) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": has ", image->width, " x ", image->height,
                     " pixels; an environment is equirectangular, twice as wide as high"));
  }
  const int size = std::clamp(image->height, kMapSizeMin, kMapSizeMax);
  // PFM: rows from the bottom, little-endian where the scale is negative.
  std::string bytes = absl::StrCat("PF\n", size, " ", size, "\n-1.0\n");
  for (int row = size - 1; row >= 0; --row) {
    for (int column = 0; column < size; ++column) {
      Rgb sum;
      for (int k = 0; k < kSamples * kSamples; ++k) {
        const double s = (column + (k % kSamples + 0.5) / kSamples) / size;
        const double t = (row + (k / kSamples + 0.5) / kSamples) / size;
        sum += LookUp(*image, Turn(turned.rotation, render::EqualAreaSquareToSphere({s, t})));
      }
      for (size_t c = 0; c < 3; ++c) {
        sum[c] *= static_cast<float>(turned.scale[c] / (kSamples * kSamples));
      }
      bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
    }
  }
  return bytes;
}

absl::Status GltfInputs::Add(const std::string& main_file, int32_t frame_number,
                             FileSource* files) {
  if (!IsGltfName(main_file)) {
    if (arguments_.AreDefault()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        main_file,
        ": --camera, --right-camera, --animation, --environment, --fps and --shutter are for "
        "glTF scenes; this one contains all of it"));
  }
  GltfView view = ViewOf(arguments_, size_, frame_number);
  if (arguments_.environment == GltfView::kNoEnvironment) {
    view.environment = arguments_.environment;
  } else if (!arguments_.environment.empty()) {
    const MutexLock lock(&mutex_);
    if (!environment_) environment_ = EqualAreaEnvironment(arguments_.environment);
    if (!environment_->ok()) return environment_->status();
    view.environment = main_file + ".environment.pfm";
    const absl::StatusOr<std::string> path = files->DerivedPath(view.environment, **environment_);
    if (!path.ok()) return path.status();
  } else {
    const MutexLock lock(&mutex_);
    if (const auto found = usd_environments_.find(main_file); found != usd_environments_.end()) {
      if (!found->second.ok()) return found->second.status();
      view.environment = main_file + ".environment.pfm";
      const absl::StatusOr<std::string> path = files->DerivedPath(view.environment, *found->second);
      if (!path.ok()) return path.status();
    }
  }
  return files->DerivedPath(GltfViewFile(main_file), EncodeGltfView(view)).status();
}

absl::StatusOr<std::vector<std::string>> GltfInputs::AddUsd(const std::string& path,
                                                            const std::string& main_file,
                                                            FileSource* files) {
  const MutexLock lock(&mutex_);
  auto found = usd_scenes_.find(path);
  if (found == usd_scenes_.end()) found = usd_scenes_.emplace(path, ConvertUsd(path)).first;
  if (!found->second.ok()) return found->second.status();
  const absl::StatusOr<std::string> derived = files->DerivedPath(main_file, found->second->glb);
  if (!derived.ok()) return derived.status();
  if (const auto& dome = found->second->environment;
      dome && arguments_.environment.empty() && !usd_environments_.contains(main_file)) {
    const absl::StatusOr<std::string> image =
        derived_->Put(dome->image, absl::StrCat("environment", dome->ending));
    usd_environments_.emplace(main_file,
                              image.ok() ? EqualAreaEnvironment(*image, *dome) : image.status());
  }
  return found->second->notes;
}

}  // namespace sheaf::cli
