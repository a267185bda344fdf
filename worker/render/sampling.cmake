# SPDX-License-Identifier: Apache-2.0
# Sample points, the shapes and maps that light comes from, and the table of lights.
sheaf_add_module(NAME render_sampling
  HEADERS
    area_light_sampling.h sampler.h sobol_points.h discrete_distribution.h shape_sampling.h equal_area_map.h
    equiangular.h emission_map.h environment_map.h map_partition.h intensity_map.h light_bounds.h
    light_choice.h light_cluster.h light_image.h light_reader.h light_tree.h light_table.h
    light_table_impl.h photometric_web.h projected_image.h quadric.h sky_portal.h
  SOURCES
    sobol_points.cc discrete_distribution.cc shape_sampling.cc equal_area_map.cc
    equiangular.cc environment_map.cc map_partition.cc intensity_map.cc light_choice.cc light_reader.cc
    light_tree.cc light_tree_build.cc light_table.cc light_table_build.cc photometric_web.cc
    projected_image.cc emission_map.cc light_image.cc quadric.cc sky_portal.cc
  DEPS sheaf::render_spectral sheaf::base sheaf::film sheaf::math sheaf::scene
  PRIVATE_DEPS sheaf::image
  TESTS
    equal_area_map_test.cc equiangular_test.cc map_partition_test.cc light_choice_test.cc
    light_tree_test.cc
)
