// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/resumed_image.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/denoised_output.h"
#include "common/film/exr/external_layer.h"
#include "common/film/film_outputs.h"
#include "common/film/light/light_image.h"
#include "common/math/double_float.h"
#include "common/math/mix_bits.h"

namespace sheaf {
namespace {

// The channels to read, in this order; then those of outputs.
constexpr std::array<const char*, 16> kChannels{
    "R",        "G",        "B",        "stderr.R", "stderr.G", "stderr.B", "A",       "albedo.R",
    "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z",  "samples", "nonfinite"};
enum Channel : size_t {
  kColorPlane = 0,
  kColorErrorPlane = 3,
  kAlpha = 6,
  kAlbedo = 7,
  kNormal = 10,
  kDepth = 13,
  kSamples = 14,
  kNonFinite = 15,
  kOutputs = 16
};
// Those of the light layer, as LightLayerChannels orders them.
enum LightChannel : size_t {
  kLightMean = 0,
  kLightError = 3,
  kLightPasses = 6,
  kLightNonFinite = 7,
  kLightGroups = 8
};
// Counts are exact in floats up to here.
constexpr float kCountMax = 1 << 24;

absl::Status Refuse(const std::string& why) { return absl::InvalidArgumentError(why); }

// A step of SplitMix64.
uint64_t Mix(uint64_t key) { return MixBits(key + 0x9e3779b97f4a7c15); }

// +1 for half of the replicates, -1 for the others; all halves are equally likely (Fisher and
// Yates). Those of both kinds of path are independent, as their noise is.
std::array<double, kReplicateCount> DrawSigns(TaskKind kind, int32_t x, int32_t y) {
  constexpr uint64_t kOfLight = 0x6c69676874;
  std::array<double, kReplicateCount> signs{};
  for (uint32_t r = 0; r < kReplicateCount; ++r) signs[r] = r % 2 == 0 ? 1 : -1;
  const uint64_t pixel =
      static_cast<uint64_t>(static_cast<uint32_t>(x)) << 32 | static_cast<uint32_t>(y);
  const uint64_t key = Mix(pixel) ^ (kind == TaskKind::kLight ? kOfLight : 0);
  for (uint32_t r = kReplicateCount - 1; r > 0; --r) {
    const uint64_t random = Mix(key + r) >> 32;
    std::swap(signs[r], signs[random * (r + 1) >> 32]);
  }
  return signs;
}

absl::Status CheckOutputs(const FilmOutputs& outputs) {
  if (outputs.HasIds()) {
    return Refuse(
        "ids and cryptomattes cannot be continued: the image has their ranks, not all of their "
        "weights; render them again without the image");
  }
  if (HasDenoised(outputs)) {
    return Refuse(
        "a denoised image cannot be continued: the image has the guides of all samples, not those "
        "of each half; render without --denoise, or without the image");
  }
  for (const MeanChannel& channel : MeanChannelsOf(outputs)) {
    if (!channel.starts_direction) continue;
    return Refuse(absl::StrCat("the output ", channel.name,
                               " cannot be continued: the image has directions of unit length, not "
                               "their means; remove the output, or render without the image"));
  }
  return absl::OkStatus();
}

Matrix4 InverseOf(const Matrix4& matrix) {
  Matrix4 inverse;
  SHEAF_CHECK(Invert(matrix, &inverse));
  return inverse;
}

void SetWide(double sum, float* hi, float* lo) {
  const DoubleFloat wide = DoubleFloat::Make(sum);
  *hi = wide.hi;
  *lo = wide.lo;
}

}  // namespace

std::vector<SampleBlock> PrefixBlocks(uint64_t samples) {
  std::vector<SampleBlock> blocks;
  for (uint64_t first = 0; first < samples;) {
    const uint64_t count = std::bit_floor(samples - first);
    blocks.push_back({first, count});
    first += count;
  }
  return blocks;
}

// An image's values of a pixel, as input to the sums.
struct ResumedImage::Pixel {
  double finite = 0, nonfinite = 0;
  Vec3d color, deviation;           // Linear sRGB: the mean; the replicates' deviations from it.
  std::array<float, 7> weighted{};  // Means of A, albedo and normal.
  double depth = 0;                 // Mean over hits of a surface.
  std::vector<float> means;         // Outputs, in their order.
  std::array<double, kReplicateCount> signs{};
};

ResumedImage::ResumedImage(FrameImage image, const FilmOutputs& outputs, const ImageColor& color)
    : image_(std::move(image)),
      outputs_(outputs),
      mean_channels_(MeanChannelsOf(outputs)),
      color_is_srgb_(color.AsSummed()),
      srgb_from_light_(InverseOf(color.light_from_srgb)),
      srgb_from_albedo_(InverseOf(color.albedo_from_srgb)) {}

absl::StatusOr<ResumedImage> ResumedImage::Make(FrameImage image, const FilmOutputs& outputs,
                                                const ImageColor& color, bool has_light) {
  RemoveExternalLayer(&image);
  const auto digest = image.metadata.find(kImageDigestKey);
  if (digest == image.metadata.end() || !image.metadata.contains(kFrameDigestKey)) {
    return Refuse(
        "it does not identify its frame (sheaf:frameDigest, sheaf:imageDigest): only an EXR "
        "delivered by this version of Sheaf can be resumed");
  }
  const auto rounding = image.metadata.find(kRoundingKey);
  if (rounding != image.metadata.end()) {
    return Refuse(absl::StrCat("its pixels were rounded when it was written (", rounding->second,
                               "): continue from a copy written with --exr-type float and a "
                               "compression without loss"));
  }
  if (image.metadata.contains(kDepthKey)) {
    return Refuse(
        "its depth was converted when it was written: continue from a copy written with "
        "--exr-depth ray");
  }
  if (image.Find(MergeBiasChannel("R")) != nullptr) {
    return Refuse(
        "its light paths were merged with camera paths: the image has the bias of all passes, not "
        "that of each half; continue the job itself with sheaf refine, or render without the "
        "image");
  }
  if (absl::Status status = CheckOutputs(outputs); !status.ok()) return status;
  const auto weight = image.metadata.find(kSampleWeightKey);
  if (weight != image.metadata.end() && weight->second == "signed") {
    return Refuse(
        "its filter is negative in places, and the image does not have the weights of its samples: "
        "it cannot be resumed");
  }
  ResumedImage resumed(std::move(image), outputs, color);
  if (absl::Status status = resumed.FindChannels(has_light); !status.ok()) return status;
  if (ImageDigest(resumed.image_) != resumed.image_.metadata.at(kImageDigestKey)) {
    return Refuse("its pixels were changed after it was delivered (sheaf:imageDigest differs)");
  }
  if (absl::Status status = resumed.CheckCounts(); !status.ok()) return status;
  return resumed;
}

absl::Status ResumedImage::FindChannels(bool has_light) {
  const std::vector<std::string>& all = image_.channel_names;
  const auto find = [&all](const std::string& name, std::vector<size_t>* planes) {
    const auto found = std::find(all.begin(), all.end(), name);
    if (found == all.end()) return false;
    planes->push_back(static_cast<size_t>(found - all.begin()));
    return true;
  };
  std::vector<std::string> names(kChannels.begin(), kChannels.end());
  for (const MeanChannel& channel : mean_channels_) names.push_back(channel.name);
  for (const std::string& name : names) {
    if (find(name, &planes_)) continue;
    return Refuse(absl::StrCat("it has no channel ", name, ", which this job requests"));
  }
  if (!has_light) return absl::OkStatus();
  for (const LightLayerChannel& channel : LightLayerChannels(outputs_)) {
    if (find(channel.of_layer, &light_planes_)) continue;
    return Refuse(absl::StrCat(
        "it has no channel ", channel.of_layer,
        ", so what its light paths found cannot be told from what its camera paths found: an "
        "earlier version of Sheaf delivered it, or the channel was removed; continue the job "
        "itself with sheaf refine, or render without the image"));
  }
  return absl::OkStatus();
}

absl::Status ResumedImage::CheckCounts() {
  float most = 0;
  for (size_t p = 0; p < image_.planes[0].size(); ++p) {
    const float count = CountAt(p);
    most = std::max(most, count);
    if (count >= static_cast<float>(kReplicateCount)) continue;
    return Refuse(absl::StrCat("one of its pixels has ", count, " samples; at least ",
                               kReplicateCount, " in each pixel are needed to resume an image"));
  }
  if (light_planes_.empty()) return absl::OkStatus();
  for (size_t p = 0; p < image_.planes[0].size(); ++p) {
    const float passes = LightAt(kLightPasses, p), lost = LightAt(kLightNonFinite, p);
    const bool fits = passes == most && passes <= kCountMax && lost >= 0 && lost <= kCountMax;
    if (fits) continue;
    return Refuse(absl::StrCat(
        "its light layer contradicts it: one of its pixels has ", passes, " light passes and ",
        lost, " lost splats, where its pixels have up to ", most,
        " samples, and so as many passes; continue from the file as it was delivered"));
  }
  light_pass_count_ = static_cast<uint64_t>(most);
  return absl::OkStatus();
}

float ResumedImage::At(size_t channel, size_t p) const {
  return image_.planes[planes_[channel]][p];
}

float ResumedImage::LightAt(size_t channel, size_t p) const {
  return light_planes_.empty() ? 0 : image_.planes[light_planes_[channel]][p];
}

float ResumedImage::CountAt(size_t p) const {
  // The image counts what is not finite of both kinds of path.
  return At(kSamples, p) + (At(kNonFinite, p) - LightAt(kLightNonFinite, p));
}

absl::StatusOr<uint64_t> ResumedImage::SamplesOf(const PixelRect& tile) const {
  const float count = CountAt(image_.window.IndexOf(tile.x0, tile.y0));
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    for (int32_t x = tile.x0; x < tile.x1; ++x) {
      if (CountAt(image_.window.IndexOf(x, y)) == count) continue;
      const auto tile_size = image_.metadata.find("tileSizePx");
      const auto cell_size = image_.metadata.find("cellSizePx");  // Earlier versions had none.
      std::string flags;
      if (tile_size != image_.metadata.end()) {
        absl::StrAppend(&flags, ": continue with --tile-size ", tile_size->second);
        if (cell_size != image_.metadata.end()) {
          absl::StrAppend(&flags, " --cell-size ", cell_size->second);
        }
      }
      return Refuse(absl::StrCat("its samples were allocated to tiles of another size", flags));
    }
  }
  return static_cast<uint64_t>(count);
}

