// Processor time of the calling thread: what else the machine does disturbs it less than the
// wall's.
#pragma once

#include <ctime>

namespace terrane::bench {

inline double thread_seconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace terrane::bench
