// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts every basis to cubic Bezier segments, in double with one rounding. Neighbors compute
// shared points from the same numbers in the same way, so that curves stay connected. Source: Farin
// 2002, "Curves and Surfaces for CAGD", ch. 5 and 8; parameters as in pbrt-v4.
#include "common/scene/pbrt/statements/curve_reader.h"

#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

struct Basis {
  bool is_spline = false;
  size_t degree = 3;
};

// Degree elevation: a quadratic's three control points as a cubic's four.
std::array<Vec3d, 4> Elevate(Vec3d a, Vec3d b, Vec3d c) {
  return {a, (a + b * 2.0) / 3.0, (b * 2.0 + c) / 3.0, c};
}
// p: the degree + 1 control points that define the segment.
std::array<Vec3d, 4> BezierOf(const Basis& basis, const Vec3f* p) {
  const Vec3d a = ToDouble(p[0]), b = ToDouble(p[1]), c = ToDouble(p[2]);
  if (basis.degree == 2) {
    return basis.is_spline ? Elevate((a + b) / 2.0, b, (b + c) / 2.0) : Elevate(a, b, c);
  }
  const Vec3d d = ToDouble(p[3]);
  if (!basis.is_spline) return {a, b, c, d};
  return {(a + b * 4.0 + c) / 6.0, (b * 2.0 + c) / 3.0, (b + c * 2.0) / 3.0,
          (b + c * 4.0 + d) / 6.0};
}

std::optional<Basis> ReadBasis(ParameterList& parameters) {
  const std::string name = parameters.GetString("basis", "bezier");
  const int32_t degree = parameters.GetInteger("degree", 3);
  bool is_good = true;
  if (name != "bezier" && name != "bspline") {
    parameters.ErrorAt(*parameters.Find("basis"),
                       absl::StrCat("is \"", name, "\"; it must be bezier or bspline"));
    is_good = false;
  }
  if (degree != 2 && degree != 3) {
    parameters.ErrorAt(*parameters.Find("degree"),
                       absl::StrCat("is ", degree, "; it must be 2 or 3"));
    is_good = false;
  }
  if (!is_good) return std::nullopt;
  return Basis{name == "bspline", static_cast<size_t>(degree)};
}

std::optional<CurveSet::Kind> ReadKind(ParameterList& parameters) {
  const std::string name = parameters.GetString("type", "flat");
  if (name == "flat") return CurveSet::Kind::kFlat;
  if (name == "cylinder") return CurveSet::Kind::kCylinder;
  if (name == "ribbon") return CurveSet::Kind::kRibbon;
  parameters.ErrorAt(*parameters.Find("type"),
                     absl::StrCat("is \"", name, "\"; it must be flat, cylinder or ribbon"));
  return std::nullopt;
}

// 0 (reported) if P does not make a curve.
size_t SegmentCount(ParameterList& parameters, const Basis& basis, size_t point_count) {
  const size_t degree = basis.degree;
  if (point_count > degree && (basis.is_spline || (point_count - 1) % degree == 0)) {
    return basis.is_spline ? point_count - degree : (point_count - 1) / degree;
  }
  const std::string need = basis.is_spline ? absl::StrCat(degree + 1, " or more")
                                           : absl::StrCat(degree + 1, ", and ", degree,
                                                          " for each further "
                                                          "segment");
  parameters.Error(absl::StrCat(parameters.owner(), " needs \"point3 P\", its control points: ",
                                need, " for this basis and degree, but has ", point_count));
  return 0;
}

bool ReadWidths(ParameterList& parameters, size_t segment_count, std::vector<float>* widths) {
  const float width = parameters.GetFloat("width", 1);
  const float begin = parameters.GetFloat("width0", width);
  const float end = parameters.GetFloat("width1", width);
  if (!(begin >= 0) || !(end >= 0) || !std::isfinite(begin) || !std::isfinite(end)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": its width goes from ", begin, " to ", end,
                                  "; neither may be less than 0"));
    return false;
  }
  const auto at = [&](size_t i) {
    const double along = static_cast<double>(i) / static_cast<double>(segment_count);
    return static_cast<float>(begin * (1 - along) + end * along);
  };
  for (size_t i = 0; i < segment_count; ++i) {
    widths->push_back(at(i));
    widths->push_back(at(i + 1));
  }
  return true;
}

bool ReadNormals(ParameterList& parameters, size_t segment_count, CurveSet* curve) {
  if (curve->kind != CurveSet::Kind::kRibbon) {
    parameters.NoteWithoutEffect("N", "only curves of type ribbon face along normals");
    return true;
  }
  const std::vector<Vec3f> normals = parameters.GetTriples("N", ParameterType::kNormal);
  if (normals.size() != segment_count + 1) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " of type ribbon needs \"normal N\" at each "
                                  "end of its segments: ",
                                  segment_count + 1, ", but has ", normals.size()));
    return false;
  }
  const auto unit = [&](size_t i) {
    const Vec3d n = ToDouble(normals[i]);
    return ToFloat(n * (1 / Length(n)));
  };
  for (size_t i = 0; i <= segment_count; ++i) {
    if (LengthSquared(ToDouble(normals[i])) > 0) continue;
    parameters.ErrorAt(*parameters.Find("N"), absl::StrCat("has no length at entry ", i));
    return false;
  }
  for (size_t i = 0; i < segment_count; ++i) {
    curve->normals.push_back(unit(i));
    curve->normals.push_back(unit(i + 1));
  }
  return true;
}

}  // namespace

bool ReadCurve(ParameterList& parameters, CurveSet* curve) {
  const std::vector<Vec3f> points = parameters.GetTriples("P", ParameterType::kPoint3);
  const std::optional<Basis> basis = ReadBasis(parameters);
  const std::optional<CurveSet::Kind> kind = ReadKind(parameters);
  // Controls how pbrt splits curves to trace them; the tracer here decides by their shape, and the
  // image is the same.
  parameters.GetInteger("splitdepth", 3);
  const size_t count = basis.has_value() ? SegmentCount(parameters, *basis, points.size()) : 0;
  if (count == 0 || !kind.has_value()) {
    for (const char* name : {"width", "width0", "width1", "N"}) parameters.Find(name);
    return false;
  }
  curve->kind = *kind;
  const size_t step = basis->is_spline ? 1 : basis->degree;
  for (size_t i = 0; i < count; ++i) {
    for (const Vec3d& p : BezierOf(*basis, &points[i * step])) curve->points.push_back(ToFloat(p));
  }
  const bool has_widths = ReadWidths(parameters, count, &curve->widths);
  return ReadNormals(parameters, count, curve) && has_widths;
}

}  // namespace sheaf
