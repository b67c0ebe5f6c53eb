#pragma once

#include "similarity/packed_ct.h"

namespace usct {

/// Makes PackedCt::gradient(), by the vector instructions of the machine.
PackedGradient with_gradient(const PackedCt& ct);

}  // namespace usct
