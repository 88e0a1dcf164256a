// Inner loops of whole numbers that have a version for each instruction set in one function, chosen
// when the program starts. (Loops with floats are in generator/terrain/kernels, where tests can
// choose.)
#pragma once

// Sanitizers do not get on with the resolvers, which run before they are ready; clang 14 to 19
// cannot clone for whole levels.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__clang__)
#define TERRANE_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define TERRANE_CLONES
#endif
