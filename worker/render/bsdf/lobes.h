// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lobes: the list of every lobe. A new lobe is named here and in BsdfKind.
#pragma once

#include "worker/render/bsdf/coated_conductor_lobe.h"
#include "worker/render/bsdf/coated_diffuse_lobe.h"
#include "worker/render/bsdf/conductor_lobe.h"
#include "worker/render/bsdf/dielectric_lobe.h"
#include "worker/render/bsdf/diffuse_lobe.h"
#include "worker/render/bsdf/diffuse_transmission_lobe.h"
#include "worker/render/bsdf/hair_lobe.h"
#include "worker/render/bsdf/interface_lobe.h"
#include "worker/render/bsdf/lobe.h"
#include "worker/render/bsdf/measured_lobe.h"
#include "worker/render/bsdf/principled_lobe.h"
#include "worker/render/bsdf/thin_dielectric_lobe.h"

namespace sheaf::render {

using Lobes = LobeList<DiffuseLobe, ConductorLobe, DielectricLobe, ThinDielectricLobe,
                       DiffuseTransmissionLobe, CoatedDiffuseLobe, CoatedConductorLobe, HairLobe,
                       MeasuredLobe, PrincipledLobe, InterfaceLobe>;

// The lobe that the surfaces of a material scatter by. Not for mixes and subsurface materials.
template <typename Material>
using LobeOf = typename LobeOfMaterial<Material, Lobes>::type;

}  // namespace sheaf::render
