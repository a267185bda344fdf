// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/values.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace sheaf::gltf {

using tinygltf::Value;

const Value* Find(const tinygltf::ExtensionMap& extensions, const std::string& name) {
  const auto found = extensions.find(name);
  return found == extensions.end() || !found->second.IsObject() ? nullptr : &found->second;
}

const Value* Member(const Value* object, const std::string& key) {
  if (object == nullptr || !object->IsObject() || !object->Has(key)) return nullptr;
  return &object->Get(key);
}

double NumberOf(const Value* object, const std::string& key, double fallback) {
  const Value* value = Member(object, key);
  if (value == nullptr || !value->IsNumber()) return fallback;
  const double number = value->GetNumberAsDouble();
  return std::isfinite(number) ? number : fallback;
}

int IndexOf(const Value* object, const std::string& key) {
  const Value* value = Member(object, key);
  return value != nullptr && value->IsInt() ? value->GetNumberAsInt() : -1;
}

std::string TextOf(const Value* object, const std::string& key) {
  const Value* value = Member(object, key);
  return value != nullptr && value->IsString() ? value->Get<std::string>() : "";
}

std::vector<double> NumbersOf(const Value* object, const std::string& key, size_t count,
                              std::vector<double> fallback) {
  const Value* list = Member(object, key);
  if (list == nullptr || list->ArrayLen() != count) return fallback;
  std::vector<double> numbers;
  for (size_t i = 0; i < count; ++i) {
    const Value& value = list->Get(static_cast<int>(i));
    if (!value.IsNumber() || !std::isfinite(value.GetNumberAsDouble())) return fallback;
    numbers.push_back(value.GetNumberAsDouble());
  }
  return numbers;
}

Rgb ColorOfNumbers(const std::vector<double>& numbers, Rgb fallback) {
  if (numbers.size() < 3) return fallback;
  Rgb color;
  for (size_t c = 0; c < 3; ++c) {
    color[c] = static_cast<float>(std::clamp(std::isfinite(numbers[c]) ? numbers[c] : 0, 0., 1e6));
  }
  return color;
}

Rgb ColorOf(const Value* object, const std::string& key, Rgb fallback) {
  return ColorOfNumbers(NumbersOf(object, key, 3, {}), fallback);
}

ColorSpec Color(Rgb rgb) {
  ColorSpec color;
  color.rgb = rgb;
  return color;
}

std::string Named(const char* kind, int index, const std::string& name) {
  return name.empty() ? absl::StrCat(kind, " ", index)
                      : absl::StrCat(kind, " ", index, " \"", name, "\"");
}

}  // namespace sheaf::gltf
