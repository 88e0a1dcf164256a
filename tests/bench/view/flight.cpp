#include "tests/bench/view/flight.h"

#include "client-sample/cpp/client.h"
#include "server/chunks/chunk_key.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <thread>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace terrane::bench {

namespace {

struct PosHash {
    std::size_t operator()(const ChunkPos& pos) const {
        return KeyHash{}(ChunkKey{.position = pos});
    }
};

double ms_between(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double, std::milli>(to - from).count();
}

class Flight {
  public:
    explicit Flight(const FlightPlan& plan) : plan_(plan), view_(plan.world, {}) {}

    FlightFigures run() {
        auto client = Client::connect({.host = "127.0.0.1",
                                       .port = plan_.port,
                                       .timeout = std::chrono::seconds(20),
                                       .client_name = plan_.name,
                                       .token = {}});
        if (plan_.connected) {
            plan_.connected();
        }
        if (!client) {
            figures_.error = client.error().message;
            return figures_;
        }
        begun_ = Clock::now();
        const auto step = std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(1 / plan_.updates_per_second));
        const auto end = begun_ + std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(plan_.seconds));
        for (auto due = begun_; Clock::now() < end && !(plan_.until_complete && is_complete());) {
            if (const auto sent = client->view(look(Clock::now())); !sent) {
                figures_.error = sent.error().message;
                return figures_;
            }
            due = std::max(due + step, Clock::now());
            if (!receive_until(*client, due)) {
                return figures_;
            }
        }
        return figures_;
    }

  private:
    bool is_complete() const { return figures_.complete_ms > 0; }

    /// Where the viewer is now, and what that makes wanted and unwanted.
    ViewUpdate look(Clock::time_point now) {
        const Place at = plan_.place(std::chrono::duration<double>(now - begun_).count());
        ViewUpdate update;
        update.x = at.x;
        update.y = at.y;
        update.z = at.z;
        update.velocity = {
            .x = static_cast<float>(at.velocity_x), .y = 0, .z = static_cast<float>(at.velocity_z)};
        update.direction = update.velocity;
        update.field_of_view = 1.2F;
        update.radius_chunks = plan_.radii;
        view_.update(update);
        while (view_.has_wish()) {
            wanted_.emplace(view_.take(), now);
        }
        while (view_.has_forgotten()) {
            for (const ChunkPos key : view_.take_forgotten(4096)) {
                held_.erase(key);
                wanted_.erase(key);
            }
        }
        look_near(at, now);
        ++figures_.updates;
        return update;
    }

    void look_near(const Place& at, Clock::time_point now) {
        const auto x = static_cast<std::int32_t>(std::floor(at.x / plan_.world.side));
        const auto z = static_cast<std::int32_t>(std::floor(at.z / plan_.world.side));
        std::erase_if(near_, [&](const auto& entry) {
            const bool left = std::abs(entry.first.x - x) > 1 || std::abs(entry.first.z - z) > 1;
            figures_.near_missed += left ? 1U : 0U;
            return left;
        });
        bool all_there = true;
        for (std::int32_t dx = -1; dx <= 1; ++dx) {
            for (std::int32_t dz = -1; dz <= 1; ++dz) {
                for (std::int32_t y = 0; y < view_.heights(); ++y) {
                    const ChunkPos key{.lod = 0, .x = x + dx, .y = y, .z = z + dz};
                    if (held_.contains(key)) {
                        continue;
                    }
                    near_.try_emplace(key, now);
                    all_there = all_there && (dx != 0 || dz != 0);
                }
            }
        }
        if (all_there && figures_.first_ground_ms == 0 && figures_.updates > 0) {
            figures_.first_ground_ms = ms_between(begun_, now);
        }
        if (!all_there && figures_.first_ground_ms > 0) {
            ++figures_.underfoot_missing;
        }
    }

    bool receive_until(Client& client, Clock::time_point due) {
        while (Clock::now() < due) {
            const auto event = client.next(due);
            if (!event) {
                figures_.error = event.error().message;
                return false;
            }
            if (*event) {
                if (const auto* chunk = std::get_if<ReceivedChunk>(&**event)) {
                    take(*chunk, Clock::now());
                } else if (const auto* failure = std::get_if<Failure>(&**event)) {
                    figures_.error = failure->error.message;
                    return false;
                }
            }
        }
        return true;
    }

    void take(const ReceivedChunk& chunk, Clock::time_point now) {
        const ChunkPos key = chunk.answer.key;
        const std::uint64_t bytes = chunk.payload.size();
        ++figures_.chunks;
        figures_.payload_bytes += bytes;
        figures_.largest_payload_bytes = std::max(figures_.largest_payload_bytes, bytes);
        if (plan_.received_bytes != nullptr) {
            *plan_.received_bytes += bytes;
        }
        if (!view_.contains(key)) {
            figures_.out_of_view_bytes += bytes;
        } else {
            figures_.twice += held_.insert(key).second ? 0U : 1U;
        }
        const auto counts = [&](Clock::time_point wanted) {
            return ms_between(begun_, wanted) >= plan_.settle_seconds * 1000;
        };
        if (const auto since = near_.find(key); since != near_.end()) {
            if (counts(since->second)) {
                figures_.near_ms.push_back(ms_between(since->second, now));
            }
            near_.erase(since);
        }
        if (const auto since = wanted_.find(key); since != wanted_.end()) {
            if (counts(since->second)) {
                figures_.wanted_ms.push_back(ms_between(since->second, now));
            }
            wanted_.erase(since);
            if (wanted_.empty() && figures_.complete_ms == 0) {
                figures_.complete_ms = ms_between(begun_, now);
            }
        }
        if (plan_.read_bytes_per_second > 0) {
            std::this_thread::sleep_for(std::chrono::duration<double>(
                static_cast<double>(bytes + 128) / plan_.read_bytes_per_second));
        }
    }

    const FlightPlan& plan_;
    View view_;
    Clock::time_point begun_;
    std::unordered_set<ChunkPos, PosHash> held_;
    std::unordered_map<ChunkPos, Clock::time_point, PosHash> wanted_;
    std::unordered_map<ChunkPos, Clock::time_point, PosHash> near_;
    FlightFigures figures_;
};

}  // namespace

FlightFigures fly(const FlightPlan& plan) {
    return Flight(plan).run();
}

double percentile(std::vector<double> values, double part) {
    if (values.empty()) {
        return 0;
    }
    std::ranges::sort(values);
    const auto last = static_cast<double>(values.size() - 1);
    return values[static_cast<std::size_t>(std::ceil(last * part))];
}

}  // namespace terrane::bench
