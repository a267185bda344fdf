# SPDX-License-Identifier: Apache-2.0
# Media of varying density: bounds along a ray, tracking between them, procedural densities.
sheaf_add_module(NAME render_volume
  HEADERS cloud_density.h delta_tracking.h event_stream.h majorant_grid.h medium_glow.h
    varying_medium.h volume_motion.h
  SOURCES cloud_density.cc majorant_grid.cc majorant_walk.cc medium_glow.cc varying_medium.cc
    volume_motion.cc
  DEPS sheaf::render_spectral sheaf::scene sheaf::base sheaf::math sheaf::volume
  PRIVATE_DEPS absl::strings
  TESTS majorant_grid_test.cc medium_glow_test.cc varying_medium_test.cc
    volume_motion_test.cc
)
