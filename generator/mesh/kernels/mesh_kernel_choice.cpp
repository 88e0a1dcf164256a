#include "generator/mesh/kernels/mesh_kernels.h"
#include "generator/terrain/kernels/kernel_choice.h"

namespace terrane {

const MeshKernels& chosen_mesh_kernels() {
    return *chosen_row_kernels().mesh;
}

}  // namespace terrane