void ResumedImage::SetColor(TaskKind kind, size_t p, Pixel* pixel) const {
  Vec3d color, error;
  for (size_t i = 0; i < 3; ++i) {
    const double light = LightAt(kLightMean + i, p), light_error = LightAt(kLightError + i, p);
    if (kind == TaskKind::kLight) {
      color[i] = light;
      error[i] = light_error;
      continue;
    }
    const double all_error = At(kColorErrorPlane + i, p);
    color[i] = At(kColorPlane + i, p) - light;
    error[i] = std::sqrt(std::max(0.0, all_error * all_error - light_error * light_error));
  }
  // Sixteen means, half of them d above and half d below their mean, have a standard error of d /
  // sqrt(15) (error_estimate.h).
  pixel->color = TransformVector(srgb_from_light_, color);
  pixel->deviation = TransformVector(srgb_from_light_, error) * std::sqrt(kReplicateCount - 1.0);
}

void ResumedImage::SetMeans(TaskKind kind, size_t p, Pixel* pixel) const {
  std::vector<float>& means = pixel->means;
  const size_t group_count = 3 * outputs_.light_groups.size();
  const size_t first_group = mean_channels_.size() - group_count;  // They are the last ones.
  for (size_t i = 0; i < mean_channels_.size(); ++i) {
    const float light = i < first_group ? 0 : LightAt(kLightGroups + i - first_group, p);
    means.push_back(kind == TaskKind::kLight ? light : At(kOutputs + i, p) - light);
  }
  for (size_t i = 0; i < mean_channels_.size(); ++i) {
    if (!mean_channels_[i].starts_color || color_is_srgb_) continue;
    const Vec3d srgb = TransformVector(
        srgb_from_light_, {double{means[i]}, double{means[i + 1]}, double{means[i + 2]}});
    for (size_t k = 0; k < 3; ++k) means[i + k] = static_cast<float>(srgb[k]);
  }
}

