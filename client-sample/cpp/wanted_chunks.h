// The chunks that a client has asked for and that have no answer yet. No socket; the time given.
//
// How keys travel: waiting (asked for, not sent) -> in flight (sent) -> an answer or a failure. A
// busy one pauses and waits again when its time has come.
#pragma once

#include "client-sample/cpp/client.h"
#include "client-sample/cpp/connection.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

namespace terrane {

/// One thread. A request has an id for the caller; on the wire every sending has one of its own.
class WantedChunks {
  public:
    /// Fails with `busy` beyond kUnansweredMax.
    Result<void> make_room_for(std::size_t count) const;
    void add(std::span<const ChunkPos> keys, ChunkFormat format, std::int32_t priority,
             std::uint32_t request_id);
    /// Nothing of that request will be given out any more. The ids on the wire that the server is
    /// to be told.
    std::vector<std::uint32_t> cancel(std::uint32_t request_id);

    /// Paused ones whose time has come wait again.
    void wake(Deadline now);
    /// The time of the next paused one.
    std::optional<Deadline> wake_at() const;

    /// Whether `next_request` has something to send that the server takes now.
    bool may_send(const WireLimits& limits) const;
    /// One request of the first waiting keys that were asked for together; they are in flight now.
    ChunkRequest next_request(const WireLimits& limits, std::uint32_t wire_id, Deadline now);

    /// For the caller; nothing if it was cancelled. Fails with `malformed` if nobody asked for it.
    Result<std::optional<ReceivedChunk>> take(const ChunkAnswer& answer, Bytes payload,
                                              Deadline now);
    /// Those for the caller, one a key. Fails with `malformed` if nobody asked for it.
    Result<std::vector<Failure>> take(const Failure& failure, Deadline now);

    /// Cancelled ones left out.
    std::size_t unanswered() const { return unanswered_; }

  private:
    /// A key that has no answer yet.
    struct Wanted {
        ChunkPos key;
        ChunkFormat format = ChunkFormat::draco;
        std::int32_t priority = 0;
        std::uint32_t request_id = 0;  ///< as the caller knows it
        int tries = 0;
        bool is_cancelled = false;
        Deadline first_sent;
    };

    std::optional<Failure> settle(const Wanted& wanted, const Failure& failure, Deadline now);

    std::size_t unanswered_ = 0;  ///< keys that are waiting, paused or in flight, and not cancelled
    std::size_t keys_in_flight_ = 0;
    std::deque<Wanted> waiting_;
    std::multimap<Deadline, Wanted> paused_;
    std::map<std::uint32_t, std::vector<Wanted>> in_flight_;  ///< by the id on the wire
};

}  // namespace terrane
