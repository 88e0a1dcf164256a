// Ctrl-C and SIGTERM as a question that a loop asks, rather than something that happens to it.
#pragma once

#include <csignal>

namespace terrane {

/// While one lives, SIGINT and SIGTERM wait to be asked for. Make it before any other thread:
/// threads take the mask of the one that starts them, and a thread without it would still be
/// interrupted. One at a time, on one thread.
class InterruptWatch {
  public:
    InterruptWatch();
    ~InterruptWatch();
    InterruptWatch(const InterruptWatch&) = delete;
    InterruptWatch& operator=(const InterruptWatch&) = delete;

    /// True from the first signal on.
    bool interrupted();

  private:
    sigset_t watched_{};
    sigset_t before_{};
    bool interrupted_ = false;
};

}  // namespace terrane
