// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/cryptomatte.h"
#include "common/film/denoised_output.h"
#include "common/film/pixel_replicates.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

double WideSum(const FilmTile& sums, FilmChannel hi, FilmChannel lo, size_t p) {
  return DoubleFloat{sums.channel(hi)[p], sums.channel(lo)[p]}.Value();
}

double Ratio(double sum, double weight) { return weight == 0 ? 0 : sum / weight; }

// The image's planes, in the order of the tile's channels they come from.
struct Planes {
  std::array<float*, 3> color, error;
  std::array<float*, 7> weighted;  // A, albedo, normal.
  float *depth, *samples, *nonfinite;
  std::vector<MeanChannel> mean_channels;
  std::vector<float*> means;  // One per mean channel; null for those of the film alone.
  std::array<float*, kIdKindCount> id_number{};               // Or null.
  std::array<std::vector<float*>, kIdKindCount> cryptomatte;  // Or empty.
  const ImageColor* color_space = nullptr;  // Null if the image keeps the sums' color.
};
constexpr std::array<FilmChannel, 7> kWeighted{
    FilmChannel::kAlpha,   FilmChannel::kAlbedoR, FilmChannel::kAlbedoG, FilmChannel::kAlbedoB,
    FilmChannel::kNormalX, FilmChannel::kNormalY, FilmChannel::kNormalZ};

Planes FindPlanes(FrameImage* image) {
  const auto find = [image](const char* channel) {
    std::vector<float>* plane = image->Find(channel);
    SHEAF_CHECK(plane != nullptr);
    return plane->data();
  };
  std::vector<MeanChannel> mean_channels = MeanChannelsOf(image->outputs);
  std::vector<float*> means;
  const size_t first_guide = FirstGuideMean(image->outputs);
  for (size_t i = 0; i < mean_channels.size(); ++i) {
    const bool is_guide = i >= first_guide && i - first_guide < kGuideCount;
    means.push_back(is_guide ? nullptr : find(mean_channels[i].name.c_str()));
  }
  Planes planes{{find("R"), find("G"), find("B")},
                {find("stderr.R"), find("stderr.G"), find("stderr.B")},
                {find("A"), find("albedo.R"), find("albedo.G"), find("albedo.B"), find("normal.X"),
                 find("normal.Y"), find("normal.Z")},
                find("depth.Z"),
                find("samples"),
                find("nonfinite"),
                std::move(mean_channels),
                std::move(means),
                {},
                {},
                image->color.AsSummed() ? nullptr : &image->color};
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (image->outputs.HasIdNumber(kind)) {
      planes.id_number[i] = find(IdNumberChannel(kind).c_str());
    }
    if (!image->outputs.HasCryptomatte(kind)) continue;
    for (const std::string& name : CryptomatteChannels(kind)) {
      planes.cryptomatte[i].push_back(find(name.c_str()));
    }
  }
  return planes;
}

// Scales a direction in three planes to unit length, or leaves 0.
void Normalize(float* const* planes, size_t p) {
  double squared = 0;
  for (size_t i = 0; i < 3; ++i) {
    squared += static_cast<double>(planes[i][p]) * static_cast<double>(planes[i][p]);
  }
  const double scale = squared > 0 ? 1 / std::sqrt(squared) : 0;
  for (size_t i = 0; i < 3; ++i) {
    planes[i][p] = static_cast<float>(static_cast<double>(planes[i][p]) * scale);
  }
}

// Converts three planes of linear sRGB to the image's primaries.
void Convert(const Matrix4& color_from_srgb, float* const* planes, size_t p) {
  const Vec3d color = TransformVector(
      color_from_srgb, {static_cast<double>(planes[0][p]), static_cast<double>(planes[1][p]),
                        static_cast<double>(planes[2][p])});
  for (size_t i = 0; i < 3; ++i) planes[i][p] = static_cast<float>(color[i]);
}

// Develops R, G and B from sums that are wider than the image's floats.
void DevelopColor(const FilmTile& sums, size_t from, size_t to, double weight,
                  const Planes& planes) {
  constexpr std::array<FilmChannel, 3> kHi{FilmChannel::kRedHi, FilmChannel::kGreenHi,
                                           FilmChannel::kBlueHi};
  constexpr std::array<FilmChannel, 3> kLo{FilmChannel::kRedLo, FilmChannel::kGreenLo,
                                           FilmChannel::kBlueLo};
  Vec3d mean;
  for (size_t i = 0; i < 3; ++i) mean[i] = Ratio(WideSum(sums, kHi[i], kLo[i], from), weight);
  if (planes.color_space != nullptr) {
    mean = TransformVector(planes.color_space->light_from_srgb, mean);
  }
  const PixelReplicates replicates(sums, from);
  for (size_t i = 0; i < 3; ++i) {
    planes.color[i][to] = static_cast<float>(mean[i]);
    double error = 0;
    if (planes.color_space == nullptr) {
      error = replicates.StandardError(i);
    } else {
      const auto& row = planes.color_space->light_from_srgb.m[i];
      error = replicates.StandardError({row[0], row[1], row[2]});
    }
    planes.error[i][to] = static_cast<float>(error);
  }
}

