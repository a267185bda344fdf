// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/displaced_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf::render {
namespace {

// Vertices differ in uv or normal; vertices at the same position share a site.
struct Vertex {
  uint32_t site = 0;
  Vec2f uv;
  Vec3f normal;        // The mesh's; linear between its vertices, so not unit length.
  Vec3f tangent = {};  // The mesh's, if it has any.
  VertexColor color = {};
};
using Face = std::array<uint32_t, 3>;  // Vertices.

VertexColor MeanOf(const VertexColor& a, const VertexColor& b) {
  VertexColor mean;
  for (size_t i = 0; i < mean.size(); ++i) mean[i] = 0.5f * (a[i] + b[i]);
  return mean;
}

struct PlaceHash {
  size_t operator()(const Vec3f& p) const {
    uint64_t hash = 0;
    // + 0 unifies the two zeros.
    for (size_t i = 0; i < 3; ++i) {
      hash = (hash ^ std::bit_cast<uint32_t>(p[i] + 0.0f)) * 0x9e3779b97f4a7c15u;
      hash ^= hash >> 29;
    }
    return hash;
  }
};
struct EdgeHash {
  size_t operator()(uint64_t edge) const {
    edge *= 0x9e3779b97f4a7c15u;
    return edge ^ (edge >> 32);
  }
};
uint64_t EdgeOf(uint32_t a, uint32_t b) { return uint64_t{std::min(a, b)} << 32 | std::max(a, b); }

// A corner's contribution to the vertex normal; e1 and e2 are its edges. Source: Max 1999, "Weights
// for computing vertex normals from facet normals".
Vec3d CornerNormal(Vec3d e1, Vec3d e2) {
  const double squares = LengthSquared(e1) * LengthSquared(e2);
  return squares > 0 ? Cross(e1, e2) * (1 / squares) : Vec3d{0, 0, 0};
}
Vec3d UnitOrZero(Vec3d v) {
  const double length = Length(v);
  return length > 0 && std::isfinite(length) ? v * (1 / length) : Vec3d{0, 0, 0};
}

class Refiner {
 public:
  Refiner(const TriangleMesh& mesh, const Affine& target_from_object, double edge_length)
      : target_from_object_(target_from_object), square_max_(edge_length * edge_length) {
    AddVertices(mesh);
  }

  // Returns false if there are more than triangles_max.
  bool Refine(uint64_t triangles_max) {
    const std::vector<Face> coarse = std::move(faces_);
    const std::vector<int8_t> coarse_sides = std::move(sides_);
    faces_.clear();
    sides_.clear();
    std::vector<Face> open;
    for (size_t i = 0; i < coarse.size(); ++i) {
      open.push_back(coarse[i]);
      while (!open.empty()) {
        const Face face = open.back();
        open.pop_back();
        const size_t k = EdgeToCut(face);
        if (k < 3) {
          const uint32_t a = face[k], b = face[(k + 1) % 3], c = face[(k + 2) % 3];
          const uint32_t middle = Midpoint(a, b);
          open.push_back({middle, b, c});
          open.push_back({a, middle, c});
        } else {
          faces_.push_back(face);
          sides_.push_back(coarse_sides[i]);
        }
        if (faces_.size() + open.size() + (coarse.size() - i - 1) > triangles_max) return false;
      }
    }
    return true;
  }

  // Returns false if nothing moves.
  absl::StatusOr<bool> Displace(const HeightFunction& height);
  TriangleMesh Take();

