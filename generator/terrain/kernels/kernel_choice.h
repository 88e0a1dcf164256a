// Which row kernels this process uses.
#pragma once

#include "generator/terrain/kernels/row_kernels.h"
#include "protocol/base/result.h"

#include <span>
#include <string_view>

namespace terrane {

struct KernelSet {
    std::string_view name;      ///< as TERRANE_SIMD spells it
    const RowKernels* kernels;  ///< lives for ever
};

/// The sets that this build has and this processor can run, slowest first; never empty.
std::span<const KernelSet> available_kernel_sets();

/// What TERRANE_SIMD names, or the fastest set if it is unset or empty. Fails with
/// `invalid_argument` if the name is unknown or the processor cannot run it: programs check once at
/// the start.
Result<KernelSet> kernel_set_from_environment();

/// The same, falling back to the fastest set.
const RowKernels& chosen_row_kernels();

}  // namespace terrane
