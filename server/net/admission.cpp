#include "server/net/admission.h"

#include "protocol/base/mutex.h"

#include <cstddef>
#include <string>

namespace terrane {

bool Admission::enter(const std::string& address) {
    const MutexLock lock(mutex_);
    if (sessions_ >= sessions_max_) {
        return false;
    }
    const auto found = by_address_.try_emplace(address, 0).first;
    if (found->second >= per_address_max_) {
        return false;
    }
    ++found->second;
    ++sessions_;
    return true;
}

void Admission::leave(const std::string& address) {
    {
        const MutexLock lock(mutex_);
        --sessions_;
        const auto found = by_address_.find(address);
        if (--found->second == 0) {
            by_address_.erase(found);
        }
    }
    changed_.notify_all();
}

std::size_t Admission::sessions() const {
    const MutexLock lock(mutex_);
    return sessions_;
}

bool Admission::wait_until_empty(Clock::time_point deadline) {
    MutexLock lock(mutex_);
    while (sessions_ > 0) {
        if (Clock::now() >= deadline) {
            return false;
        }
        lock.wait_until(changed_, deadline);
    }
    return true;
}

}  // namespace terrane
