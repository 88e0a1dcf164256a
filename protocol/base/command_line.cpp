#include "protocol/base/command_line.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>

namespace terrane {

bool output_is_whole() {
    errno = 0;
    std::cout.flush();
    const bool whole = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
    if (!whole) {
        std::fprintf(stderr, "standard output: %s\n",
                     errno != 0 ? std::strerror(errno) : "it could not be written");
    }
    return whole;
}

}  // namespace terrane
