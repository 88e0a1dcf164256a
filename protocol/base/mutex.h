// A mutex that clang's -Wthread-safety understands, so that what it guards is written down and
// checked.
#pragma once

#include <condition_variable>
#include <mutex>

#ifdef __clang__
#define TERRANE_THREAD_ANNOTATION(x) __attribute__((x))
#else
#define TERRANE_THREAD_ANNOTATION(x)
#endif
#define TERRANE_GUARDED_BY(mutex) TERRANE_THREAD_ANNOTATION(guarded_by(mutex))
#define TERRANE_REQUIRES(mutex) TERRANE_THREAD_ANNOTATION(requires_capability(mutex))

namespace terrane {

class TERRANE_THREAD_ANNOTATION(capability("mutex")) Mutex {
  public:
    void lock() TERRANE_THREAD_ANNOTATION(acquire_capability()) { mutex_.lock(); }

    void unlock() TERRANE_THREAD_ANNOTATION(release_capability()) { mutex_.unlock(); }

  private:
    std::mutex mutex_;
};

/// Holds the lock for a scope; `wait` gives it up while it sleeps.
class TERRANE_THREAD_ANNOTATION(scoped_lockable) MutexLock {
  public:
    explicit MutexLock(Mutex& mutex) TERRANE_THREAD_ANNOTATION(acquire_capability(mutex))
        : mutex_(mutex) {
        mutex_.lock();
    }

    ~MutexLock() TERRANE_THREAD_ANNOTATION(release_capability()) { mutex_.unlock(); }

    MutexLock(const MutexLock&) = delete;
    MutexLock& operator=(const MutexLock&) = delete;

    void wait(std::condition_variable_any& condition) { condition.wait(mutex_); }

    template <typename TimePoint>
    void wait_until(std::condition_variable_any& condition, TimePoint deadline) {
        condition.wait_until(mutex_, deadline);
    }

  private:
    Mutex& mutex_;
};

}  // namespace terrane
