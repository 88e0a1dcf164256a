// WebAssembly has one instruction set, so there is nothing to choose.
#include "generator/mesh/kernels/mesh_kernels.h"

namespace terrane {

namespace kernels_native {
extern const MeshKernels kMeshKernels;
}

const MeshKernels& chosen_mesh_kernels() {
    return kernels_native::kMeshKernels;
}

}  // namespace terrane
