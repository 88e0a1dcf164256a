#include "generator/mesh/kernels/mesh_kernels.h"
#include "generator/terrain/kernels/kernel_choice.h"

namespace terrane {

const MeshKernels& mesh_kernels_beside(const RowKernels& row_kernels) {
    const RowKernels* const chosen = &row_kernels;
#ifdef __x86_64__
    if (chosen == &kernels_avx512::kKernels) {
        return kernels_avx512::kMeshKernels;
    }
    if (chosen == &kernels_avx2::kKernels) {
        return kernels_avx2::kMeshKernels;
    }
    if (chosen == &kernels_sse2::kKernels) {
        return kernels_sse2::kMeshKernels;
    }
#else
    if (chosen == &kernels_native::kKernels) {
        return kernels_native::kMeshKernels;
    }
#endif
    return kernels_scalar::kMeshKernels;
}

const MeshKernels& chosen_mesh_kernels() {
    return mesh_kernels_beside(chosen_row_kernels());
}

}  // namespace terrane
