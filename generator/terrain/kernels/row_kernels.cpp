// Row kernels: compiled once per instruction set (see CMakeLists.txt).
namespace terrane::TERRANE_KERNEL_SET {
}  // namespace terrane::TERRANE_KERNEL_SET