ResumedImage::Pixel ResumedImage::PixelAt(TaskKind kind, int32_t x, int32_t y) const {
  const size_t p = image_.window.IndexOf(x, y);
  Pixel pixel;
  SetColor(kind, p, &pixel);
  SetMeans(kind, p, &pixel);
  pixel.signs = DrawSigns(kind, x, y);
  if (kind == TaskKind::kLight) {
    // Splats that are not finite are no passes (light_pass_accumulator.h).
    pixel.finite = LightAt(kLightPasses, p);
    pixel.nonfinite = LightAt(kLightNonFinite, p);
    return pixel;
  }
  pixel.finite = At(kSamples, p);
  pixel.nonfinite = At(kNonFinite, p) - LightAt(kLightNonFinite, p);
  Vec3d albedo;
  for (size_t i = 0; i < 3; ++i) albedo[i] = At(kAlbedo + i, p);
  albedo = TransformVector(srgb_from_albedo_, albedo);
  pixel.weighted[0] = At(kAlpha, p);
  for (size_t i = 0; i < 3; ++i) {
    pixel.weighted[1 + i] = static_cast<float>(albedo[i]);
    pixel.weighted[4 + i] = At(kNormal + i, p);
  }
  pixel.depth = At(kDepth, p);
  return pixel;
}

