// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/film_response.h"

#include <algorithm>

#include "common/base/check.h"
#include "common/film/image_color.h"
#include "common/scene/spectrum/sensor.h"

namespace sheaf::render {

FilmResponse FilmResponse::Make(const FilmDescription& film, const FrameSettings& settings) {
  FilmResponse response;
  response.exposure_ = film.exposure_scale;
  response.component_max_ = static_cast<double>(settings.max_component_value);
  response.observer_ = &StandardObserver();
  response.sensor_from_rgb_ = *XyzFromRgb(Chromaticities());
  if (settings.sensor.empty()) return response;
  const Matrix4 rgb_from_sensor = SummedFromSensor(settings.sensor);
  SHEAF_CHECK(Invert(rgb_from_sensor, &response.sensor_from_rgb_));
  response.sensor_ = std::make_shared<const ObserverTable>(MakeObserver([&](double nm) {
    const std::array<double, 3> r = SensorResponse(settings.sensor, nm);
    const Vec3d rgb = TransformVector(rgb_from_sensor, {r[0], r[1], r[2]});
    return std::array<double, 3>{rgb.x, rgb.y, rgb.z};
  }));
  response.observer_ = response.sensor_.get();
  return response;
}

float FilmResponse::ClampScale(Rgb sample) const {
  const Vec3d responses = TransformVector(
      sensor_from_rgb_, {static_cast<double>(sample.r), static_cast<double>(sample.g),
                         static_cast<double>(sample.b)});
  const double largest = std::max({responses.x, responses.y, responses.z});
  return largest > component_max_ ? static_cast<float>(component_max_ / largest) : 1;
}

}  // namespace sheaf::render