 private:
  void AddVertices(const TriangleMesh& mesh);
  uint32_t SiteAt(Vec3f p) {
    const auto [entry, is_new] = site_of_.emplace(p, static_cast<uint32_t>(sites_.size()));
    if (is_new) sites_.push_back(ToDouble(p));
    return entry->second;
  }
  double SquareLength(uint32_t a, uint32_t b) const {
    const Vec3d edge = sites_[vertices_[b].site] - sites_[vertices_[a].site];
    return LengthSquared(target_from_object_.Vector(edge));
  }
  // Returns the longest edge (by its first corner) if it is too long, else 3.
  size_t EdgeToCut(const Face& face) const {
    size_t longest = 3;
    double square = square_max_;
    for (size_t k = 0; k < 3; ++k) {
      const double own = SquareLength(face[k], face[(k + 1) % 3]);
      if (!(own > square)) continue;
      square = own;
      longest = k;
    }
    return longest;
  }
  uint32_t Midpoint(uint32_t a, uint32_t b);
  // Returns the normal at each site from its faces, whose corners are at `position`.
  template <typename Position>
  std::vector<Vec3d> SiteNormals(const Position& position) const;

  const Affine target_from_object_;
  const double square_max_;
  std::vector<Vec3d> sites_;
  std::vector<Vertex> vertices_;
  std::vector<Face> faces_;
  bool has_tangents_ = false, has_colors_ = false;
  std::vector<int8_t> sides_;     // By face: -1 where the mesh's normals oppose it.
  std::vector<Vec3f> displaced_;  // By site.
  std::unordered_map<Vec3f, uint32_t, PlaceHash> site_of_;
  std::unordered_map<uint64_t, uint32_t, EdgeHash> middle_site_, middle_vertex_;
};

void Refiner::AddVertices(const TriangleMesh& mesh) {
  const bool has_uvs = !mesh.uvs.empty(), has_normals = !mesh.normals.empty();
  has_tangents_ = !mesh.tangents.empty();
  has_colors_ = !mesh.colors.empty();
  if (has_uvs) {
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
      vertices_.push_back({SiteAt(mesh.positions[i]), mesh.uvs[i], {}});
    }
  }
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    Face face;
    for (size_t k = 0; k < 3; ++k) {
      face[k] = mesh.indices[i + k];
      if (has_uvs) continue;
      // The default uvs of a triangle without uvs, as in pbrt-v4.
      constexpr Vec2f kCorners[3] = {{0, 0}, {1, 0}, {1, 1}};
      face[k] = static_cast<uint32_t>(vertices_.size());
      vertices_.push_back({SiteAt(mesh.positions[mesh.indices[i + k]]), kCorners[k], {}});
    }
    faces_.push_back(face);
    sides_.push_back(1);
    for (size_t k = 0; k < 3; ++k) {
      if (has_tangents_) vertices_[face[k]].tangent = mesh.tangents[mesh.indices[i + k]];
      if (has_colors_) vertices_[face[k]].color = mesh.colors[mesh.indices[i + k]];
    }
    if (!has_normals) continue;
    Vec3d sum{0, 0, 0};
    for (size_t k = 0; k < 3; ++k) {
      const Vec3d n = UnitOrZero(ToDouble(mesh.normals[mesh.indices[i + k]]));
      vertices_[face[k]].normal = ToFloat(n);
      sum = sum + n;
    }
    const auto site = [&](size_t k) { return sites_[vertices_[face[k]].site]; };
    if (Dot(Cross(site(1) - site(0), site(2) - site(0)), sum) < 0) sides_.back() = -1;
  }
  site_of_.clear();
  if (has_normals) return;
  const std::vector<Vec3d> normals = SiteNormals([this](uint32_t site) { return sites_[site]; });
  for (Vertex& vertex : vertices_) vertex.normal = ToFloat(normals[vertex.site]);
}

uint32_t Refiner::Midpoint(uint32_t a, uint32_t b) {
  const auto [entry, is_new] =
      middle_vertex_.emplace(EdgeOf(a, b), static_cast<uint32_t>(vertices_.size()));
  if (!is_new) return entry->second;
  const Vertex va = vertices_[a], vb = vertices_[b];
  const auto [site, is_new_site] =
      middle_site_.emplace(EdgeOf(va.site, vb.site), static_cast<uint32_t>(sites_.size()));
  if (is_new_site) sites_.push_back((sites_[va.site] + sites_[vb.site]) * 0.5);
  vertices_.push_back({site->second, (va.uv + vb.uv) * 0.5f, (va.normal + vb.normal) * 0.5f,
                       (va.tangent + vb.tangent) * 0.5f, MeanOf(va.color, vb.color)});
  return entry->second;
}

