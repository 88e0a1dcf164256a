// A server whose work can be watched: which chunk was built when, how often, and how much each
// session came to hold. Made of the server's own parts: service, builder, sessions, listener.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/mutex.h"
#include "server/chunks/build_chunk.h"
#include "server/chunks/chunk_service.h"
#include "server/net/listener.h"
#include "server/net/session.h"
#include "storage/memory_store.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace terrane::bench {

using Clock = std::chrono::steady_clock;

/// One piece of work, done or stopped.
struct Build {
    ChunkPos key;
    Clock::time_point begun;
    Clock::time_point ended;
    bool is_answer = false;  ///< else it was stopped
};

/// Every piece of work of all workers. Any thread.
class BuildLog {
  public:
    void add(const Build& build) {
        const MutexLock lock(mutex_);
        builds_.push_back(build);
    }

    std::vector<Build> all() const {
        const MutexLock lock(mutex_);
        return builds_;
    }

  private:
    mutable Mutex mutex_;
    std::vector<Build> builds_ TERRANE_GUARDED_BY(mutex_);
};

/// What one session came to hold and when it last took a view. Any thread.
struct SessionWatch {
    std::atomic<std::size_t> outbox_bytes_max{0};
    std::atomic<std::size_t> uncredited_bytes_max{0};
    std::atomic<Clock::rep> last_input{0};  ///< handled
};

class ViewServer {
  public:
    ViewServer(std::shared_ptr<const World> world, std::size_t workers, std::size_t io_threads);
    ~ViewServer();
    ViewServer(const ViewServer&) = delete;
    ViewServer& operator=(const ViewServer&) = delete;

    std::uint16_t port() const { return listener_->endpoint(0).port; }

    const ServiceCounters& counters() const { return counters_; }

    std::vector<Build> builds() const { return log_.all(); }

    /// By the name that the client gave.
    std::shared_ptr<SessionWatch> watch(const std::string& client_name);

  private:
    const std::shared_ptr<const World> world_;
    MemoryStore store_;
    ServiceCounters counters_;
    StackCache stacks_;
    BuildLog log_;
    std::optional<ChunkService> service_;
    SessionContext context_;
    Mutex mutex_;
    std::map<std::string, std::shared_ptr<SessionWatch>> watches_ TERRANE_GUARDED_BY(mutex_);
    std::unique_ptr<Listener> listener_;
};

}  // namespace terrane::bench
