# SPDX-License-Identifier: Apache-2.0
# Cost of a compiled-in trait for a scene that does not use it: counted, not timed.
set(ablated_sources)
foreach(trait kTextures kDeltaLights kAreaLights kSpecularTransmission
        kLayered kMicrofacet kInstances kQuadrics kVertexNormals)
  set(SHEAF_VARIANT_TRAITS "CommonWithout(Trait::${trait})")
  set(ablated_source ${CMAKE_CURRENT_BINARY_DIR}/ablated_${trait}.cc)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/ablated_variant.cc.in ${ablated_source} @ONLY)
  list(APPEND ablated_sources ${ablated_source})
endforeach()
sheaf_add_test(NAME trait_cost LONG DEPS sheaf::render
  PRECOMPILE <worker/render/integrator/variants.h> <worker/render/bsdf/bsdf_inl.h> SOURCES
  cost/trait_cost_test.cc ${ablated_sources})
# The same flags as for worker/render, or the counts would compare compiler settings.
target_compile_options(sheaf_trait_cost_test PRIVATE $<$<CONFIG:Release>:-O3>)
sheaf_add_script_test(NAME trait_cost LABEL slow
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_LIST_DIR}/trait_cost_count.py)