template <typename Position>
std::vector<Vec3d> Refiner::SiteNormals(const Position& position) const {
  std::vector<Vec3d> normals(sites_.size(), Vec3d{0, 0, 0});
  for (size_t i = 0; i < faces_.size(); ++i) {
    const uint32_t s[3] = {vertices_[faces_[i][0]].site, vertices_[faces_[i][1]].site,
                           vertices_[faces_[i][2]].site};
    const Vec3d p[3] = {position(s[0]), position(s[1]), position(s[2])};
    for (size_t k = 0; k < 3; ++k) {
      const Vec3d part = CornerNormal(p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
      normals[s[k]] = normals[s[k]] + part * static_cast<double>(sides_[i]);
    }
  }
  for (Vec3d& n : normals) n = UnitOrZero(n);
  return normals;
}

absl::StatusOr<bool> Refiner::Displace(const HeightFunction& height) {
  struct Sum {
    Vec3d normal{0, 0, 0};
    double height = 0;
    uint32_t count = 0;
  };
  std::vector<Sum> sums(sites_.size());
  bool moves = false;
  for (const Vertex& vertex : vertices_) {
    const float h = height(vertex.uv, sites_[vertex.site]);
    if (!std::isfinite(h)) {
      return absl::InvalidArgumentError(absl::StrCat("the displacement at uv (", vertex.uv.x, ", ",
                                                     vertex.uv.y, ") is not finite"));
    }
    moves = moves || h != 0;
    Sum& sum = sums[vertex.site];
    sum.normal = sum.normal + UnitOrZero(ToDouble(vertex.normal));
    sum.height += static_cast<double>(h);
    ++sum.count;
  }
  if (!moves) return false;
  displaced_.reserve(sites_.size());
  for (size_t i = 0; i < sites_.size(); ++i) {
    const double mean = sums[i].count > 0 ? sums[i].height / sums[i].count : 0;
    displaced_.push_back(ToFloat(sites_[i] + UnitOrZero(sums[i].normal) * mean));
  }
  return true;
}

TriangleMesh Refiner::Take() {
  const std::vector<Vec3d> normals =
      SiteNormals([this](uint32_t site) { return ToDouble(displaced_[site]); });
  TriangleMesh mesh;
  mesh.positions.reserve(vertices_.size());
  mesh.normals.reserve(vertices_.size());
  mesh.uvs.reserve(vertices_.size());
  mesh.indices.reserve(3 * faces_.size());
  for (const Vertex& vertex : vertices_) {
    const Vec3d n = normals[vertex.site];
    mesh.positions.push_back(displaced_[vertex.site]);
    mesh.normals.push_back(ToFloat(LengthSquared(n) > 0 ? n : UnitOrZero(ToDouble(vertex.normal))));
    mesh.uvs.push_back(vertex.uv);
    if (has_tangents_) mesh.tangents.push_back(vertex.tangent);
    if (has_colors_) mesh.colors.push_back(vertex.color);
  }
  for (const Face& face : faces_) mesh.indices.insert(mesh.indices.end(), face.begin(), face.end());
  return mesh;
}

}  // namespace

absl::StatusOr<TriangleMesh> DisplaceMesh(const TriangleMesh& mesh,
                                          const Affine& target_from_object, double edge_length,
                                          uint64_t triangles_max, const HeightFunction& height) {
  Refiner refiner(mesh, target_from_object, edge_length);
  if (!refiner.Refine(triangles_max)) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the displaced mesh exceeds the limit of ", triangles_max,
                     " triangles (displaced_triangles_max); give it a longer "
                     "\"displacement.edgelength\""));
  }
  const absl::StatusOr<bool> moves = refiner.Displace(height);
  if (!moves.ok()) return moves.status();
  if (!*moves) return mesh;
  TriangleMesh displaced = refiner.Take();
  displaced.file = mesh.file;
  return displaced;
}

}  // namespace sheaf::render
