# SPDX-License-Identifier: Apache-2.0
# How surfaces scatter: the Bsdf, the tables behind it, materials and textures.
sheaf_add_module(NAME render_shading
  HEADERS
    bsdf.h bsdf_coat.h bsdf_conductor.h bsdf_conductor_coat.h bsdf_dielectric.h
    bsdf_diffuse_transmission.h bsdf_hair.h bsdf_inl.h bsdf_measured.h bsdf_sampling.h coat_table.h
    conductor_coat_table.h energy_table.h facet_quadrature.h fresnel.h material.h material_impl.h
    measured_brdf.h microfacet.h surface_tilt.h texture_program.h warp_table.h
  SOURCES
    bsdf.cc coat_table.cc conductor_coat_table.cc energy_table.cc material.cc material_build.cc
    measured_brdf.cc normal_map.cc warp_table.cc texture_program.cc texture_program_build.cc
  DEPS sheaf::render_spectral sheaf::base sheaf::math sheaf::scene sheaf::image
  TESTS coat_table_test.cc conductor_coat_table_test.cc material_test.cc)
