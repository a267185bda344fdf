// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/animation.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/nearest_name.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

using Target = std::pair<int, std::string>;

std::set<Target> TargetsOf(const tinygltf::Animation& animation) {
  std::set<Target> targets;
  for (const tinygltf::AnimationChannel& channel : animation.channels) {
    targets.emplace(channel.target_node, channel.target_path);
  }
  return targets;
}

bool Overlap(const std::set<Target>& a, const std::set<Target>& b) {
  return std::any_of(a.begin(), a.end(), [&](const Target& t) { return b.contains(t); });
}

}  // namespace

Animations::Animations(const tinygltf::Model& model, const std::string& name, Accessors* accessors,
                       SkippedParts* skipped, Diagnostics* diagnostics)
    : model_(&model), accessors_(accessors), skipped_(skipped), diagnostics_(diagnostics) {
  std::set<Target> taken;
  std::vector<std::string> names;
  bool found = name.empty();
  for (size_t a = 0; a < model.animations.size(); ++a) {
    const tinygltf::Animation& animation = model.animations[a];
    const std::string what = Named("animation", static_cast<int>(a), animation.name);
    names.push_back(animation.name);
    if (!name.empty() && animation.name != name) continue;
    const std::set<Target> targets = TargetsOf(animation);
    if (Overlap(targets, taken)) {
      if (name.empty()) {
        skipped->Add(what,
                     "it moves what an earlier one moves, and is left out; choose it by "
                     "--animation");
      }
      continue;
    }
    found = true;
    taken.insert(targets.begin(), targets.end());
    for (const tinygltf::AnimationChannel& channel : animation.channels) {
      if (!Add(animation, channel, what)) return;
    }
  }
  if (!found) {
    diagnostics->Error(
        kFile, absl::StrCat("there is no animation \"", name, "\"", NearestNameHint(name, names),
                            "; give one of the file's by --animation"));
  }
}

bool Animations::Add(const tinygltf::Animation& animation, const tinygltf::AnimationChannel& source,
                     const std::string& what) {
  if (source.target_node < 0) {
    skipped_->Add(what, "what it moves other than nodes stays as it is");
    return true;
  }
  Channel channel;
  if (source.target_path == "translation") {
    channel.path = Path::kTranslation;
  } else if (source.target_path == "rotation") {
    channel.path = Path::kRotation;
    channel.width = 4;
  } else if (source.target_path == "scale") {
    channel.path = Path::kScale;
  } else if (source.target_path == "weights") {
    channel.path = Path::kWeights;
    channel.width = 0;  // The number of weights follows from the number of values.
  } else {
    skipped_->Add(what, absl::StrCat("\"", source.target_path, "\" of nodes stays as it is"));
    return true;
  }
  if (!HasIndex(model_->nodes, source.target_node) ||
      !HasIndex(animation.samplers, source.sampler)) {
    diagnostics_->Error(kFile, absl::StrCat(what,
                                            " refers to a node or sampler that does not "
                                            "exist; export the file again"));
    return false;
  }
  channel.node = static_cast<size_t>(source.target_node);
  if (!AddKeys(animation.samplers[static_cast<size_t>(source.sampler)], what, &channel)) {
    return false;
  }
  channels_.push_back(std::move(channel));
  return true;
}

bool Animations::AddKeys(const tinygltf::AnimationSampler& sampler, const std::string& what,
                         Channel* channel) {
  channel->interpolation = sampler.interpolation == "STEP"          ? Interpolation::kStep
                           : sampler.interpolation == "CUBICSPLINE" ? Interpolation::kCubic
                                                                    : Interpolation::kLinear;
  std::optional<std::vector<float>> times = accessors_->Floats(sampler.input, 1, what + ", times");
  if (!times) return false;
  const int components = channel->width == 0 ? 1 : static_cast<int>(channel->width);
  std::optional<std::vector<float>> values =
      accessors_->Floats(sampler.output, components, what + ", values");
  if (!values) return false;
  const size_t sets =
      times->size() * (channel->interpolation == Interpolation::kCubic ? size_t{3} : size_t{1});
  if (channel->width == 0) channel->width = values->size() / sets;
  if (channel->width == 0 || values->size() != sets * channel->width) {
    diagnostics_->Error(kFile, absl::StrCat(what, " has ", times->size(), " times but ",
                                            values->size(), " numbers for them; export it again"));
    return false;
  }
  if (!std::is_sorted(times->begin(), times->end())) {
    diagnostics_->Error(kFile,
                        absl::StrCat(what, " has times that do not ascend; export it again"));
    return false;
  }
  channel->times_s = *std::move(times);
  channel->values = *std::move(values);
  return true;
}

std::vector<double> Animations::ValueAt(const Channel& channel, double time_s) {
  const std::vector<float>& times = channel.times_s;
  const bool is_cubic = channel.interpolation == Interpolation::kCubic;
  // Set `part` of key k: of a cubic one the in-tangent, the value or the out-tangent.
  const auto number = [&](size_t k, size_t part, size_t c) {
    return static_cast<double>(channel.values[((is_cubic ? 3 * k + part : k)) * channel.width + c]);
  };
  const auto after = static_cast<size_t>(
      std::upper_bound(times.begin(), times.end(), static_cast<float>(time_s)) - times.begin());
  const size_t k = after == 0 ? 0 : after - 1;
  std::vector<double> value(channel.width);
  for (size_t c = 0; c < channel.width; ++c) value[c] = number(k, 1, c);
  if (after == 0 || after == times.size() || channel.interpolation == Interpolation::kStep) {
    return value;
  }
  const double length = static_cast<double>(times[k + 1]) - static_cast<double>(times[k]);
  const double t = length > 0 ? (time_s - static_cast<double>(times[k])) / length : 0;
  if (!is_cubic && channel.path == Path::kRotation) {
    const auto key = [&](size_t i) {
      return Normalized({number(i, 1, 0), number(i, 1, 1), number(i, 1, 2), number(i, 1, 3)});
    };
    const Quaternion q = Slerp(key(k), key(k + 1), std::clamp(t, 0.0, 1.0));
    return {q.x, q.y, q.z, q.w};
  }
  for (size_t c = 0; c < channel.width; ++c) {
    const double a = number(k, 1, c), b = number(k + 1, 1, c);
    if (is_cubic) {
      // Source: glTF 2.0 specification, appendix C.5 (Hermite splines).
      const double t2 = t * t, t3 = t2 * t;
      value[c] = (2 * t3 - 3 * t2 + 1) * a + length * (t3 - 2 * t2 + t) * number(k, 2, c) +
                 (-2 * t3 + 3 * t2) * b + length * (t3 - t2) * number(k + 1, 0, c);
    } else {
      value[c] = a + (b - a) * t;
    }
  }
  return value;
}

std::vector<Pose> Animations::At(double time_s, const std::vector<Pose>& poses) const {
  std::vector<Pose> moved = poses;
  for (const Channel& channel : channels_) {
    const std::vector<double> value = ValueAt(channel, time_s);
    Pose& pose = moved[channel.node];
    switch (channel.path) {
      case Path::kTranslation:
        pose.translation = {value[0], value[1], value[2]};
        pose.matrix.reset();
        break;
      case Path::kRotation:
        pose.rotation = Normalized({value[0], value[1], value[2], value[3]});
        pose.matrix.reset();
        break;
      case Path::kScale:
        pose.scale = {value[0], value[1], value[2]};
        pose.matrix.reset();
        break;
      case Path::kWeights:
        pose.weights = value;
        break;
    }
  }
  return moved;
}

}  // namespace sheaf::gltf
