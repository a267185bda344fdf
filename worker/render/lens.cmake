# SPDX-License-Identifier: Apache-2.0
# What cameras are made of: openings, lenses, shutters.
sheaf_add_module(NAME render_lens
  HEADERS aperture_shape.h exit_pupil.h lens_system.h realistic_lens.h shutter_shape.h
  SOURCES aperture_shape.cc exit_pupil.cc lens_system.cc realistic_lens.cc shutter_shape.cc
  DEPS sheaf::math sheaf::scene sheaf::render_sampling
  TESTS lens_system_test.cc
)
