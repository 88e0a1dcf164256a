#include "generator/terrain/kernels/kernel_choice.h"

#include "generator/terrain/kernels/row_kernels.h"
#include "protocol/base/result.h"

#include <cstdlib>
#include <span>
#include <string>
#include <vector>

namespace terrane {
namespace {

std::vector<KernelSet> find_kernel_sets() {
    std::vector<KernelSet> sets = {{"scalar", &kernels_scalar::kKernels}};
#ifdef __x86_64__
    sets.push_back({"sse2", &kernels_sse2::kKernels});
    // The sets are compiled for these levels as wholes (FMA, LZCNT, MOVBE.. included), so a
    // processor or hypervisor that leaves out any part of one can't run them.
    if (__builtin_cpu_supports("x86-64-v3")) {
        sets.push_back({"avx2", &kernels_avx2::kKernels});
        if (__builtin_cpu_supports("x86-64-v4")) {
            sets.push_back({"avx512", &kernels_avx512::kKernels});
        }
    }
#else
    sets.push_back({"native", &kernels_native::kKernels});
#endif
    return sets;
}

}  // namespace

std::span<const KernelSet> available_kernel_sets() {
    static const std::vector<KernelSet> kSets = find_kernel_sets();
    return kSets;
}

Result<KernelSet> kernel_set_from_environment() {
    const auto sets = available_kernel_sets();
    const char* const wanted = std::getenv("TERRANE_SIMD");
    if (wanted == nullptr || *wanted == '\0') {
        return sets.back();
    }
    std::string names;
    for (const KernelSet& set : sets) {
        if (set.name == wanted) {
            return set;
        }
        names.append(names.empty() ? "" : ", ").append(set.name);
    }
    return fail(ErrorCode::invalid_argument, std::string("TERRANE_SIMD=").append(wanted) +
                                                 ": not known here; this processor has " + names);
}

const RowKernels& chosen_row_kernels() {
    const auto chosen = kernel_set_from_environment();
    return chosen ? *chosen->kernels : *available_kernel_sets().back().kernels;
}

}  // namespace terrane
