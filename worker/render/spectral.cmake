# SPDX-License-Identifier: Apache-2.0
# What a path carries: RGB or wavelengths, and the colours of the scene as spectra.
sheaf_add_module(NAME render_spectral
  HEADERS render_plan.h sigmoid_spectrum.h spectral_color.h trait_set.h upsampling_table.h wavelengths.h
  SOURCES sigmoid_spectrum.cc spectral_color.cc upsampling_table.cc
  DEPS sheaf::base sheaf::math sheaf::scene
  TESTS spectral_color_test.cc)
