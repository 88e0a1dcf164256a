#include "server/cli/interrupt.h"

#include <csignal>
#include <ctime>

namespace terrane {

InterruptWatch::InterruptWatch() {
    sigemptyset(&watched_);
    sigaddset(&watched_, SIGINT);
    sigaddset(&watched_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &watched_, &before_);
}

InterruptWatch::~InterruptWatch() {
    interrupted();  // one that is still pending has been answered by ending
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

bool InterruptWatch::interrupted() {
    const timespec at_once{};
    while (sigtimedwait(&watched_, nullptr, &at_once) > 0) {
        interrupted_ = true;
    }
    return interrupted_;
}

}  // namespace terrane