void DevelopMeans(const FilmTile& sums, size_t from, size_t to, double weight,
                  const Planes& planes) {
  const double surface_weight =
      weight == 0 ? 0 : static_cast<double>(sums.channel(FilmChannel::kAlpha)[from]);
  for (size_t i = 0; i < planes.means.size(); ++i) {
    if (planes.means[i] == nullptr) continue;
    const double sum = DoubleFloat{sums.mean(i, 0)[from], sums.mean(i, 1)[from]}.Value();
    const double by = planes.mean_channels[i].of_surface ? surface_weight : weight;
    planes.means[i][to] = static_cast<float>(Ratio(sum, by));
  }
  for (size_t i = 0; i < planes.means.size(); ++i) {
    if (planes.mean_channels[i].starts_direction) Normalize(&planes.means[i], to);
    if (planes.mean_channels[i].starts_color && planes.color_space != nullptr) {
      Convert(planes.color_space->light_from_srgb, &planes.means[i], to);
    }
  }
}

void DevelopIds(const FilmTile& sums, size_t from, size_t to, double weight, const Planes& planes) {
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const IdSums& ids = sums.ids(static_cast<IdKind>(i));
    if (planes.id_number[i] != nullptr) {
      planes.id_number[i][to] = static_cast<float>(LeadingId(ids.pixels[from]));
    }
    if (planes.cryptomatte[i].empty()) continue;
    const auto values = RankIds(ids.pixels[from], ids.names, weight);
    for (size_t k = 0; k < values.size(); ++k) planes.cryptomatte[i][k][to] = values[k];
  }
}

// from: pixel index in the tile; to: in the image.
void DevelopPixel(const FilmTile& sums, size_t from, size_t to, const Planes& planes) {
  const double weight = WideSum(sums, FilmChannel::kWeight, FilmChannel::kWeightLo, from);
  DevelopColor(sums, from, to, weight, planes);
  for (size_t i = 0; i < kWeighted.size(); ++i) {
    planes.weighted[i][to] = static_cast<float>(Ratio(sums.channel(kWeighted[i])[from], weight));
  }
  if (planes.color_space != nullptr) {
    Convert(planes.color_space->albedo_from_srgb, &planes.weighted[1], to);
  }
  const double alpha_sum = sums.channel(FilmChannel::kAlpha)[from];
  planes.depth[to] = static_cast<float>(
      weight == 0 ? 0 : Ratio(sums.channel(FilmChannel::kDepth)[from], alpha_sum));
  DevelopMeans(sums, from, to, weight, planes);
  DevelopIds(sums, from, to, weight, planes);
  planes.samples[to] = sums.channel(FilmChannel::kSampleCount)[from];
  planes.nonfinite[to] = sums.channel(FilmChannel::kNonFiniteCount)[from];
}

void DevelopEyeDifference(const FilmTile& sums, FrameImage* image) {
  const PixelRect& window = image->window;
  SHEAF_CHECK(sums.rect() == window && window.Width() % 2 == 0);
  const auto half = static_cast<size_t>(window.Width() / 2);
  for (size_t i = 0; i < 3; ++i) {
    std::array<double, 3> weights{};
    weights[i] = 1;
    if (!image->color.AsSummed()) {
      const auto& row = image->color.light_from_srgb.m[i];
      weights = {row[0], row[1], row[2]};
    }
    const std::string channel = absl::StrCat(kEyeDifferenceLayer, ".", std::string(1, "RGB"[i]));
    std::vector<float>& plane = *image->Find(channel);
    for (size_t p = 0; p < plane.size(); ++p) {
      if (p / half % 2 == 1) {
        plane[p] = plane[p - half];
      } else {
        plane[p] = static_cast<float>(StandardErrorOfDifference(sums, p, p + half, weights));
      }
    }
  }
}

}  // namespace

void DevelopTile(const FilmTile& sums, FrameImage* image) {
  const PixelRect tile = sums.rect(), window = image->window;
  SHEAF_CHECK(tile.x0 >= window.x0 && tile.y0 >= window.y0 && tile.x1 <= window.x1 &&
              tile.y1 <= window.y1);
  SHEAF_CHECK(sums.outputs() == image->outputs);
  const Planes planes = FindPlanes(image);
  size_t from = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    size_t to = window.IndexOf(tile.x0, y);
    for (int32_t x = tile.x0; x < tile.x1; ++x) DevelopPixel(sums, from++, to++, planes);
  }
  if (HasEyeDifference(*image)) DevelopEyeDifference(sums, image);
}

void NoteNames(const FilmTile& sums, FrameImage* image) {
  for (size_t i = 0; i < kIdKindCount; ++i) {
    // Only names of ids in the sums: parts may have names of ids that their parents dropped.
    const IdSums& ids = sums.ids(static_cast<IdKind>(i));
    std::set<uint32_t> seen;
    for (const IdList& list : ids.pixels) {
      for (const IdWeight& entry : list) {
        if (entry.id == kNoId || !seen.insert(entry.id).second) continue;
        const auto name = ids.names.find(entry.id);
        SHEAF_CHECK(name != ids.names.end());
        image->id_names[i].insert(name->second);
      }
    }
  }
}

}  // namespace sheaf