FilmTile ResumedImage::LightPartOf(const SampleBlock& block) const {
  FilmTile part(image_.window, block, outputs_);
  size_t to = 0;
  for (int32_t y = image_.window.y0; y < image_.window.y1; ++y) {
    for (int32_t x = image_.window.x0; x < image_.window.x1; ++x, ++to) {
      const Pixel pixel = PixelAt(TaskKind::kLight, x, y);
      if (block.first == 0) {
        part.channel(FilmChannel::kNonFiniteCount)[to] = static_cast<float>(pixel.nonfinite);
      }
      AddPixel(pixel, to, static_cast<double>(block.count), &part);
    }
  }
  return part;
}

std::vector<FilmTile> ResumedImage::PartsOf(const PixelRect& tile) const {
  const absl::StatusOr<uint64_t> samples = SamplesOf(tile);
  SHEAF_CHECK(samples.ok());
  std::vector<FilmTile> parts;
  for (const SampleBlock& block : PrefixBlocks(*samples)) parts.emplace_back(tile, block, outputs_);
  size_t to = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    for (int32_t x = tile.x0; x < tile.x1; ++x, ++to) {
      const Pixel pixel = PixelAt(TaskKind::kCamera, x, y);
      double nonfinite_left = pixel.nonfinite;
      for (FilmTile& part : parts) {
        const auto count = static_cast<double>(part.block().count);
        const double nonfinite = std::min(nonfinite_left, count);
        nonfinite_left -= nonfinite;
        part.channel(FilmChannel::kNonFiniteCount)[to] = static_cast<float>(nonfinite);
        AddPixel(pixel, to, count - nonfinite, &part);
      }
    }
  }
  return parts;
}

// sample_count: the number of the pixel's finite samples in the part's block.
void ResumedImage::AddPixel(const Pixel& pixel, size_t to, double sample_count,
                            FilmTile* part) const {
  constexpr std::array<std::array<FilmChannel, 2>, 3> kSums{
      {{FilmChannel::kRedHi, FilmChannel::kRedLo},
       {FilmChannel::kGreenHi, FilmChannel::kGreenLo},
       {FilmChannel::kBlueHi, FilmChannel::kBlueLo}}};
  const double n = sample_count;
  for (size_t i = 0; i < 3; ++i) {
    SetWide(pixel.color[i] * n, &part->channel(kSums[i][0])[to], &part->channel(kSums[i][1])[to]);
  }
  SetWide(n, &part->channel(FilmChannel::kWeight)[to], &part->channel(FilmChannel::kWeightLo)[to]);
  part->channel(FilmChannel::kSampleCount)[to] = static_cast<float>(n);
  const double surface = double{pixel.weighted[0]} * n;
  for (size_t i = 0; i < pixel.weighted.size(); ++i) {
    const auto channel = static_cast<FilmChannel>(static_cast<size_t>(FilmChannel::kAlpha) + i);
    part->channel(channel)[to] = static_cast<float>(double{pixel.weighted[i]} * n);
  }
  part->channel(FilmChannel::kDepth)[to] = static_cast<float>(pixel.depth * surface);
  for (size_t i = 0; i < mean_channels_.size(); ++i) {
    const double sum = double{pixel.means[i]} * (mean_channels_[i].of_surface ? surface : n);
    SetWide(sum, &part->mean(i, 0)[to], &part->mean(i, 1)[to]);
  }
  // The first block holds all replicates and their deviations.
  const uint32_t slots = part->replicate_count();
  const bool deviates = part->block().first == 0;
  const double spread = deviates ? pixel.finite / kReplicateCount : 0;
  for (uint32_t slot = 0; slot < slots; ++slot) {
    const double sign = pixel.signs[part->replicate_first() + slot];
    for (size_t i = 0; i < 3; ++i) {
      part->replicate(slot, i)[to] =
          static_cast<float>(pixel.color[i] * n / slots + sign * spread * pixel.deviation[i]);
    }
    part->replicate(slot, 3)[to] = static_cast<float>(n / slots);
  }
}

}  // namespace sheaf
