// One session without a socket: bytes in, frames out, time stepped by hand.
#pragma once

#include "server/net/session.h"
#include "tests/server/gated_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <condition_variable>
#include <memory>
#include <optional>
#include <semaphore>
#include <thread>
#include <vector>

namespace terrane {

/// What the workers post, run by the test's thread.
class Mailbox {
  public:
    Session::Post post() {
        return [this](std::function<void()> step) {
            const MutexLock lock(mutex_);
            steps_.push_back(std::move(step));
            changed_.notify_all();
        };
    }

    void run(std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
            const auto step = take();
            ASSERT_TRUE(step) << "posted " << i << " of " << count << " steps";
            step();
        }
    }

    /// Runs what has been posted by now; how many steps that were.
    std::size_t run_posted() {
        std::size_t count = 0;
        for (;; ++count) {
            std::function<void()> step;
            {
                const MutexLock lock(mutex_);
                if (steps_.empty()) {
                    return count;
                }
                step = std::move(steps_.front());
                steps_.erase(steps_.begin());
            }
            step();
        }
    }

  private:
    /// Nothing if none comes for a long time.
    std::function<void()> take() {
        const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        MutexLock lock(mutex_);
        while (steps_.empty()) {
            if (std::chrono::steady_clock::now() >= deadline) {
                return nullptr;
            }
            lock.wait_until(changed_, deadline);
        }
        auto step = std::move(steps_.front());
        steps_.erase(steps_.begin());
        return step;
    }

    Mutex mutex_;
    std::condition_variable_any changed_;
    std::vector<std::function<void()>> steps_ TERRANE_GUARDED_BY(mutex_);
};

inline ClientHello client_hello(std::uint32_t version = kProtocolVersion) {
    return {.protocol_version = version, .client_name = "test", .token = {}};
}

inline ChunkRequest chunk_request(std::uint32_t id, std::vector<ChunkPos> keys,
                                  std::vector<Hash128> etags = {}, std::int32_t priority = 0) {
    ChunkRequest request;
    request.request_id = id;
    request.keys = std::move(keys);
    request.known_etags = std::move(etags);
    request.priority = priority;
    return request;
}

inline constexpr Hash128 kEtag{.high = 1, .low = 2};

struct SessionFixture {
    explicit SessionFixture(std::size_t payload_bytes = 1000, bool open = true) {
        gate.open = open;
        gate.chunk.status = ChunkStatus::full;
        gate.chunk.etag = kEtag;
        gate.chunk.payload = std::make_shared<const Bytes>(payload_bytes);
        service.emplace(ServiceOptions{.cache_bytes_max = std::size_t{64} << 20U}, counters,
                        gate.maker());
        context.service = &*service;
        context.hello.protocol_version = kProtocolVersion;
        context.hello.world_name = "drawn";
        context.hello.chunk_side = 32;
        context.hello.chunk_height = 32;
        context.hello.voxel_size_m = 1;
        context.hello.levels = 1;
        context.hello.limits = {.keys_per_request_max = kKeysPerRequestMax,
                                .keys_in_flight_max = kKeysInFlightPerSessionMax,
                                .inbound_frame_bytes_max = kInboundFrameBytesMax,
                                .payload_bytes_max = kPayloadBytesMax};
        context.world_file = "format = 1\n";
        begin();
    }

    /// A new session of the context as it is now; the old one has had its time.
    void begin() {
        if (session) {
            session->end();
        }
        session = std::make_shared<Session>(context, mailbox.post(), now);
    }

    ~SessionFixture() {
        gate.passes.release(10000);
        session->end();
        service->stop();
    }

    void send(const AnyMessage& message) { session->receive(encode_message(message), now); }

    void hello() {
        send(client_hello());
        ASSERT_EQ(read().size(), 1U);
    }

    void request(std::uint32_t id, std::vector<ChunkPos> keys, std::vector<Hash128> etags = {},
                 std::int32_t priority = 0) {
        send(chunk_request(id, std::move(keys), std::move(etags), priority));
    }

    /// Until nothing is under way any more: what the only worker does, and what follows from it.
    void settle() {
        for (;;) {
            mailbox.run_posted();
            if (service->in_flight() > 0) {
                std::this_thread::yield();
                continue;
            }
            // When the only worker has answered this, it has told of all that it took before.
            std::binary_semaphore reached(0);
            const auto asked =
                service->request(ColumnPos{.x = std::int64_t{1} << 30U, .z = 0}, -1'000'000'000,
                                 {.id = service->new_waiter_id(),
                                  .answer = [&](const Result<Answer>&) { reached.release(); }});
            if (!asked) {  // the queue is full: the worker is at it
                std::this_thread::yield();
                continue;
            }
            reached.acquire();
            ++settle_builds;
            if (mailbox.run_posted() == 0 && service->in_flight() == 0) {
                return;
            }
        }
    }

    /// Reads everything that is in the outbox, as a client does.
    std::vector<AnyMessage> read() {
        std::vector<AnyMessage> messages;
        FrameReader reader(kOutboundFrameLimits);
        while (!session->outbox().empty()) {
            Outbox::Gather parts;
            const std::size_t count = session->outbox().gather(parts);
            std::size_t size_bytes = 0;
            for (std::size_t i = 0; i < count; ++i) {
                reader.feed(parts[i]);
                size_bytes += parts[i].size();
                for (auto frame = reader.next(); frame && *frame; frame = reader.next()) {
                    auto message = decode_message(**frame);
                    if (!message) {
                        ADD_FAILURE() << message.error().message;
                        return messages;
                    }
                    messages.push_back(*std::move(message));
                }
            }
            session->written(size_bytes, now);
        }
        return messages;
    }

    Gate gate;
    int settle_builds = 0;  ///< of gate.builds, those that settle asked for
    ServiceCounters counters;
    std::optional<ChunkService> service;
    SessionContext context;
    Mailbox mailbox;
    Session::Clock::time_point now{};
    std::shared_ptr<Session> session;
};

inline ChunkPos at(std::int32_t x, std::int32_t y = 0) {
    return {.lod = 0, .x = x, .y = y, .z = 0};
}

inline ErrorCode failure_code(const AnyMessage& message) {
    const auto* failure = std::get_if<Failure>(&message);
    return failure == nullptr ? static_cast<ErrorCode>(0) : failure->error.code;
}

}  // namespace terrane
